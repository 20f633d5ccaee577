# SPDX-License-Identifier: BSD-3-Clause
"""The polynomial of which the kernel `polynomial` is the integral over a whole segment, for parts of the segment too.

The kernel is Fejer's rule. That this is the integral of the Chebyshev polynomial through the same values is what the
tests hold against this module. From n = degree + 1 values of f at y_j = cos(pi (2j + 1)/(2n)), y = 2u/U - 1, follow the
Chebyshev coefficients of f and of its antiderivative A,

    c_k = (2/n) sum_j f_j T_k(y_j)  (half that for k = 0),     A_k = (c_{k-1} - c_{k+1})/(2k)  (c_0 doubled),

and a part of the range is A(y1) - A(y0), without cancellation by the divided differences

    d_k = (T_k(y1) - T_k(y0))/(y1 - y0):     d_0 = 0,  d_1 = 1,  d_{k+1} = 2 y1 d_k + 2 T_k(y0) - d_{k-1}.
"""

import math
from dataclasses import dataclass
from typing import Any

import drjit as dr

from realtime.kernels.polynomial import _nodes
from realtime.kernels.polynomial_piece import Piece, integrand, offset, piece_of, place, with_limits
from realtime.rays.ray_light import RayGeometry, smooth_subsegments
from realtime.scene.lights import Light
from realtime.scene.medium import Medium


@dataclass(frozen=True)
class RayPolynomial:
    """Polynomials of one stretch of every ray: for each extinction one or, for a soft spot, three pieces."""

    pieces: tuple[tuple[tuple[Piece, tuple[Any, ...]], ...], ...]  #: each with A_1, A_2, ... over U/2
    color: Any  #: the type of a colour


def polynomial_coefficients(
    geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, degree: int = 15
) -> RayPolynomial:
    """Fit the polynomials of which `evaluate` and `evaluate_segment` integrate any part.

    Parameters and errors are those of `polynomial`; [x0, x1] must hold all the distances asked for later.

    Notes
    -----
    Valid as `polynomial`. On a ray through the light (height 0) whose range holds the light, parts that hold it give
    +inf, others NaN. The extinction must be the one of the fit: each has a range and coefficients of its own.
    """
    nodes = _nodes(degree)

    def fitted(begin, end, sigma_t):
        piece = piece_of(geometry, begin, end, sigma_t, medium.phase)
        values = [integrand(piece, (0.5 + 0.5 * y) * piece.width, geometry, medium, light) for y, _ in nodes]
        return piece, _antiderivative(values)

    ends = smooth_subsegments(geometry, light, x0, x1)
    pieces = tuple(tuple(fitted(begin, end, sigma_t) for begin, end in ends) for sigma_t in medium.sigma_t)
    return RayPolynomial(pieces, type(medium.albedo))


def evaluate(fit: RayPolynomial, x):
    """Return Gamma(x), J from the near end of the fit to `x` [1/m]; with x0 = 0 that is J from the camera.

    Parameters
    ----------
    fit
        From `polynomial_coefficients`.
    x
        Distances within the range of the fit [m]; may be infinite if the range is.

    Notes
    -----
    Valid in the range of the fit, outside of which Gamma stays at its ends' values. The error is that of a difference
    of two numbers of the size of Gamma where two values are subtracted: `evaluate_segment` has no such loss.
    """
    return _per_extinction(fit, lambda pieces: sum(_part(*fitted, None, x) for fitted in pieces))


def evaluate_segment(fit: RayPolynomial, x_begin, x_end):
    """Return J between two distances within the range of the fit [1/m], without the cancellation of Gamma - Gamma."""
    return _per_extinction(fit, lambda pieces: sum(_part(*fitted, x_begin, x_end) for fitted in pieces))


def _per_extinction(fit: RayPolynomial, function):
    values = [function(pieces) for pieces in fit.pieces]
    return values[0] if len(values) == 1 else fit.color(*values)


def _part(piece: Piece, coefficients: tuple[Any, ...], x_begin, x_end):
    """Integrate a piece's polynomial from x_begin, or from its near end if None, to x_end."""
    end = dr.clip(x_end, piece.x0, piece.x1)
    u1 = dr.minimum(offset(piece, piece.near, end), piece.width)
    begin, u0, length = piece.x0, 0.0, u1
    if x_begin is not None:
        begin = dr.clip(x_begin, piece.x0, piece.x1)
        u0 = dr.minimum(offset(piece, piece.near, begin), piece.width)
        length = offset(piece, place(piece, begin), end)
    per_width = dr.select(piece.width > 0, 2 / piece.width, 0)
    y0, y1 = dr.fma(u0, per_width, -1), dr.fma(u1, per_width, -1)
    chebyshev, before = y0, 1.0  # T_k(y0), T_{k-1}(y0)
    divided, divided_before = 1.0, 0.0  # d_k, d_{k-1}
    total = coefficients[0]
    for coefficient in coefficients[1:]:
        divided, divided_before = dr.fma(2 * y1, divided, 2 * chebyshev - divided_before), divided
        chebyshev, before = dr.fma(2 * y0, chebyshev, -before), chebyshev
        total = dr.fma(coefficient, divided, total)
    return with_limits(piece, begin, end, piece.factor * length * total)


def _antiderivative(values: list) -> tuple:
    """Return A_1, A_2, ... of the polynomial through values at the Chebyshev points."""
    n = len(values)
    half = n // 2
    # T_k is even or odd, so values at +-y enter by their sum or their difference.
    sums = [values[j] + values[n - 1 - j] for j in range(half)] + ([values[half]] if n % 2 else [])
    differences = [values[j] - values[n - 1 - j] for j in range(half)]
    c: list = []
    for k in range(n):
        folded = differences if k % 2 else sums
        c.append(sum((2 / n * math.cos(k * math.pi * (2 * j + 1) / (2 * n))) * v for j, v in enumerate(folded)))
    c += [0.0, 0.0]
    return tuple((c[k - 1] - c[k + 1]) / (2 * k) for k in range(1, n + 1))
