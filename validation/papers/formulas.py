# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as printed against their correct forms, and the droplets of Bouthors
2008: no image is needed.

`realtime.kernels.taylor` holds the annex of Biri 2006 as transcribed, `analytic.series` derives it,
and `analytic.droplets` is Mie's theory. Integrands are written here as the papers print them and
integrated by QUADPACK.

The effect of the misprints of the annex, ray by ray: both polynomials of degree 4 run on the set of
rays `validation.kernels.rays.wide_rays` in float64, so that rounding plays no part. The paper does
not claim its polynomial everywhere, so the fractions are those of moderate rays, which scenes are
made of: optical depth 0.01 to 5 at the distance of the light, angle to the light 1 to 179 degrees,
length 0.05 to 10 distances.
"""

import numpy as np
from scipy.integrate import quad

from airlight.analytic.droplets import Modified, optics
from airlight.analytic.phase import Hazy, phase_from_words
from airlight.analytic.series import taylor_coefficients
from airlight.realtime.kernels.taylor import (
    PRINTED_PHASES,
    printed_coefficients,
    taylor,
    taylor_printed,
)
from airlight.validation.arrays import Array, Bools
from airlight.validation.kernels.case_files import Cases
from airlight.validation.kernels.cases import evaluate_cases, relative_error
from airlight.validation.kernels.rays import wide_rays

_RAYS, _WIDE_RAYS = 48, 1 << 13
_HAZY = Hazy()


def formulas() -> dict[str, float]:
    """Return printed formulas over their correct values, and facts on
    light in the paper's cloud.
    """
    return (
        {"biri angle": _angular_form()}
        | _annex()
        | _within_ten_percent()
        | _cloud_equations()
        | _droplets()
    )


def _worst(ratios: Array) -> float:
    """Return the ratio that is farthest from 1."""
    return float(ratios[np.argmax(np.abs(ratios - 1))])


def _compared(printed: Array, derived: Array) -> float:
    """Return 1 and what printed values are off by where that is most, over
    the largest derived one.
    """
    return _worst(1 + (printed - derived) / np.max(np.abs(derived)))


def _angular_form() -> float:
    """Return the integral over the angle of Biri 2006, 4.1, over that of eq. 1,
    the worst of random rays.
    """
    random = np.random.default_rng(20060130)
    # No ray passes the light closer than 0.2: QUADPACK would need to be told of the peak.
    foot, height = random.uniform(-2, 4, _RAYS), random.uniform(0.2, 2, _RAYS)
    length, sigma = random.uniform(1, 6, _RAYS), random.uniform(0.05, 0.8, _RAYS)
    rays = list(zip(foot, height, length, sigma))
    return _worst(np.array([_over_angle(*ray) / _over_distance(*ray) for ray in rays]))


def _over_distance(foot: float, height: float, length: float, sigma: float) -> float:
    """Return J by the integrand of eq. 1."""

    def integrand(x: float) -> float:
        r = np.hypot(height, x - foot)
        return np.exp(-sigma * x) * np.exp(-sigma * r) / r**2 * float(_HAZY((foot - x) / r))

    inner = [foot] if 0 < foot < length else None
    return quad(integrand, 0, length, epsabs=0, epsrel=1e-12, points=inner, limit=400)[0]


def _over_angle(foot: float, height: float, length: float, sigma: float) -> float:
    """Return J by the form over the angle, as printed: the phase function is p(theta + pi/2)."""

    def integrand(theta: float) -> float:
        path = (np.sin(theta) + 1) / np.cos(theta)
        return np.exp(-sigma * height * path) * float(_HAZY(np.cos(theta + np.pi / 2)))

    # theta is the angle of the ray's point at the light: tan(theta) = (x - foot)/height.
    ends = np.arctan((0 - foot) / height), np.arctan((length - foot) / height)
    return (
        np.exp(-sigma * foot)
        / height
        * quad(integrand, *ends, epsabs=0, epsrel=1e-12, limit=400)[0]
    )


def _annex() -> dict[str, float]:
    """Return how each printed coefficient compares with the derived one, and the means of the
    lobes that the annex expands.
    """
    a = np.linspace(0.13, 2.97, 30)  # sigma_t h
    ratios = {}
    for name in PRINTED_PHASES:
        derived = taylor_coefficients(a, phase_from_words(name), 4).T
        for number, (printed, true) in enumerate(zip(printed_coefficients(a, name), derived)):
            ratios[f"{name} c{number}"] = _compared(printed, true)
    for name, factor, power in (("hazy", 9, 8), ("murky", 50, 32)):
        ratios[f"{name} mean"] = (
            quad(lambda c, f=factor, n=power: 1 + f * ((1 + c) / 2) ** n, -1, 1)[0] / 2
        )
    return ratios


def _within_ten_percent() -> dict[str, float]:
    """Return the fraction of moderate rays on which the isotropic polynomials are within 10 %."""
    cases, fractions = wide_rays(_WIDE_RAYS), {}
    for name, kernel in (("printed", taylor_printed), ("derived", taylor)):
        # In double precision: rounding adds nothing to the polynomial's error.
        error = relative_error(
            evaluate_cases(cases, kernel, "double"), np.asarray(cases.value), "double"
        )
        fractions[f"within 10 %, {name}"] = float(np.mean(error[_moderate(cases)] <= 0.1))
    return fractions


def _cloud_equations() -> dict[str, float]:
    """Return eq. 1 and 2 of Bouthors 2008 over what they stand for, and what eq. 5
    leaves of an isotropic field.
    """
    kappa, x0, x1, l0, l1 = 0.05, 3.0, 19.0, 11.0, 4.0
    # The way from the point to the light changes linearly along the ray, from l0 to l1; all numbers
    # are arbitrary.
    depth = quad(
        lambda x: kappa * np.exp(-kappa * (x + l0 + (l1 - l0) * (x - x0) / (x1 - x0))), x0, x1
    )[0]
    opacity = quad(lambda x: np.exp(-kappa * x), x0, x1)[0]
    # A constant field does not change along a path, so the right side of eq. 5, lost
    # light and gained, must be 0.
    gained = quad(lambda cos: 1.0, -1, 1)[0] / 2
    return {
        "eq. 1": float((np.exp(-kappa * (x1 + l1)) - np.exp(-kappa * (x0 + l0))) / depth),
        "eq. 2": float((np.exp(-kappa * x1) - np.exp(-kappa * x0)) / kappa / opacity),
        "eq. 5": float(1.0 + gained),
    }


def _droplets() -> dict[str, float]:
    """Return results of Mie's theory for the paper's droplets at 0.55 um: fractions [%],
    mean free path [m], g [1].
    """
    green = optics()
    return {
        "g": green.g,
        "forward": 100 * green.fraction(0, 90),
        "peak": 100 * green.fraction(0, 5),
        "lobe": 100 * green.fraction(5, 90),
        "cut": 100 * float(Modified(green).removed),
        "path": green.mean_free_path,
        "eq. 4": green.printed_extinction / green.extinction,
    }


def _moderate(cases: Cases) -> Bools:
    # and optical depth: the extinction of the set is 1
    distance = np.hypot(cases.foot, cases.height)
    length = cases.x1 / distance
    # As an angle to the light of 1 to 179 degrees: the height is at least the sine of 1 degree
    # times the distance.
    fine = (distance >= 0.01) & (distance <= 5) & (length >= 0.05) & (length <= 10)
    return fine & (cases.height >= distance * np.sin(np.radians(1)))
