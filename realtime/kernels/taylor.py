# SPDX-License-Identifier: BSD-3-Clause
"""The polynomial kernel of Biri, Arques and Michelin 2006 (section 4.1), with
coefficients re-derived.

In the angle form of DESIGN section 2 the integrand is

    f(theta) = exp(-a (1 + sin theta)/cos theta) p(-sin theta),     a = sigma_t h.

Its Taylor series about theta = 0, cut after degree N, is integrated term by term:

    J ~ exp(-sigma_t foot)/h  sum_n c_n (theta1^(n+1) - theta0^(n+1))/(n + 1).

The coefficients follow from three recurrences, for any degree:

* g = (1 + sin)/cos = sec + tan solves 2 g' = 1 + g^2, hence (n + 1) g_{n+1} = (delta_{n0} + sum_k
  g_k g_{n-k})/2, g_0 = 1.
* e = exp(-a (g - 1)) solves e' = -a g' e, hence n e_n = -a sum_{k=1..n} k g_k e_{n-k}, e_0 = 1. The
  factor e^-a is left out.
* c_n = sum_k e_{n-k} p_k, where p_k is the series of p(-sin theta), by `realtime.scene.phase`.

The difference of powers is written (theta1 - theta0) sum_k theta1^k theta0^(n-k), and theta1 -
theta0 as one arc tangent, so that short segments and rays that pass the light do not cancel.

**As printed.** The paper's annex, misprints included, so that the paper's own error can be shown.
The factor e^-a is left out, and an asterisk stands where the printed term is not the derived one
(DESIGN section 3):

    isotropic  1;  -a;  a^2 - a *;  -a^3/6 + a^2/2 - a *;  a^4/24 - a^3/4 + 11 a^2/24 - 5 a/24
    Rayleigh   3/4;  -3a/4;  3a^2/8 + 3/4 *
    hazy       265/256;  -265a/256 + 9/36 *;  265a^2/256 - 121a/512 + 63/64 *
    murky      n/2^31;  +n a/2^31 - 25/367108864 *;  n a^2/2^32 - 2147482073 a/2^32 + 775/134217728

where n = 2147483673. Derived, the six starred terms are (a^2 - a)/2; -a^3/6 + a^2/2 - a/3; 3a^2/8 -
3a/8 + 3/4; -265a/256 - 9/32; 265a^2/512 - 121a/512 + 63/64; -n a/2^31 - 25/67108864. The text at
hand comes from scanned pages: a wrong digit may be the scan's.

Two choices let it be compared with other kernels:

* The printed hazy and murky functions, 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means
  2 and 83/33 over the sphere: all their coefficients are divided by these.
* For all but the isotropic function the annex ends with "..." after c_2. The missing c_3 and c_4
  are the derived ones, so that whatever differs from the derived polynomial of the same degree is
  the print's.
"""

import drjit as dr
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import largest
from airlight.realtime.rays import RayGeometry
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import PHASES, Phase, series_product

PRINTED_PHASES = ("isotropic", "rayleigh", "hazy", "murky")


def taylor(geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light, *, degree: int = 4):
    """Return the airlight integral J by the Taylor polynomial about the foot [1/m].

    Valid near theta = 0 only: the error is large where the segment ends more than about 1 rad from
    the foot or where sigma_t h is large; where the light lies far behind the camera,
    exp(-sigma_t foot) overflows. These are limits of the published method.

    Parameters
    ----------
    geometry, x0, x1, medium, light
        As for `realtime.kernels.registry.Kernel`.
    degree
        Degree of the polynomial, 0 or more; 4 in the paper.

    Raises
    ------
    InputError
        For a phase function that has no series, and for a degree below 0.
    """
    return _by_extinction(geometry, x0, x1, medium, light, degree=degree, printed=False)


def taylor_printed(
    geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light, *, degree: int = 4
):
    """Return J by the polynomial with the coefficients of the paper's annex,
    misprints included [1/m].

    Valid nowhere in particular: even near the foot the error is of first order in theta (hazy,
    murky) or of second (isotropic, Rayleigh).

    Parameters
    ----------
    geometry, x0, x1, medium, light
        As for `realtime.kernels.registry.Kernel`.
    degree
        Degree of the polynomial, 0 to 4; with 2 every coefficient is a printed one.

    Raises
    ------
    InputError
        For a phase function that the annex does not have, and for another degree.
    """
    return _by_extinction(geometry, x0, x1, medium, light, degree=degree, printed=True)


def _by_extinction(
    geometry: RayGeometry, x0, x1, medium: Homogeneous, light: Light, *, degree: int, printed: bool
):
    h = geometry.height

    def integral(sigma_t):
        a = sigma_t * h
        coefficients = coefficients_of(a, medium.phase, degree, printed=printed)
        total = integral_of(geometry, x0, x1, light, coefficients)
        # e^-a, which the coefficients leave out, with exp(-sigma_t foot)/h.
        return total * dr.exp(-sigma_t * geometry.foot - a) / h

    return medium.per_extinction(integral)


def coefficients_of(a, phase: Phase, degree: int, *, printed: bool) -> list:
    """Return c_0 to c_N without e^-a; where the annex has no coefficient, the printed
    polynomial takes the derived one.
    """
    check_degree(degree)
    name = phase.name
    if printed and name not in PRINTED_PHASES:
        raise InputError(
            "kernel taylor-printed: the paper prints no coefficients for the phase function "
            f"{name!r}; use the kernel 'taylor' or 'quadrature', or one of "
            f"{', '.join(PRINTED_PHASES)}"
        )
    highest = 4  # of the annex
    if printed and degree > highest:
        raise InputError(
            f"degree: got {degree}, expected 0 to {highest}; for more use the kernel 'taylor'"
        )
    # c_n = sum_k e_{n-k} p_k, the product of both series.
    series = phase_series(phase, degree, "taylor-printed" if printed else "taylor")
    derived = series_product(_extinction_series(a, degree), series, degree)
    if not printed:
        return derived
    # For all but the isotropic function the annex ends after c_2: the derived ones follow, and what
    # differs from the derived polynomial is the print's.
    annex = printed_coefficients(a, name)[: degree + 1]
    return annex + derived[len(annex) :]


def printed_coefficients(a, name: str) -> list:
    """Return the printed coefficients of theta^0, theta^1, ..., without e^-a, over the
    phase function's mean [1].

    `a`: sigma_t h [1], a number or an array of any kind; `name`: 'isotropic' (five coefficients),
    'rayleigh', 'hazy' or 'murky' (three).
    """
    # The annex, term by term as printed. The module has the derived terms beside the misprints.
    # A one of the same kind as `a`.
    unit = 0 * a + 1
    if name == "isotropic":
        return [
            unit,
            -a,
            a * a - a,
            -(a * a * a) / 6 + a * a / 2 - a,
            a * a * a * a / 24 - a * a * a / 4 + 11 * a * a / 24 - 5 * a / 24,
        ]
    if name == "rayleigh":
        return [0.75 * unit, -0.75 * a, 0.375 * a * a + 0.75]
    # The printed hazy function has the mean 2 over the sphere, the murky one 83/33.
    if name == "hazy":
        return [
            265 / 256 / 2 * unit,
            (-265 / 256 * a + 9 / 36) / 2,
            (265 / 256 * a * a - 121 / 512 * a + 63 / 64) / 2,
        ]
    head, mean = 2147483673 / 2147483648, 83 / 33
    return [
        head / mean * unit,
        (head * a - 25 / 367108864) / mean,
        (head / 2 * a * a - 2147482073 / 4294967296 * a + 775 / 134217728) / mean,
    ]


def integral_of(geometry: RayGeometry, x0, x1, light: Light, coefficients):
    """Return the integral of a polynomial in theta over a segment [1]."""
    # The largest number stands for the infinite end: its angle is pi/2, and the other formulas have
    # no infinity times zero.
    s0, s1 = x0 - geometry.foot, dr.minimum(x1 - geometry.foot, largest(type(geometry.height)))
    angles = dr.atan2(s0, geometry.height), dr.atan2(s1, geometry.height)
    if light.varies:
        return _weighted(geometry, light, angles, coefficients)
    return _integrated(geometry, (s0, s1), angles, coefficients)


def check_degree(degree: int) -> None:
    """Refuse a degree below 0."""
    if degree < 0:
        raise InputError(f"degree: got {degree}, expected 0 or more")


def _integrated(geometry: RayGeometry, ends, angles, coefficients):
    """Integrate the polynomial between two angles in closed form."""
    (s0, s1), (theta0, theta1) = ends, angles
    h = geometry.height
    # theta1 - theta0 as one arc tangent, so that short segments do not cancel. Where a product
    # overflows the segment is long, and the difference of both angles serves.
    across, along = h * (s1 - s0), dr.fma(s0, s1, h * h)
    bounded = dr.isfinite(across) & dr.isfinite(along)
    difference = dr.select(bounded, dr.atan2(across, along), theta1 - theta0)
    # theta1^(n+1) - theta0^(n+1) is the difference times the sum over k of theta1^k theta0^(n-k).
    # `powers` is that sum, and grows from one degree to the next by one product.
    total, powers, power0 = type(h)(0), type(h)(1), type(h)(1)
    for n, c in enumerate(coefficients):
        total += (c / (n + 1)) * powers
        power0 = power0 * theta0
        powers = dr.fma(powers, theta1, power0)
    return total * difference


def _weighted(geometry: RayGeometry, light: Light, angles, coefficients):
    """Integrate polynomial times falloff by eight Gauss-Legendre nodes: the paper's int
    I(theta) theta^n dtheta.
    """
    # From the nodes in [-1, 1] to the range of theta.
    theta0, theta1 = angles
    half, middle = 0.5 * (theta1 - theta0), 0.5 * (theta1 + theta0)
    total = type(half)(0)
    for xi, weight in zip(*np.polynomial.legendre.leggauss(8)):
        theta = dr.fma(half, float(xi), middle)
        # Horner's scheme at the node, then the falloff at x = foot + h tan theta.
        value = coefficients[-1]
        for c in reversed(coefficients[:-1]):
            value = dr.fma(value, theta, c)
        total += (
            float(weight)
            * value
            * geometry.falloff(light, geometry.foot + geometry.height * dr.tan(theta))
        )
    return total * half


def _extinction_series(a, degree: int):
    # g = sec + tan: 2 g' = 1 + g^2.
    g = [1.0]
    for n in range(degree):
        g.append((float(n == 0) + sum(g[k] * g[n - k] for k in range(n + 1))) / (2 * (n + 1)))
    # e = exp(-a (g - 1)): n e_n = -a sum_k k g_k e_{n-k}.
    e = [type(a)(1)]
    for n in range(1, degree + 1):
        e.append((-a / n) * sum((k * g[k]) * e[n - k] for k in range(1, n + 1)))
    return e


def phase_series(phase: Phase, degree: int, kernel: str):
    """Return the coefficients of p(-sin theta) in powers of theta; refuse a
    phase function without them.
    """
    series = phase.series(degree)
    if series is None:
        names = ", ".join(
            candidate.name for candidate in PHASES if candidate.series is not Phase.series
        )
        raise InputError(
            f"kernel {kernel}: phase function {phase.name!r} has no Taylor series; use the kernel "
            f"'quadrature' or one of {names}"
        )
    return series
