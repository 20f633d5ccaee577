# SPDX-License-Identifier: BSD-3-Clause
r"""Kernels that know bounded media: the polynomial of Biri 2006, section 4.2.

In a bounded medium the paper puts a constant R for the distance r from the light in the exponent, and x - x_n for x,
with x_n where the ray enters. `realtime.scene.media.bounded_rays` says what is printed and what follows; with a =
sigma_t h, b = sigma_t R and the angle theta at the light,

    J = exp(-sigma_t (foot + R - x_n))/h int f(theta) dtheta,

    derived:   f = exp(-a tan theta) p(-sin theta),
    printed:   f = exp(-b (1 + sin theta)/cos theta) p(-sin theta).

"What only involves a change of coefficients c", says the paper: the polynomial is as before, and

* derived, e = exp(-a tan theta) solves e' = -a T' e with T = tan theta, T' = 1 + T^2. So (n + 1) T_{n+1} = delta_{n0} +
  sum_k T_k T_{n-k}, T_0 = 0, and n e_n = -a sum_{k=1..n} k T_k e_{n-k}, e_0 = 1: the series 1, -a, a^2/2, -a^3/6 - a/3,
  a^4/24 + a^2/3, ...
* printed, the coefficients of the medium without bounds, c_n(sigma_t, h), become c_n(sigma_t, R).

A kernel that has this form answers with it as `Kernel.bounded`. Other kernels leave bounded media to nodes, with the
true depth of both segments.
"""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class ConstantLeg:
    """The exponent of a ray in one bounded medium, one channel of it."""

    sigma_t: Any  #: [1/m]
    depth: Any  #: optical depth before the medium, and sigma_t (R - x_n) [1]
    distance: Any  #: R [m]
    printed: bool  #: whether the exponent is the printed one


def tangent_series(a: Any, degree: int) -> list[Any]:
    """Return the coefficients of exp(-a tan theta) in powers of theta, up to a degree."""
    tangent = [0.0]
    for n in range(degree):
        tangent.append((float(n == 0) + sum(tangent[k] * tangent[n - k] for k in range(n + 1))) / (n + 1))
    series = [type(a)(1)]
    for n in range(1, degree + 1):
        series.append((-a / n) * sum((k * tangent[k]) * series[n - k] for k in range(1, n + 1)))
    return series
