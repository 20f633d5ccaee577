# SPDX-License-Identifier: BSD-3-Clause
"""The ends of 95 % intervals: where the best fit with a parameter held there is as much worse as noise makes it.

An ellipse of the covariance is right where the image is linear in the parameters, over all of the interval. With 20 %
of noise an extinction may be known to a factor of two, and the intervals of that ellipse held the truth in 83 to 89 %
of cases. The profile of the sum of squares Q depends on no choice of parameters: with Q_k(t) the least one with
parameter k held at t, and at its least Q,

    (Q_k(t) - Q) / a_k

has the distribution of chi squared with one degree of freedom, where a_k is the variance of the sandwich over that of
independent values of these weights (Venzon and Moolgavkar 1988, Appl. Statist. 37, 87; with the factor: Rotnitzky and
Jewell 1990, Biometrika 77, 485). Where the image is linear, these are the ends of the ellipse.
"""

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from validation.fit.image_model import ImageModel
from validation.fit.least_squares import Solution, weighted_residual, weighted_slopes
from validation.fit.unknowns import Unknown

Array = NDArray[np.float64]

SIGMAS = 1.959964  #: standard errors in half of a 95 % interval
_LINEAR = 1e-3  # of a number on the whole line: in so short a step the image is linear in it
_CLOSE = 0.02  # of half an interval
_TURNS = 10  # where so many do not reach an end, there is none
_GROWTH = 3.0  # of a step, at most
_FARTHEST = 30.0  # a factor of 10^13: where an image allows it, there is no end


def interval_ends(model: ImageModel, unknowns: Sequence[Unknown], solution: Solution) -> Array:
    """Return the ends of the 95 % intervals as numbers on the whole line, infinite where the image sets none.

    Returns
    -------
    numpy.ndarray
        Low and high, (parameters, 2).
    """
    reach = SIGMAS * np.sqrt(np.maximum(np.diag(solution.covariance), 0.0))
    return np.array(
        [
            [_end(model, unknowns, solution, number, sign * float(step)) for sign in (-1, 1)]
            for number, step in enumerate(reach)
        ]
    ).reshape(-1, 2)


def _end(model: ImageModel, unknowns: Sequence[Unknown], solution: Solution, number: int, step: float) -> float:
    """Return one end; `step` leads to that of the ellipse."""
    best = float(solution.inner[number])
    if not _LINEAR < abs(step) < math.inf:
        return best + step
    way = solution.covariance[:, number] / solution.covariance[number, number]  # how the others go with it
    below, above = (0.0, -SIGMAS), (math.nan, math.nan)  # distances, and standard errors beyond the end there
    distance = step
    for _ in range(_TURNS):
        place, errors = _profile(model, unknowns, solution, number, solution.inner + distance * way)
        way, beyond = (place - solution.inner) / distance, errors - SIGMAS
        if abs(beyond) < _CLOSE * SIGMAS or abs(above[0] - below[0]) < _CLOSE * abs(above[0]):
            return best + distance
        # The root of a profile is nearly a line. An end that stays counts half each time (the Illinois algorithm).
        if beyond > 0:
            below, above = (below[0], below[1] if math.isnan(above[0]) else 0.5 * below[1]), (distance, beyond)
        else:
            below, above = (distance, beyond), (above[0], 0.5 * above[1])
        if math.isnan(above[0]):
            if abs(distance) > _FARTHEST:
                break
            distance *= min(1.1 * SIGMAS / max(errors, 1e-9), _GROWTH)
        else:
            distance = below[0] - below[1] * (above[0] - below[0]) / (above[1] - below[1])
    return best + distance if math.isfinite(above[0]) else math.copysign(math.inf, step)


def _profile(
    model: ImageModel, unknowns: Sequence[Unknown], solution: Solution, number: int, place: Array
) -> tuple[Array, float]:
    """Return the best place with one parameter held, and how many standard errors it is away from the best of all."""
    free = np.arange(len(place)) != number

    def whole(others: Array) -> Array:
        inner = place.copy()
        inner[free] = others
        return inner

    residual = weighted_residual(model, unknowns, solution.weights, solution.kept)
    slopes = weighted_slopes(model, unknowns, solution.weights, solution.kept)
    best = place
    if free.any():
        solved = least_squares(
            lambda others: residual(whole(others)),
            place[free],
            lambda others: slopes(whole(others))[:, free],
            method="lm",
            x_scale="jac",
            ftol=1e-5,  # of Q, some thousand: standard errors are told to 1 %
            max_nfev=20,
        )
        best = whole(solved.x)
    worse = float(np.sum(residual(best) ** 2)) - float(
        np.sum((solution.residual * solution.weights)[solution.kept] ** 2)
    )
    return best, math.sqrt(max(worse, 0.0) / float(solution.stretch[number]))
