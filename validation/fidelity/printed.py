# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as they are printed against what they must be: coefficients, phase functions, the equations of clouds.

The difference of a coefficient is the largest over optical thicknesses a = sigma_t h from 0.1 to 3, over the largest
derived value there. `realtime.kernels.taylor_printed` holds the annex of Biri 2006 as transcribed, `analytic.series`
the derivation.
"""

from typing import Any

import numpy as np
from scipy.integrate import quad

from analytic.phase import PhaseFunction
from analytic.series import taylor_coefficients
from realtime.kernels.taylor_printed import PRINTED_PHASES, printed_coefficients

#: Phase functions of Biri 2006 as printed, not divided by their means: a factor and a power.
PRINTED_LOBES = {"hazy": (9, 8), "murky": (50, 32)}


def printed() -> dict[str, Any]:
    """Return what the printed formulas are wrong by.

    Returns
    -------
    dict
        `coefficients` by phase function, a relative difference for each printed one; `means` of the printed phase
        functions over the sphere; `clouds`, the printed equations of Bouthors 2008 over the derived ones.
    """
    a = np.linspace(0.1, 3.0, 30)
    coefficients = {}
    for name in PRINTED_PHASES:
        derived = taylor_coefficients(a, PhaseFunction(name), 4).T
        coefficients[name] = [
            float(np.max(np.abs(values - true)) / np.max(np.abs(true)))
            for values, true in zip(printed_coefficients(a, name), derived)
        ]
    return {
        "coefficients": coefficients,
        "means": {name: _mean(*lobe) for name, lobe in PRINTED_LOBES.items()},
        "clouds": clouds(),
    }


def _mean(factor: float, power: int) -> float:
    """Return the mean of 1 + factor ((1 + cos)/2)^power over the sphere."""
    return quad(lambda cos: 1 + factor * ((1 + cos) / 2) ** power, -1, 1)[0] / 2


def clouds() -> dict[str, float]:
    """Return the printed equations of Bouthors 2008 over what they stand for, with numbers of their own magnitude.

    Returns
    -------
    dict
        `scattering` (eq. 1, for l linear on the segment), `opacity` (eq. 2), `radius` (eq. 4: the square of the
        effective radius over the mean square radius of a modified gamma distribution, gamma = 2), `conservation` (eq.
        5: the change of an isotropic field in a medium of albedo 1, in units of the field, which must be 0).
    """
    kappa, x0, x1, l0, l1 = 0.05, 3.0, 19.0, 11.0, 4.0
    depth = quad(lambda x: kappa * np.exp(-kappa * (x + l0 + (l1 - l0) * (x - x0) / (x1 - x0))), x0, x1)[0]
    opacity = quad(lambda x: np.exp(-kappa * x), x0, x1)[0]
    gamma = 2.0
    # The density of the radius is proportional to r^(gamma - 1) exp(-r / r_n): moments are gamma functions.
    mean_square = quad(lambda r: r ** (gamma + 1) * np.exp(-r), 0, np.inf)[0]
    mean_square /= quad(lambda r: r ** (gamma - 1) * np.exp(-r), 0, np.inf)[0]
    field = 1.0
    in_scattered = quad(lambda cos: field, -1, 1)[0] / 2
    return {
        "scattering": float((np.exp(-kappa * (x1 + l1)) - np.exp(-kappa * (x0 + l0))) / depth),
        "opacity": float((np.exp(-kappa * x1) - np.exp(-kappa * x0)) / kappa / opacity),
        "radius": float((gamma + 2) ** 2 / mean_square),
        "conservation": float((field + in_scattered) / field),
    }
