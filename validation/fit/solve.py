# SPDX-License-Identifier: BSD-3-Clause
"""Levenberg and Marquardt's method on the pixels of an image, robust to those that
disagree, with intervals.

1. Starts are tried over three decades of extinction and the whole range of g, each with the factor
   on the image that fits best, by a loss of relative errors that no single pixel decides
   (Cauchy's).
2. From the best of them the same loss is minimised, on few pixels first. 3. The residuals
   tell the noise of the image:
least squares with the weights 1/sigma^2, without outliers, until neither changes. Weights that
depend on the model, not on the values, stay unbiased even if the noise is skewed.

Noise of renderers has a constant part and a part that grows with the radiance f, so

    sigma^2 = a^2 + b^2 f^2,    a, b >= 0,

is fitted to the scatter of the residuals in groups of like radiance. The scatter of a group is
1.4826 times the median of |residual|, the standard deviation of a normal distribution, which pixels
that are wrong by any amount do not move as long as they are less than half. Values that are off by
more than six sigma are outliers, which not one of a million normal values is. They are left out,
with all of their pixel.

The covariance is the sandwich

    C = B^-1 M B^-1,    B = sum w J J^T,    M = sum_pixels s s^T,    s = sum_channels w J e,

which is right for noise that differs from pixel to pixel and is shared by the channels of one;
pixels must be independent (White 1980, Econometrica 48, 817; its form for clusters by Liang and
Zeger 1986, Biometrika 73, 13).

An ellipse of the covariance is right where the image is linear in the parameters. With 20 % of
noise an extinction may be known to a factor of two, and the intervals of the ellipse held the value
in 83 to 89 % of cases. The profile of the sum of squares Q depends on no choice of parameters: with
Q_k(t) the least one with parameter k held at t, and at its least Q,

    (Q_k(t) - Q) / a_k

has the distribution of chi squared with one degree of freedom, where a_k is the variance of the
sandwich over that of independent values of these weights (Venzon and Moolgavkar 1988, Appl.
Statist. 37, 87; with the factor: Rotnitzky and Jewell 1990, Biometrika 77, 485). Where the image is
linear, these are the ends of the ellipse.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import compress, product
from typing import Any

import numpy as np
from scipy.optimize import least_squares, nnls

from airlight.validation.arrays import Array, Bools
from airlight.validation.engine.fault import Number
from airlight.validation.engine.prediction import Guess, Predictor
from airlight.validation.engine.search import guess_of, inward, outward
from airlight.validation.fit.unknowns import Unknown

SIGMAS = 1.959964  #: standard errors in half of a 95 % interval

# of numbers on the whole line: central differences err by its square, and by rounding over it
_STEP = 1e-4
_SIGMA_STARTS = (1.0, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0)
_G_STARTS = (0.0, -0.6, 0.5, 0.85)
_FACTORS = ("intensity", "exposure", "albedo")
_SEARCHES, _SHORT, _LONG = 5, 20, 60  # of starts that are followed, and steps
_USUAL = 0.05  # relative error that a start may well have
_DIM = 0.01  # of the mean of the image: below it a value need not be right relative to itself
_ROUNDS = 6
_LEAST_KEPT = 0.5  # fraction of the pixels that must agree with one another
_OUTLIER = 6.0  # standard deviations beyond which a value is left out with its pixel
_GROUPS = 24
_ROUNDING = 2e-7  # of the radiance: values are float32
_LINEAR = 1e-3  # of a number on the whole line: in so short a step the image is linear in it
_CLOSE = 0.02  # of half an interval
_TURNS = 10  # where so many do not reach an end, there is none
_GROWTH = 3.0  # of a step, at most
_FARTHEST = 10.0  # a factor of 22 000, or an artanh g of 10
_UNBOUNDED = 30.0  # a factor of 10^13: where an image allows it, there is no end


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
            Guess(predictor.fog),
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
        """Return the model with the parameters that are not free held where they are at a place."""
        free_ones, held_ones = (
            replace(self, unknowns=tuple(compress(self.unknowns, chosen)), at=self.at[chosen])
            for chosen in (free, ~free)
        )
        return replace(free_ones, guess=held_ones.guess_at(place[~free]))

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
    kept: Bools  #: which pixels took part in the end, (pixels,)
    weights: Array  #: 1/sigma, (pixels, 3)
    stretch: Array  #: variances over those of independent values of these weights, (parameters,)


def best_start(model: Model) -> Array:
    """Return where the search should begin: the best end of short searches from
    the best of many starts.

    Thin fog of a large albedo looks much like thick fog from afar, so that the best start
    may lead to a worse end.
    """
    trials = sorted(_trials(model), key=lambda trial: trial[0])[:_SEARCHES]
    ends = [_search(model, trial, _SHORT) for _, trial in trials]
    return min(ends, key=lambda end: _loss(model, model.values(end)))


def robust_fit(model: Model, start: Array) -> Array:
    """Return the parameters with the least Cauchy loss of relative errors, its
    scale that of what is left.
    """
    for _ in range(2):
        start = _search(model, start, _LONG)
    return start


def _search(model: Model, start: Array, steps: int) -> Array:
    """Return the end of a search for the least Cauchy loss of relative errors."""
    residual, slopes = _weighted(model, 1 / model.relative, np.ones(len(model.image), dtype=bool))
    unit = max(2 * 1.4826 * float(np.median(np.abs(residual(start)))), 1e-7)
    how: dict[str, Any] = {"loss": "cauchy", "f_scale": unit, "max_nfev": steps}
    return _least(residual, slopes, model.numbers, start, **how)


def _least(
    residuals: Callable[[Array], Array],
    slopes: Callable[[Array], Array],
    numbers: Sequence[Number],
    start: Array,
    **how: Any,
) -> Array:
    """Return the place with the least sum of squares, or of another loss of SciPy's, in
    the ranges of the numbers.

    A logarithm, or an artanh, does not go farther than `_FARTHEST` from where it starts: an image
    that needs more tells nothing, and an unbounded step may overflow.
    """
    reach = np.array([math.inf if number.scale == "plain" else _FARTHEST for number in numbers])
    low, high = (
        inward(numbers, [getattr(number, end) for number in numbers]) for end in ("low", "high")
    )
    ends = np.maximum(low, start - reach), np.minimum(high, start + reach)
    return np.asarray(least_squares(residuals, start, slopes, bounds=ends, x_scale="jac", **how).x)


def _trials(model: Model) -> list[tuple[float, Array]]:
    """Return starts with their losses: all extinctions times a factor, with some g, and
    the factor that fits best.

    The extinctions are those to begin with and, where these differ from one another, their mean:
    channels whose starts lie decades apart lead to no common end.
    """
    given, unknowns = model.at, model.unknowns
    sigmas = [n for n, unknown in enumerate(unknowns) if unknown.kind.startswith("sigma")]
    gs = [n for n, unknown in enumerate(unknowns) if unknown.kind == "phase.g"]
    factors = [n for n, unknown in enumerate(unknowns) if unknown.kind in _FACTORS]
    # If several parameters multiply the same, such as albedo and exposure, only the
    # first kind takes the factor.
    chosen = [n for n in factors if unknowns[n].kind == unknowns[factors[0]].kind]
    trials = []
    grey = given.copy()
    grey[sigmas] = given[sigmas].mean() if sigmas else 0.0
    bases = (given,) if np.array_equal(grey, given) else (given, grey)
    for base, times, g in product(
        bases, _SIGMA_STARTS if sigmas else (1.0,), (None, *_G_STARTS) if gs else (None,)
    ):
        trial = base.copy()
        trial[sigmas] += math.log(times)
        trial[gs] = given[gs] if g is None else math.atanh(g)
        radiance = model.values(trial)
        if factors:
            lit = (radiance > _DIM * radiance.mean()) & (model.image > 0)
            usual = float(np.median(model.image[lit] / radiance[lit])) if lit.any() else 1.0
            trial[chosen] += math.log(usual)
            radiance = model.values(trial)
        trials.append((_loss(model, radiance), trial))
    return trials


def _loss(model: Model, radiance: Array) -> float:
    return float(np.mean(np.log1p(((model.image - radiance) / model.relative / _USUAL) ** 2)))


def weighted_fit(model: Model, start: Array) -> Solution:
    """Return the solution of least squares with the weights that the noise asks
    for, and without outliers.
    """
    inner, kept = start, np.ones(len(model.image), dtype=bool)
    for _ in range(_ROUNDS):
        radiance = model.values(inner)
        residual = model.image - radiance
        sigma = noise_of(radiance.ravel(), residual.ravel()).reshape(radiance.shape)
        before, kept = kept, np.all(np.abs(residual) <= _OUTLIER * sigma, axis=1)
        weights = 1 / sigma
        if kept.mean() < _LEAST_KEPT:
            # Nothing explains most of the image: what is left is no noise. All pixels
            # count, relative to themselves.
            weights, kept = 1 / model.relative, np.ones_like(kept)
            break
        last, inner = (
            inner,
            _least(*_weighted(model, weights, kept), model.numbers, inner, max_nfev=40),
        )
        moved = float(np.max(np.abs(inner - last), initial=0.0))
        if moved < 1e-9 and np.array_equal(before, kept):
            break
    radiance = model.values(inner)
    residual = model.image - radiance
    covariance, stretch = _sandwich(model.slopes(inner), residual, weights, kept)
    return Solution(inner, covariance, residual, radiance, kept, weights, stretch)


def no_solution(model: Model) -> Solution:
    """Return the solution where no parameter is free."""
    radiance, empty = model.values(np.empty(0)), np.empty(0)
    residual, kept = model.image - radiance, np.ones(len(model.image), dtype=bool)
    return Solution(
        empty, np.empty((0, 0)), residual, radiance, kept, np.ones_like(radiance), empty
    )


def _weighted(
    model: Model, weights: Array, kept: Bools
) -> tuple[Callable[[Array], Array], Callable[[Array], Array]]:
    """Return the function whose squares are summed, of the parameters,
    (values,), and its derivatives.
    """
    return (
        lambda inner: ((model.image - model.values(inner)) * weights)[kept].ravel(),
        lambda inner: -(model.slopes(inner) * weights[:, :, None])[kept].reshape(-1, len(inner)),
    )


def _sandwich(
    derivatives: Array, residual: Array, weights: Array, kept: Bools
) -> tuple[Array, Array]:
    """Return the covariance, and its variances over those of independent
    values of these weights.
    """
    slopes, count = (derivatives * weights[:, :, None])[kept], derivatives.shape[2]
    flat = slopes.reshape(-1, count)
    scores = np.einsum("pck,pc->pk", slopes, (residual * weights)[kept])
    size = np.linalg.norm(flat, axis=0)
    size = np.where(size > 0, size, 1.0)
    bread = np.linalg.pinv((flat / size).T @ (flat / size), rcond=1e-14)
    freedom = len(scores) / max(len(scores) - count, 1)
    meat = (scores / size).T @ (scores / size) * freedom
    covariance = bread @ meat @ bread
    stretch = np.diag(covariance) / np.maximum(np.diag(bread), 1e-300)
    return covariance / np.outer(size, size), stretch


def noise_of(radiance: Array, residual: Array) -> Array:
    """Return the standard deviation of each value.

    `radiance`, `residual`: of the model, and image minus model, (n,) each [W/(m^2 sr)].
    """
    usual = float(np.mean(np.abs(radiance + residual)))  # of the image
    least = _ROUNDING * (np.abs(radiance) + 1e-3 * usual) + 1e-140
    order = np.argsort(radiance)
    groups = [
        group
        for group in np.array_split(order, min(_GROUPS, max(1, len(order) // 8)))
        if len(group)
    ]
    scatter = np.array([1.4826 * np.median(np.abs(residual[group])) for group in groups])
    scatter = np.maximum(scatter, [np.median(least[group]) for group in groups])
    squares = np.array([np.median(radiance[group] ** 2) for group in groups])
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
    """Return one end; `step` leads to that of the ellipse."""
    best = float(solution.inner[number])
    if not _LINEAR < abs(step) < math.inf:
        return best + step
    # how the others go with it
    way = solution.covariance[:, number] / solution.covariance[number, number]
    # distances, and standard errors beyond the end there
    below, above = (0.0, -SIGMAS), (math.nan, math.nan)
    distance = step
    for _ in range(_TURNS):
        place, errors = _profile(model, solution, number, solution.inner + distance * way)
        way, beyond = (place - solution.inner) / distance, errors - SIGMAS
        if abs(beyond) < _CLOSE * SIGMAS or abs(above[0] - below[0]) < _CLOSE * abs(above[0]):
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
            if abs(distance) > _UNBOUNDED:
                break
            distance *= min(1.1 * SIGMAS / max(errors, 1e-9), _GROWTH)
        else:
            distance = below[0] - below[1] * (above[0] - below[0]) / (above[1] - below[1])
    return best + distance if math.isfinite(above[0]) else math.copysign(math.inf, step)


def _profile(model: Model, solution: Solution, number: int, place: Array) -> tuple[Array, float]:
    """Return the best place with one parameter held, and how many standard errors it is
    away from the best of all.
    """
    free = np.arange(len(place)) != number
    best = place.copy()
    if free.any():
        others = model.holding(free, place)
        # The sum of squares is some thousand: `ftol` tells standard errors to 1 %.
        how: dict[str, Any] = {"ftol": 1e-5, "max_nfev": 20}
        weighted = _weighted(others, solution.weights, solution.kept)
        best[free] = _least(*weighted, others.numbers, place[free], **how)
    residual, _ = _weighted(model, solution.weights, solution.kept)
    least = float(np.sum((solution.residual * solution.weights)[solution.kept] ** 2))
    return best, math.sqrt(
        max(float(np.sum(residual(best) ** 2)) - least, 0.0) / float(solution.stretch[number])
    )
