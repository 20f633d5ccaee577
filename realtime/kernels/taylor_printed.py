# SPDX-License-Identifier: BSD-3-Clause
"""The polynomial kernel of Biri, Arques and Michelin 2006 with the coefficients of its annex as transcribed.

The paper integrates the polynomial c_0 + c_1 theta + ... + c_4 theta^4 (section 4.1), as the kernel `taylor` does; the
derivation is there. Here the c_n are those that its annex prints, so that the paper's own error can be shown. With a =
sigma_t h, the factor e^-a left out, and an asterisk where the printed term is not the derived one (DESIGN section 3):

    isotropic   1;   -a;   a^2 - a *;   -a^3/6 + a^2/2 - a *;   a^4/24 - a^3/4 + 11 a^2/24 - 5 a/24
    Rayleigh    3/4;   -3a/4;   3a^2/8 + 3/4 *
    hazy        265/256;   -265a/256 + 9/36 *;   265a^2/256 - 121a/512 + 63/64 *
    murky       n/2^31;   +n a/2^31 - 25/367108864 *;   n a^2/2^32 - 2147482073 a/2^32 + 775/134217728

where n = 2147483673. Derived, the six starred terms are (a^2 - a)/2; -a^3/6 + a^2/2 - a/3; 3a^2/8 - 3a/8 + 3/4;
-265a/256 - 9/32; 265a^2/512 - 121a/512 + 63/64; -n a/2^31 - 25/67108864. The text at hand comes from scanned pages: a
wrong digit may be the scan's.

Three choices let the kernel be compared with others:

* The printed hazy and murky functions, 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means 2 and 83/33 over the
  sphere: all their coefficients are divided by these.
* For all but the isotropic function the annex ends with "..." after c_2. The missing c_3 and c_4 are the derived ones,
  so that whatever differs from `taylor` of the same degree is the print's.
* The rest, the difference of powers without cancellation among it, is code of `taylor`.
"""

import drjit as dr

from realtime.errors import InputError
from realtime.kernels.bounded import ConstantLeg, bounded_by
from realtime.kernels.taylor import _extinction_series, _integrated, _weighted, bounded_integral, phase_series
from realtime.numerics.array_types import largest
from realtime.rays.ray_light import RayGeometry
from realtime.scene.lights import Light
from realtime.scene.medium import Medium, per_extinction
from realtime.scene.phase import Phase, series_product

PRINTED_PHASES = ("isotropic", "rayleigh", "hazy", "murky")
HIGHEST_DEGREE = 4


def printed_bounded(geometry: RayGeometry, x0, x1, light: Light, phase: Phase, leg: ConstantLeg, *, degree: int = 4):
    """Return the airlight integral of a bounded medium with the annex's c_n(sigma_t, R), all as printed [1/m].

    Raises
    ------
    InputError
        As `taylor_printed`, and for the derived exponent, for which the paper prints no coefficients.
    """
    if not leg.printed:
        raise InputError(
            "kernel taylor-printed: the paper prints no coefficients for the exponent that section 4.2 must mean; use "
            "media=printed, or the kernel 'taylor'"
        )
    coefficients = _coefficients(leg.sigma_t * leg.distance, phase, degree)
    return bounded_integral(geometry, x0, x1, light, leg, coefficients)


@bounded_by(printed_bounded)
def taylor_printed(geometry: RayGeometry, x0, x1, medium: Medium, light: Light, *, degree: int = 4):
    """Return the airlight integral J by the polynomial of the paper's annex, misprints included [1/m].

    Parameters
    ----------
    geometry, x0, x1, medium, light
        See `realtime.kernels`.
    degree
        Where the polynomial is cut, 0 to 4; 4 in the paper. With 2, every coefficient is a printed one.

    Raises
    ------
    InputError
        For a phase function that the annex does not have, and for a degree that it does not have.

    Notes
    -----
    Valid nowhere in particular: even near the foot of the perpendicular the error is of first order in theta (hazy,
    murky) or of second (isotropic, Rayleigh). Limits as in `realtime.kernels.taylor.taylor`.

    References
    ----------
    Biri, Arques, Michelin 2006, *Real time rendering of atmospheric scattering and volumetric shadows*, annex.
    """
    foot, h = geometry.foot, geometry.height
    s0, s1 = x0 - foot, dr.minimum(x1 - foot, largest(type(h)))
    theta0, theta1 = dr.atan2(s0, h), dr.atan2(s1, h)

    def integral(sigma_t):
        a = sigma_t * h
        coefficients = _coefficients(a, medium.phase, degree)
        if light.varies:
            total = _weighted(geometry, light, (theta0, theta1), coefficients)
        else:
            total = _integrated(geometry, (s0, s1), (theta0, theta1), coefficients)
        return total * dr.exp(-sigma_t * foot - a) / h

    return per_extinction(medium, integral)


def _coefficients(a, phase: Phase, degree: int) -> list:
    """Return the coefficients of all powers up to a degree, those that the annex does not print derived."""
    name = phase.name
    if name not in PRINTED_PHASES:
        raise InputError(
            f"kernel taylor-printed: the paper prints no coefficients for the phase function {name!r}; use the kernel "
            f"'taylor' or 'quadrature', or one of {', '.join(PRINTED_PHASES)}"
        )
    if not 0 <= degree <= HIGHEST_DEGREE:
        raise InputError(f"degree: got {degree}, wanted 0 to {HIGHEST_DEGREE}; for more use the kernel 'taylor'")
    derived = phase_series(phase, degree, "taylor-printed")
    printed = printed_coefficients(a, name)
    if degree >= len(printed):
        printed = printed + series_product(_extinction_series(a, degree), derived, degree)[len(printed) :]
    return printed[: degree + 1]


def printed_coefficients(a, name: str) -> list:
    """Return the printed coefficients of theta^0, theta^1, ..., without e^-a, over the phase function's mean [1].

    Parameters
    ----------
    a
        sigma_t h [1], a number or an array of any kind.
    name
        'isotropic' (five coefficients), 'rayleigh', 'hazy' or 'murky' (three).
    """
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
