# SPDX-License-Identifier: BSD-3-Clause
"""Levenberg and Marquardt's method on the pixels of an image, robust to those that disagree, with a covariance.

1. Starts are tried over three decades of extinction and the whole range of g, each with the factor on the image that
   fits best, by a loss of relative errors that no single pixel decides (Cauchy's).
2. From the best of them the same loss is minimised, on few pixels first.
3. What is left says how noisy the image is (`validation.fit.noise`): least squares with the weights 1/sigma^2, without
   outliers, until neither changes.

The covariance is the sandwich

    C = B^-1 M B^-1,    B = sum w J J^T,    M = sum_pixels s s^T,    s = sum_channels w J e,

which is right for noise that differs from pixel to pixel and is shared by the channels of one; pixels must be
independent (White 1980, Econometrica 48, 817; its form for clusters by Liang and Zeger 1986, Biometrika 73, 13).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from validation.fit.image_model import ImageModel
from validation.fit.noise import noise_of, outliers
from validation.fit.unknowns import Unknown

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]

_ROUNDS = 6
_LEAST_KEPT = 0.5  # share of the pixels that must agree with one another
_SIGMA_STARTS = (1.0, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0)
_G_STARTS = (0.0, -0.6, 0.5, 0.85)
_DIM = 0.01  # of the mean of the image: below it a value need not be right relative to itself
_FARTHEST = 10.0  # of the start: a factor of 22 000, or an artanh g of 10: an image that asks for more says nothing
_SEARCHES = 5
_SHORT, _LONG = 20, 60  # steps
_USUAL = 0.05  # relative error that a start may well have
_FACTORS = ("intensity", "exposure", "albedo")


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


def best_start(model: ImageModel, unknowns: Sequence[Unknown]) -> Array:
    """Return where the search should begin: the best end of short searches from the best of many starts.

    Thin fog of a large albedo looks much like thick fog from afar, so that the best start may lead to a worse end.
    """
    trials = sorted(_trials(model, unknowns), key=lambda trial: trial[0])[:_SEARCHES]
    ends = [_search(model, unknowns, trial, _SHORT) for _, trial in trials]
    return min(ends, key=lambda end: _loss(model, model.values(unknowns, end)))


def robust_fit(model: ImageModel, unknowns: Sequence[Unknown], start: Array) -> Array:
    """Return the parameters with the least Cauchy loss of relative errors, its scale that of what is left."""
    for _ in range(2):
        start = _search(model, unknowns, start, _LONG)
    return start


def _search(model: ImageModel, unknowns: Sequence[Unknown], start: Array, steps: int) -> Array:
    """Return the end of a search for the least Cauchy loss of relative errors."""
    scale = _relative(model.image)

    def residuals(inner: Array) -> Array:
        return ((model.image - model.values(unknowns, inner)) / scale).ravel()

    def slopes(inner: Array) -> Array:
        return -(model.derivatives(unknowns, inner) / scale[:, :, None]).reshape(-1, len(inner))

    reach = np.array([np.inf if unknown.moves else _FARTHEST for unknown in unknowns])
    unit = max(2 * 1.4826 * float(np.median(np.abs(residuals(start)))), 1e-7)
    solved = least_squares(
        residuals,
        start,
        slopes,
        loss="cauchy",
        f_scale=unit,
        x_scale="jac",
        max_nfev=steps,
        bounds=(start - reach, start + reach),
    )
    return np.asarray(solved.x)


def _trials(model: ImageModel, unknowns: Sequence[Unknown]) -> list[tuple[float, Array]]:
    """Return starts with their losses: all extinctions times a factor, with some g, and the factor that fits best.

    The extinctions are those to begin with and, where these differ from one another, their mean: channels whose starts
    lie decades apart lead to no common end.
    """
    given = np.array([unknown.scale.inward(unknown.start) for unknown in unknowns])
    sigmas = [n for n, unknown in enumerate(unknowns) if unknown.kind == "sigma_t"]
    gs = [n for n, unknown in enumerate(unknowns) if unknown.kind == "phase.g"]
    factors = [n for n, unknown in enumerate(unknowns) if unknown.kind in _FACTORS]
    # Of several that multiply the same, such as albedo and exposure, only the first kind takes the factor.
    chosen = [n for n in factors if unknowns[n].kind == unknowns[factors[0]].kind]
    trials = []
    grey = given.copy()
    grey[sigmas] = given[sigmas].mean() if sigmas else 0.0
    bases = (given,) if np.array_equal(grey, given) else (given, grey)
    for base, times, g in product(bases, _SIGMA_STARTS if sigmas else (1.0,), (None, *_G_STARTS) if gs else (None,)):
        trial = base.copy()
        trial[sigmas] += math.log(times)
        trial[gs] = given[gs] if g is None else math.atanh(g)
        radiance = model.values(unknowns, trial)
        if factors:
            trial[chosen] += math.log(_usual_ratio(model.image, radiance))
            radiance = model.values(unknowns, trial)
        trials.append((_loss(model, radiance), trial))
    return trials


def _loss(model: ImageModel, radiance: Array) -> float:
    return float(np.mean(np.log1p(((model.image - radiance) / _relative(model.image) / _USUAL) ** 2)))


def weighted_fit(model: ImageModel, unknowns: Sequence[Unknown], start: Array) -> Solution:
    """Return the solution of least squares with the weights that the noise asks for, and without outliers."""
    inner, kept = start, np.ones(len(model.pixels), dtype=bool)
    for _ in range(_ROUNDS):
        radiance = model.values(unknowns, inner)
        residual = model.image - radiance
        sigma = noise_of(radiance.ravel(), residual.ravel()).reshape(radiance.shape)
        before, kept = kept, ~outliers(residual, sigma)
        weights = 1 / sigma
        if kept.mean() < _LEAST_KEPT:
            # Nothing explains most of the image: what is left is no noise. All pixels count, relative to themselves.
            weights, kept = 1 / _relative(model.image), np.ones_like(kept)
            break
        solved = least_squares(
            weighted_residual(model, unknowns, weights, kept),
            inner,
            weighted_slopes(model, unknowns, weights, kept),
            method="lm" if 3 * int(kept.sum()) >= len(inner) else "trf",
            x_scale="jac",
            max_nfev=40,
        )
        moved = float(np.max(np.abs(solved.x - inner), initial=0.0))
        inner = solved.x
        if moved < 1e-9 and np.array_equal(before, kept):
            break
    radiance = model.values(unknowns, inner)
    residual = model.image - radiance
    covariance, stretch = _sandwich(model.derivatives(unknowns, inner), residual, weights, kept)
    return Solution(inner, covariance, residual, radiance, kept, weights, stretch)


def weighted_derivatives(model: ImageModel, unknowns: Sequence[Unknown], inner: Array) -> Array:
    """Return derivatives over what counts as a relative error of 1, (values, parameters)."""
    scale = _relative(model.image)
    return (model.derivatives(unknowns, inner) / scale[:, :, None]).reshape(-1, len(inner))


def weighted_residual(
    model: ImageModel, unknowns: Sequence[Unknown], weights: Array, kept: Bools
) -> Callable[[Array], Array]:
    """Return the function whose squares are summed, of the parameters, (values,)."""
    return lambda inner: ((model.image - model.values(unknowns, inner)) * weights)[kept].ravel()


def weighted_slopes(
    model: ImageModel, unknowns: Sequence[Unknown], weights: Array, kept: Bools
) -> Callable[[Array], Array]:
    """Return the derivatives of `weighted_residual`, (values, parameters)."""
    return lambda inner: -(model.derivatives(unknowns, inner) * weights[:, :, None])[kept].reshape(-1, len(inner))


def _sandwich(derivatives: Array, residual: Array, weights: Array, kept: Bools) -> tuple[Array, Array]:
    """Return the covariance, and its variances over those of independent values of these weights."""
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


def _relative(image: Array) -> Array:
    size = np.abs(image)
    return np.maximum(size, _DIM * max(float(size.mean()), 1e-300))


def _usual_ratio(image: Array, radiance: Array) -> float:
    lit = (radiance > _DIM * radiance.mean()) & (image > 0)
    return float(np.median(image[lit] / radiance[lit])) if lit.any() else 1.0
