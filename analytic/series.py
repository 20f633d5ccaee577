# SPDX-License-Identifier: BSD-3-Clause
"""The power series of the airlight integrand in the angle theta, of any degree.

Biri 2006 (annex) replaces the integrand of the angle form, exp(-a tan(theta/2 + pi/4)) p(-sin
theta), a = sigma_t h, by a polynomial of degree 4 about the foot point, theta = 0. Its coefficients
follow by recurrence, each series from the one before by its differential equation:

    T = tan(theta/2 + pi/4)     T' = (1 + T^2)/2,   T_0 = 1:     (k+1) T_{k+1} = (delta_{k0} + sum_i T_i T_{k-i})/2
    F = exp(-a (T - 1))         F' = -a T' F,       F_0 = 1:     (k+1) F_{k+1} = -a sum_i (i+1) T_{i+1} F_{k-i}

The phase function knows its series (`analytic.phase.PhaseFunction.series`). Functions return the
coefficients of the product F p, without the common factor exp(-a) of exp(-a T), as in the table of
DESIGN section 3.
"""

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.phase import PhaseFunction
from airlight.errors import InputError

Array = NDArray[np.float64]


def taylor_coefficients(a: ArrayLike, phase: PhaseFunction, degree: int = 4) -> Array:
    """Return the coefficients of exp(a - a tan(theta/2 + pi/4)) p(-sin theta) in powers of theta.

    `a`: optical thickness sigma_t h between the light and the foot point [1], >= 0, of any shape;
    `phase`: any phase function but 'tabulated', whose slope jumps; `degree`: highest power, >= 0; 4
    in Biri 2006, annex. Returns coefficients of theta^0 to theta^degree [1], of shape a.shape +
    (degree + 1,), **without** the factor exp(-a). Raises InputError for a tabulated phase function,
    a negative degree, or an `a` that is negative or not finite.

    Valid for every a; the series itself converges for |theta| < pi/2 (Henyey-Greenstein: nearer,
    where 1 + g^2 + 2 g sin theta has its zeros), and a few terms are only useful where a theta is
    small.
    """
    thickness = np.asarray(a, dtype=np.float64)
    if degree < 0:
        raise InputError(f"degree is {degree}; expected a number >= 0")
    if not np.all(np.isfinite(thickness) & (thickness >= 0)):
        raise InputError(
            "a holds a number that is negative or not finite; expected optical thicknesses >= 0"
        )
    # F_0 to F_degree; each has the shape of `a`.
    exponential = _exponential_series(thickness, degree)
    # p_0 to p_degree, which the phase function knows; a table has no series.
    lobe = phase.series(degree)
    if lobe is None:
        raise InputError(
            f"the phase function is '{phase.name}', which has no power series; use a smooth one or "
            "a quadrature"
        )
    # The product of both series: (F p)_k = sum_i F_i p_{k-i}.
    columns = [sum(exponential[i] * lobe[k - i] for i in range(k + 1)) for k in range(degree + 1)]
    return np.stack([np.broadcast_to(c, thickness.shape) for c in columns], axis=-1)


def _tangent_series(degree: int) -> list[float]:
    """Return T_0 to T_degree of tan(theta/2 + pi/4)."""
    # (k+1) T_{k+1} = (delta_{k0} + (T^2)_k)/2, where T^2 needs no coefficient beyond T_k.
    t = [1.0]
    for k in range(degree):
        square = math.fsum(t[i] * t[k - i] for i in range(k + 1))
        t.append(((k == 0) + square) / (2 * (k + 1)))
    return t


def _exponential_series(a: Array, degree: int) -> list[Array]:
    """Return F_0 to F_degree of exp(-a (T - 1))."""
    t = _tangent_series(degree)
    f = [np.ones_like(a)]
    for k in range(degree):
        # (T' F)_k, as T' has the coefficients (i+1) T_{i+1}.
        total = sum(((i + 1) * t[i + 1]) * f[k - i] for i in range(k + 1))
        f.append(-a * total / (k + 1))
    return f
