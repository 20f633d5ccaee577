# SPDX-License-Identifier: BSD-3-Clause
"""Least squares on the pixels of an image, robust to outliers, with intervals.

The search is SciPy's trust-region method for parameters with ends (Branch, Coleman and Li 1999,
SIAM J. Sci. Comput. 21, 1).

1. Starts are tried over three decades of extinction and the whole range of g, each with the factor
   on the image that fits best, by a loss of relative errors that no single pixel decides
   (Cauchy's).
2. The same loss is minimised from the best of the starts, on few pixels first.
3. The residuals say how large the noise of the image is. Least squares with the weights 1/sigma^2
   and without outliers follow, until neither changes. The weights depend on the model, not on the
   values: so the fit stays unbiased even if the noise is skewed.

Noise of renderers has a constant part and a part that grows with the radiance f, so

    sigma^2 = a^2 + b^2 f^2,    a, b >= 0,

is fitted to the scatter of the residuals in groups of like radiance. The scatter of a group is
1.4826 times the median of |residual|, which is the standard deviation of a normal distribution.
Pixels that are wrong by any amount hardly move it as long as they are fewer than half. Values that
are off by more than six sigma are outliers: not one of a million normal values is. A pixel with an
outlier is left out.

The covariance is the sandwich

    C = B^-1 M B^-1,    B = sum w J J^T,    M = sum_pixels s s^T,    s = sum_channels w J e,

which is right for noise that differs from pixel to pixel and is shared by the channels of one;
pixels must be independent (White 1980, Econometrica 48, 817; its form for clusters by Liang and
Zeger 1986, Biometrika 73, 13).

An ellipse of the covariance is right where the image is linear in the parameters. With 20 % of
noise an extinction may be known to a factor of two, and the intervals of the ellipse held the value
in 83 to 89 % of cases. The profile of the sum of squares depends on no choice of parameters: with
Q_k(t) the least sum with the parameter k held at t, and Q the least sum of all,

    (Q_k(t) - Q) / a_k

has the distribution of chi squared with one degree of freedom, where a_k is the variance of the
sandwich over the variance that independent values of these weights have (Venzon and Moolgavkar
1988, Appl. Statist. 37, 87; with the factor: Rotnitzky and Jewell 1990, Biometrika 77, 485). Where
the image is linear, these are the ends of the ellipse.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress, product

import numpy as np
from scipy.optimize import least_squares, nnls

from airlight.validation.arrays import Array, Bools
from airlight.validation.engine.fault import Number
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.engine.search import guess_of, inward, outward, usual_size
from airlight.validation.fit.unknowns import Unknown

SIGMAS = 1.959964  #: standard errors in half of a 95 % interval

# of numbers on the whole line: central differences err by its square, and by rounding over it
_STEP = 1e-4
# Factors on the extinctions to begin with, about three apart over three decades; and g from
# backward to forward lobes. `best_start` follows the best of all.
_SIGMA_STARTS = (1.0, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0)
_G_STARTS = (0.0, -0.6, 0.5, 0.85)
_FACTORS = ("intensity", "exposure", "albedo")
_DIM = 0.01  # of the mean of the image: below it a value need not be right relative to itself


@dataclass(frozen=True)
class Model:
    """The values of an image's pixels, as a function of the places of
    parameters on the whole line.
    """

    predictor: Predictor
    unknowns: tuple[Unknown, ...]
    at: Array  #: where paths are found, which are held for other places, (unknowns,)
    guess: Guess  #: with the parameters that are held

    @staticmethod
    def of(predictor: Predictor, unknowns: tuple[Unknown, ...]) -> "Model":
        """Return the model of an image with the paths where parameters begin."""
        numbers = [unknown.number for unknown in unknowns]
        return Model(
            predictor,
            unknowns,
            inward(numbers, [each.starts[0] for each in numbers]),
            predictor.unchanged,
        )

    @property
    def numbers(self) -> list[Number]:
        """The numbers that are looked for."""
        return [unknown.number for unknown in self.unknowns]

    @property
    def image(self) -> Array:
        """The values of the image, (m, 3)."""
        return self.predictor.shown(self.guess)

    def guess_at(self, place: Array) -> Guess:
        """Return the guess for places of the parameters."""
        values, at = (outward(self.numbers, each) for each in (place, self.at))
        return guess_of(self.predictor, self.unknowns, values, at=at, guess=self.guess)

    def values(self, place: Array) -> Array:
        """Return the radiance of the pixels, (m, 3) [W/(m^2 sr)]."""
        return self.predictor.predicted(self.guess_at(place))

    def slopes(self, place: Array) -> Array:
        """Return the derivatives of `values` by each place, (m, 3, unknowns)."""
        steps = _STEP * np.eye(len(place))
        return np.stack(
            [
                (self.values(place + step) - self.values(place - step)) / (2 * _STEP)
                for step in steps
            ],
            2,
        )

    def holding(self, free: Bools, place: Array) -> "Model":
        """Return the model of the free parameters; the others are held at their place."""
        free_model, held_model = (
            replace(self, unknowns=tuple(compress(self.unknowns, chosen)), at=self.at[chosen])
            for chosen in (free, ~free)
        )
        return replace(free_model, guess=held_model.guess_at(place[~free]))

    @property
    def relative(self) -> Array:
        """The unit of relative errors, (m, 3)."""
        size = np.abs(self.image)
        return np.maximum(size, _DIM * max(float(size.mean()), 1e-300))


@dataclass(frozen=True)
class Solution:
    """The parameters that explain an image best, as numbers on the whole line."""

    inner: Array  #: (parameters,)
    covariance: Array  #: (parameters, parameters)
    residual: Array  #: image minus model, (pixels, 3) [W/(m^2 sr)]
    radiance: Array  #: of the model, (pixels, 3) [W/(m^2 sr)]
    mask: Bools  #: which pixels took part in the end, (pixels,)
    weights: Array  #: 1/sigma, (pixels, 3)
    stretch: Array  #: variances over those of independent values of these weights, (parameters,)


def best_start(model: Model) -> Array:
    """Return where the search should begin: the best end of short searches from
    the best of many starts.

    Thin fog of a large albedo looks much like thick fog from afar, so that the best start
    may lead to a worse end.
    """
    # Five starts are followed, over 20 steps each.
    trials = sorted(_trials(model), key=lambda trial: trial[0])[:5]
    ends = [_search(model, trial, 20) for _, trial in trials]
    return min(ends, key=lambda end: _loss(model, model.values(end)))


def robust_fit(model: Model, start: Array) -> Array:
    """Return the parameters with the least Cauchy loss of relative errors, whose scale is the
    size of the residual.
    """
    # Twice, since the scale of the first search is the residual at its start. 60 steps at most.
    for _ in range(2):
        start = _search(model, start, 60)
    return start


def _search(model: Model, start: Array, steps: int) -> Array:
    """Return the end of a search for the least Cauchy loss of relative errors."""
    residual, slopes = _weighted(model, 1 / model.relative, np.ones(len(model.image), dtype=bool))
    # Errors beyond two usual ones count less and less. The scale is 1e-7 at least: an image may
    # have no error at all.
    unit = max(2 * usual_size(residual(start)), 1e-7)
    return _least(residual, slopes, model.numbers, start, steps=steps, loss="cauchy", f_scale=unit)


def _least(
    residuals: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    numbers: Sequence[Number],
    start: Array,
    *,
    steps: int,
    loss: str = "linear",
    f_scale: float = 1.0,
    ftol: float = 1e-8,
) -> Array:
    """Return the place with the least sum of squares, or of another loss, in the ranges of the
    numbers; `steps` at most. `loss`, `f_scale`, `ftol`: of `scipy.optimize.least_squares`.

    A logarithm, or an artanh, does not go farther than 10 from where it starts, a factor of 22 000:
    an image that needs more says nothing of it, and an unbounded step may overflow.
    """
    # The search stays in the ranges of the numbers, and within a distance of its start.
    reach = _farthest(numbers)
    low, high = (
        inward(numbers, [getattr(number, end) for number in numbers]) for end in ("low", "high")
    )
    start = np.clip(start, low, high)
    ends = np.maximum(low, start - reach), np.minimum(high, start + reach)
    solved = least_squares(
        residuals,
        start,
        slopes,
        bounds=ends,
        x_scale="jac",
        loss=loss,
        f_scale=f_scale,
        ftol=ftol,
        max_nfev=steps,
    )
    return np.asarray(solved.x)


def _farthest(numbers: Sequence[Number]) -> Array:
    """Return how far a search goes from its start, for each number on the whole line."""
    return np.array([math.inf if number.scale == "plain" else 10.0 for number in numbers])


def _trials(model: Model) -> list[tuple[float, Array]]:
    """Return starts with their losses: all extinctions times a factor, with some g, and
    the factor that fits best.

    The extinctions are those to begin with and, where these differ from one another, their mean:
    channels whose starts lie decades apart lead to no common end.
    """
    begin, unknowns = model.at, model.unknowns
    sigmas = [n for n, unknown in enumerate(unknowns) if unknown.kind.startswith("sigma")]
    gs = [n for n, unknown in enumerate(unknowns) if unknown.kind == "phase.g"]
    factors = [n for n, unknown in enumerate(unknowns) if unknown.kind in _FACTORS]
    # If several parameters multiply the same, such as albedo and exposure, only the
    # first kind takes the factor.
    chosen = [n for n in factors if unknowns[n].kind == unknowns[factors[0]].kind]
    # `grey` has one extinction in all channels, media and layers: the mean of the logarithms.
    trials = []
    grey = begin.copy()
    grey[sigmas] = begin[sigmas].mean() if sigmas else 0.0
    bases = (begin,) if np.array_equal(grey, begin) else (begin, grey)
    for base, times, g in product(
        bases, _SIGMA_STARTS if sigmas else (1.0,), (None, *_G_STARTS) if gs else (None,)
    ):
        trial = base.copy()
        trial[sigmas] += math.log(times)
        # None is the value to begin with.
        trial[gs] = begin[gs] if g is None else math.atanh(g)
        radiance = model.values(trial)
        # Without the right factor no extinction fits: the median of image over model is one that
        # few pixels, such as those beside a light, do not decide.
        if factors:
            lit = (radiance > _DIM * radiance.mean()) & (model.image > 0)
            usual = float(np.median(model.image[lit] / radiance[lit])) if lit.any() else 1.0
            trial[chosen] += math.log(usual)
            radiance = model.values(trial)
        trials.append((_loss(model, radiance), trial))
    return trials


def _loss(model: Model, radiance: Array) -> float:
    # A start may well have relative errors of 5 %: only larger ones say that it is a bad one.
    return float(np.mean(np.log1p(((model.image - radiance) / model.relative / 0.05) ** 2)))


def weighted_fit(model: Model, start: Array) -> Solution:
    """Return the solution of least squares with the weights that the noise asks
    for, and without outliers.
    """
    # Rounds of three steps: the noise that the residuals show, the outliers by this noise, and the
    # parameters by both. `mask` are the pixels without an outlier. Six rounds at most.
    inner, mask = start, np.ones(len(model.image), dtype=bool)
    for _ in range(6):
        radiance = model.values(inner)
        residual = model.image - radiance
        sigma = noise_of(radiance.ravel(), residual.ravel()).reshape(radiance.shape)
        old_mask, mask = mask, np.all(np.abs(residual) <= 6.0 * sigma, axis=1)
        weights = 1 / sigma
        if mask.mean() < 0.5:
            # Nothing explains most of the image: the residual is no noise. All pixels count,
            # relative to themselves.
            weights, mask = 1 / model.relative, np.ones_like(mask)
            break
        old_inner, inner = (
            inner,
            _least(*_weighted(model, weights, mask), model.numbers, inner, steps=40),
        )
        step = float(np.max(np.abs(inner - old_inner), initial=0.0))
        if step < 1e-9 and np.array_equal(old_mask, mask):
            break
    # The last step moved the parameters: residual and derivatives are found once more.
    radiance = model.values(inner)
    residual = model.image - radiance
    covariance, stretch = _sandwich(model.slopes(inner), residual, weights, mask)
    return Solution(inner, covariance, residual, radiance, mask, weights, stretch)


def no_solution(model: Model) -> Solution:
    """Return the solution where no parameter is free."""
    radiance, empty = model.values(np.empty(0)), np.empty(0)
    residual, mask = model.image - radiance, np.ones(len(model.image), dtype=bool)
    return Solution(
        empty, np.empty((0, 0)), residual, radiance, mask, np.ones_like(radiance), empty
    )


def _weighted(
    model: Model, weights: Array, mask: Bools
) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Return the function whose squares are summed, of the parameters,
    (values,), and its derivatives.
    """
    return (
        lambda inner: ((model.image - model.values(inner)) * weights)[mask].ravel(),
        lambda inner: -(model.slopes(inner) * weights[:, :, None])[mask].reshape(-1, len(inner)),
    )


def _sandwich(
    derivatives: Array, residual: Array, weights: Array, mask: Bools
) -> tuple[Array, Array]:
    """Return the covariance, and its variances over the variances that independent
    values of these weights would have.
    """
    # `slopes` and `residual * weights` are in units of sigma, (pixels, 3, parameters) and
    # (pixels, 3). `scores` are the s of the module: a row for each pixel, summed over its channels.
    slopes, count = (derivatives * weights[:, :, None])[mask], derivatives.shape[2]
    flat = slopes.reshape(-1, count)
    scores = np.einsum("pck,pc->pk", slopes, (residual * weights)[mask])
    # B is inverted for columns of the length 1, and the covariance scaled back at the end:
    # parameters of very different size would leave no digits.
    size = np.linalg.norm(flat, axis=0)
    size = np.where(size > 0, size, 1.0)
    bread = np.linalg.pinv((flat / size).T @ (flat / size), rcond=1e-14)
    # n pixels leave n - p degrees of freedom to the residuals of a fit with p parameters.
    freedom = len(scores) / max(len(scores) - count, 1)
    meat = (scores / size).T @ (scores / size) * freedom
    covariance = bread @ meat @ bread
    stretch = np.diag(covariance) / np.maximum(np.diag(bread), 1e-300)
    return covariance / np.outer(size, size), stretch


def noise_of(radiance: Array, residual: Array) -> Array:
    """Return the standard deviation of each value.

    `radiance`, `residual`: of the model, and image minus model, (n,) each [W/(m^2 sr)].
    """
    # An image without noise has the rounding of float32 at least, 2e-7 of the radiance.
    mean = float(np.mean(np.abs(radiance + residual)))  # of the image
    least = 2e-7 * (np.abs(radiance) + 1e-3 * mean) + 1e-140
    # At most 24 groups of values of like radiance, with eight values in each at least.
    order = np.argsort(radiance)
    groups = [
        group for group in np.array_split(order, min(24, max(1, len(order) // 8))) if len(group)
    ]
    # Scatter of each group, and f^2 in it.
    scatter = np.array([usual_size(residual[group]) for group in groups])
    scatter = np.maximum(scatter, [np.median(least[group]) for group in groups])
    squares = np.array([np.median(radiance[group] ** 2) for group in groups])
    # sigma^2 = a^2 + b^2 f^2 by least squares of relative errors: each row is divided by the square
    # of its scatter, and should be 1. Neither a^2 nor b^2 may be negative.
    scale = max(float(squares.max()), 1e-280)
    rows = np.stack([np.ones_like(squares), squares / scale], axis=1) / scatter[:, None] ** 2
    (constant, relative), _ = nnls(rows, np.ones(len(rows)))
    return np.sqrt(constant + relative * radiance**2 / scale + least**2)


def interval_ends(model: Model, solution: Solution) -> Array:
    """Return the ends of the 95 % intervals as numbers on the whole line, infinite
    where the image sets none.

    Returns
    -------
    numpy.ndarray
        Low and high, (parameters, 2).
    """
    reach = SIGMAS * np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
    ends = [
        [_end(model, solution, number, sign * float(step)) for sign in (-1, 1)]
        for number, step in enumerate(reach)
    ]
    return np.array(ends).reshape(-1, 2)


def _end(model: Model, solution: Solution, number: int, step: float) -> float:
    """Return one end of an interval; `step` leads to the end by the ellipse."""
    close = 0.02  # of half an interval
    best, farthest = float(solution.inner[number]), _farthest(model.numbers)
    # In a step of less than 1e-3 on the whole line the image is linear: the ellipse is right.
    if not 1e-3 < abs(step) < math.inf:
        return best + step
    # `way` says how the other parameters go with this one; the best ones of each turn correct it.
    way = solution.covariance[:, number] / solution.covariance[number, number]
    # Two places with the end between them: the distance from the best parameters, and how many
    # standard errors the profile there is beyond the end. `above` is not found yet.
    below, above = (0.0, -SIGMAS), (math.nan, math.nan)
    # An ellipse that is wider than a search may go ends where numbers overflow.
    distance = float(np.clip(step, -farthest[number], farthest[number]))
    # Where ten turns find no place beyond the end, there is none.
    for _ in range(10):
        # The other parameters begin within a factor of 10^43, which overflows nowhere.
        start = solution.inner + np.clip(distance * way, -10 * farthest, 10 * farthest)
        start[number] = best + distance
        place, errors = _profile(model, solution, number, start)
        # Far beyond the end the profile may grow as an exponential, to which no line leads back: a
        # place counts as one half of an interval beyond at most.
        way, beyond = (place - solution.inner) / distance, min(errors - SIGMAS, SIGMAS)
        if abs(beyond) < close * SIGMAS or abs(above[0] - below[0]) < close * abs(above[0]):
            return best + distance
        # The root of a profile is nearly a line. An end that stays counts half each time
        # (the Illinois algorithm).
        if beyond > 0:
            below, above = (
                (below[0], below[1] if math.isnan(above[0]) else 0.5 * below[1]),
                (distance, beyond),
            )
        else:
            below, above = (distance, beyond), (above[0], 0.5 * above[1])
        if math.isnan(above[0]):
            # No end yet: a step a little beyond where a line through the profile reaches it, three
            # times as far at most. Where an image allows 30 of a logarithm, a factor of 10^13,
            # there is no end.
            if abs(distance) > 3.0 * farthest[number]:
                break
            distance *= min(1.1 * SIGMAS / max(errors, 1e-9), 3.0)
        else:
            distance = below[0] - below[1] * (above[0] - below[0]) / (above[1] - below[1])
    return best + distance if math.isfinite(above[0]) else math.copysign(math.inf, step)


def _profile(model: Model, solution: Solution, number: int, place: Array) -> tuple[Array, float]:
    """Return the best place with one parameter held, and how many standard errors it is
    away from the best of all.
    """
    # Q_k(t) of the module: all other parameters are fitted with the weights of the solution.
    free = np.arange(len(place)) != number
    best = place.copy()
    if free.any():
        others = model.holding(free, place)
        # The sum of squares is some thousand: `ftol` tells standard errors to 1 %.
        weighted = _weighted(others, solution.weights, solution.mask)
        best[free] = _least(*weighted, others.numbers, place[free], steps=20, ftol=1e-5)
    # The root of (Q_k(t) - Q)/a_k is a number of standard errors. Rounding may make it negative.
    residual, _ = _weighted(model, solution.weights, solution.mask)
    least = float(np.sum((solution.residual * solution.weights)[solution.mask] ** 2))
    return best, math.sqrt(
        max(float(np.sum(residual(best) ** 2)) - least, 0.0) / float(solution.stretch[number])
    )
