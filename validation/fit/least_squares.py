# SPDX-License-Identifier: BSD-3-Clause
"""Levenberg and Marquardt's method on the pixels of an image, robust to those that disagree, with intervals.

1. Starts are tried over four decades of extinction and the whole range of g, each with the factor on the image that fits
   best, by a loss that no single pixel decides (Cauchy's).
2. From the best start the same loss is minimised over relative errors.
3. What is left says how noisy the image is (`validation.fit.noise`): least squares with the weights 1/sigma^2, without
   outliers, until neither changes.

The intervals come from the sandwich

    C = B^-1 M B^-1,    B = sum w J J^T,    M = sum_pixels s s^T,    s = sum_channels w J e,

which is right for noise that differs from pixel to pixel and is shared by the channels of one; pixels must be
independent (White 1980, Econometrica 48, 817; its form for clusters by Liang and Zeger 1986, Biometrika 73, 13).
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
_SIGMA_STARTS = (1.0, 0.03, 0.1, 0.3, 3.0, 10.0, 30.0)
_G_STARTS = (0.0, -0.6, 0.5, 0.85)
_DIM = 0.01  # of the mean of the image: below it a value need not be right relative to itself
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


def best_start(model: ImageModel, unknowns: Sequence[Unknown]) -> Array:
    """Return the best of some starts."""
    given = np.array([unknown.scale.inward(unknown.start) for unknown in unknowns])
    scale = _relative(model.image)
    sigmas = [n for n, unknown in enumerate(unknowns) if unknown.kind == "sigma_t"]
    gs = [n for n, unknown in enumerate(unknowns) if unknown.kind == "phase.g"]
    factors = [n for n, unknown in enumerate(unknowns) if unknown.kind in _FACTORS]
    best, least = given, math.inf
    for times, g in product(_SIGMA_STARTS if sigmas else (1.0,), (None, *_G_STARTS) if gs else (None,)):
        trial = given.copy()
        trial[sigmas] += math.log(times)
        if g is not None:
            trial[gs] = math.atanh(g)
        radiance = model.values(unknowns, trial)
        if factors:
            ratio = _usual_ratio(model.image, radiance)
            # Factors multiply: one step of each, but only one of those that multiply the same.
            chosen = [n for n in factors if unknowns[n].kind == unknowns[factors[0]].kind]
            trial[chosen] += math.log(ratio)
            radiance = model.values(unknowns, trial)
        loss = float(np.mean(np.log1p(((model.image - radiance) / scale / 0.1) ** 2)))
        if loss < least:
            best, least = trial, loss
    return best


def robust_fit(model: ImageModel, unknowns: Sequence[Unknown], start: Array) -> Array:
    """Return the parameters with the least Cauchy loss of relative errors."""
    scale = _relative(model.image)
    unit = 0.05

    def residuals(inner: Array) -> Array:
        return ((model.image - model.values(unknowns, inner)) / scale).ravel()

    def slopes(inner: Array) -> Array:
        return -(model.derivatives(unknowns, inner) / scale[:, :, None]).reshape(-1, len(inner))

    for _ in range(2):
        solved = least_squares(residuals, start, slopes, loss="cauchy", f_scale=unit, x_scale="jac", max_nfev=60)
        start = solved.x
        unit = min(unit, max(3 * 1.4826 * float(np.median(np.abs(residuals(start)))), 1e-7))
    return np.asarray(start)


def weighted_fit(model: ImageModel, unknowns: Sequence[Unknown], start: Array) -> Solution:
    """Return the solution of least squares with the weights that the noise asks for, and without outliers."""
    inner, kept = start, np.ones(len(model.pixels), dtype=bool)
    for _ in range(_ROUNDS):
        radiance = model.values(unknowns, inner)
        residual = model.image - radiance
        sigma = noise_of(radiance.ravel(), residual.ravel()).reshape(radiance.shape)
        before, kept = kept, ~outliers(residual, sigma)
        weights = 1 / sigma
        solved = least_squares(
            _weighted(model, unknowns, weights, kept),
            inner,
            _weighted_slopes(model, unknowns, weights, kept),
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
    covariance = _sandwich(model.derivatives(unknowns, inner), residual, weights, kept)
    return Solution(inner, covariance, residual, radiance, kept, weights)


def without(solution: Solution, number: int) -> Solution:
    """Return a solution whose covariance has no entry for a parameter that was held."""
    return replace(solution, covariance=np.delete(np.delete(solution.covariance, number, 0), number, 1))


def weighted_derivatives(model: ImageModel, unknowns: Sequence[Unknown], inner: Array) -> Array:
    """Return derivatives over what counts as a relative error of 1, (values, parameters)."""
    scale = _relative(model.image)
    return (model.derivatives(unknowns, inner) / scale[:, :, None]).reshape(-1, len(inner))


def _weighted(model: ImageModel, unknowns: Sequence[Unknown], weights: Array, kept: Bools) -> Callable[[Array], Array]:
    return lambda inner: ((model.image - model.values(unknowns, inner)) * weights)[kept].ravel()


def _weighted_slopes(
    model: ImageModel, unknowns: Sequence[Unknown], weights: Array, kept: Bools
) -> Callable[[Array], Array]:
    return lambda inner: -(model.derivatives(unknowns, inner) * weights[:, :, None])[kept].reshape(-1, len(inner))


def _sandwich(derivatives: Array, residual: Array, weights: Array, kept: Bools) -> Array:
    slopes, count = (derivatives * weights[:, :, None])[kept], derivatives.shape[2]
    flat = slopes.reshape(-1, count)
    scores = np.einsum("pck,pc->pk", slopes, (residual * weights)[kept])
    size = np.linalg.norm(flat, axis=0)
    size = np.where(size > 0, size, 1.0)
    bread = np.linalg.pinv((flat / size).T @ (flat / size), rcond=1e-14)
    freedom = len(scores) / max(len(scores) - count, 1)
    meat = (scores / size).T @ (scores / size) * freedom
    return np.asarray(bread @ meat @ bread / np.outer(size, size))


def _relative(image: Array) -> Array:
    size = np.abs(image)
    return np.maximum(size, _DIM * max(float(size.mean()), 1e-300))


def _usual_ratio(image: Array, radiance: Array) -> float:
    lit = (radiance > _DIM * radiance.mean()) & (image > 0)
    return float(np.median(image[lit] / radiance[lit])) if lit.any() else 1.0
