# SPDX-License-Identifier: BSD-3-Clause
r"""The polynomial in bounded media, section 4.2 of Biri 2006.

In a bounded medium the paper puts a constant R for the distance r from the light in the exponent,
and x - x_n for x, with x_n where the ray enters. `realtime.methods.published.biri2006.media` says
what is printed and what follows; with a = sigma_t h, b = sigma_t R and the angle theta at the
light,

    J = exp(-sigma_t (foot + R - x_n))/h int f(theta) dtheta,

    derived:   f = exp(-a tan theta) p(-sin theta),
    printed:   f = exp(-b (1 + sin theta)/cos theta) p(-sin theta).

"What only involves a change of coefficients c", says the paper: the polynomial is as before, and

* derived, e = exp(-a tan theta) solves e' = -a T' e with T = tan theta, T' = 1 + T^2. So (n + 1)
  T_{n+1} = delta_{n0} + sum_k T_k T_{n-k}, T_0 = 0, and n e_n = -a sum_{k=1..n} k T_k e_{n-k},
  e_0 = 1: the series 1, -a, a^2/2, -a^3/6 - a/3, a^4/24 + a^2/3, ...
* printed, the coefficients of the medium without bounds, c_n(sigma_t, h), become c_n(sigma_t, R).
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr

from airlight.errors import InputError
from airlight.realtime.kernels.registry import Kernel
from airlight.realtime.kernels.taylor import (
    check_degree,
    coefficients_of,
    integral_of,
    phase_series,
    taylor,
    taylor_printed,
)
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.phase import Phase, series_product


@dataclass(frozen=True)
class ConstantLeg:
    """The exponent of a ray in one bounded medium, one channel of it."""

    sigma_t: Any  #: [1/m]
    depth: Any  #: optical depth before the medium, and sigma_t (R - x_n) [1]
    distance: Any  #: R [m]
    printed: bool  #: whether the exponent is the printed one


def polynomial_of(kernel: Kernel | None) -> Callable[..., Any] | None:
    """Return the polynomial of a kernel in a bounded medium, as `bounded_taylor`; None
    where it is no polynomial.
    """
    if kernel is None or kernel.function not in (taylor, taylor_printed):
        return None
    degree = kernel.parameters["degree"]
    return partial(bounded_taylor, degree=degree, printed=kernel.function is taylor_printed)


def bounded_taylor(
    geometry: RayGeometry,
    x0,
    x1,
    light: Light,
    phase: Phase,
    segment: ConstantLeg,
    *,
    degree: int = 4,
    printed: bool = False,
):
    """Return the airlight integral of a bounded medium by the polynomial [1/m].

    `printed`: whether to take the coefficients of the annex; `x0` and `x1` bound a
    segment of any length [m].

    Valid near theta = 0, as `taylor`, and as far as a constant stands for the light's way in the
    medium. The paper prints no coefficients for the derived exponent.
    """
    # As printed, the coefficients of the medium without bounds with R for h; derived, the series of
    # exp(-a tan theta) times the phase function's.
    if segment.printed:
        coefficients = coefficients_of(
            segment.sigma_t * segment.distance, phase, degree, printed=printed
        )
    elif printed:
        raise InputError(
            "kernel taylor-printed: the paper prints no coefficients for the exponent that section "
            "4.2 must mean; use media=printed, or the kernel 'taylor'"
        )
    else:
        check_degree(degree)
        series = tangent_series(segment.sigma_t * geometry.height, degree)
        coefficients = series_product(series, phase_series(phase, degree, "taylor"), degree)
    # exp(-sigma_t (foot + R - x_n)), with the depth before the medium.
    depth = dr.fma(segment.sigma_t, geometry.foot, segment.depth)
    if segment.printed:
        # e^-b, which the coefficients leave out
        depth = dr.fma(segment.sigma_t, segment.distance, depth)
    return integral_of(geometry, x0, x1, light, coefficients) * dr.exp(-depth) / geometry.height


def tangent_series(a: Any, degree: int) -> list[Any]:
    """Return the coefficients of exp(-a tan theta) in powers of theta, up to a degree."""
    # T' = 1 + T^2.
    tangent = [0.0]
    for n in range(degree):
        tangent.append(
            (float(n == 0) + sum(tangent[k] * tangent[n - k] for k in range(n + 1))) / (n + 1)
        )
    # e = exp(-a T): e' = -a T' e.
    series = [type(a)(1)]
    for n in range(1, degree + 1):
        series.append((-a / n) * sum((k * tangent[k]) * series[n - k] for k in range(1, n + 1)))
    return series
