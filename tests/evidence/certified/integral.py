# SPDX-License-Identifier: BSD-3-Clause
"""The airlight integral to as many digits as wanted, from two quadratures at
two precisions, in mpmath.

Route one takes the definition, over the distance s = x - foot, by tanh-sinh, with 10 digits more
than asked for. Route two takes the path form (derived in docs/conventions.md) over w = log(q/h), by
Gauss-Legendre, with 25 digits more. They share the inputs, which count as exact, and the phase
function; a number is only returned where both agree.

A third route exists for isotropic scattering. With E = q/h and a = sigma_t h,

    J = (2/h) exp(-sigma_t foot) int_{E0}^{E1} exp(-a E)/(1 + E^2) dE,       1/(1 + E^2) = Im 1/(E - i),

and with z = a (E - i) the integral to infinity of exp(-a E)/(E - i) is exp(-i a) times
that of exp(-z)/z, hence

    J = (2/h) exp(-sigma_t foot) Im( exp(-i a) [E1(a (E0 - i)) - E1(a (E1 - i))] )

where the E1 before a bracket is the exponential integral (Abramowitz and Stegun 5.1.1) and the one
inside it the end of the range. All arguments lie below the real axis, so no branch cut is crossed.
"""

import math
from collections.abc import Callable
from typing import Any

from mpmath import mp, mpf

from airlight.analytic.phase import HenyeyGreenstein, PhaseFunction, Tabulated
from airlight.errors import InputError

_FEWEST_DIGITS = 15


def integrate_certified(
    foot: float,
    height: float,
    x0: float,
    x1: float,
    sigma_t: float,
    phase: PhaseFunction,
    *,
    digits: int = 20,
) -> Any:
    """Return J [1/m] as an mpmath number of which `digits` digits are certain.

    Parameters
    ----------
    foot, height, x0, x1, sigma_t, phase
        The segment [m] and the medium [1/m]; x1 may be infinite; binary numbers, taken as exact.
    digits
        Relative precision in decimal digits, at least 15: for less the float64
        routes are the right tool.

    Returns
    -------
    mpmath.mpf
        J [1/m]; 0 for an empty segment, +inf if the light is on the segment.

    Raises
    ------
    InputError
        For numbers out of their ranges or fewer than 15 digits.
    ArithmeticError
        If the two routes disagree: nothing is certain then.

    Notes
    -----
    Valid for all finite inputs and infinite x1. Takes a tenth of a second to a few seconds.
    """
    special = _special(foot, height, x0, x1, sigma_t, digits)
    if special is not None:
        return mpf(special)
    with mp.workdps(digits + 10):
        first = _by_distance(mpf(foot), mpf(height), mpf(x0), mpf(x1), mpf(sigma_t), phase)
    with mp.workdps(digits + 25):
        second = _by_path(mpf(foot), mpf(height), mpf(x0), mpf(x1), mpf(sigma_t), phase)
        if abs(first - second) > abs(second) * mpf(10) ** (-digits):
            raise ArithmeticError(
                f"two quadratures disagree for foot={foot!r}, height={height!r}, x0={x0!r}, "
                f"x1={x1!r}, "
                f"sigma_t={sigma_t!r}, {phase}: {mp.nstr(first, digits)} and "
                f"{mp.nstr(second, digits)}"
            )
    return second


#: What J depends on, in the order of `certified_slopes`.
SLOPES = ("foot", "height", "x0", "x1", "sigma_t", "g")
_STEP = 2.0**-26  # of differences: exact in float64, which g must be


def certified_slopes(
    foot: float,
    height: float,
    x0: float,
    x1: float,
    sigma_t: float,
    phase: PhaseFunction,
    *,
    digits: int = 17,
) -> tuple[Any, ...]:
    """Return the derivatives of J by foot, height, x0, x1 [1/m^2], sigma_t [1] and g
    [1/m], as mpmath numbers.

    A central difference D_h errs by the square of its step h, (4 D_h - D_2h)/3 by its fourth power.
    Where the two differ by more than half of the `digits` allow, nothing is certain. A derivative
    by g is that of Henyey and Greenstein's function; without one it is NaN.

    Parameters
    ----------
    foot, height, x0, x1, sigma_t, phase, digits
        See `integrate_certified`; x1 finite, digits at most 25.

    Raises
    ------
    ArithmeticError
        If two steps disagree: at heights or extinctions that are not large against 2^-26.

    Notes
    -----
    Valid where J is smooth over steps of 2^-26.
    """
    place = (foot, height, x0, x1, sigma_t)
    slopes = []
    with mp.workdps(40):
        size = abs(_by_path(mpf(foot), mpf(height), mpf(x0), mpf(x1), mpf(sigma_t), phase))
        for number, name in enumerate(SLOPES):
            if name == "g" and not isinstance(phase, HenyeyGreenstein):
                slopes.append(mp.nan)
                continue
            first, second = (_difference(place, phase, number, k * mpf(_STEP)) for k in (1, 2))
            slope = (4 * first - second) / 3
            if abs(first - second) > max(abs(slope), size) * mpf(10) ** (-digits / 2):
                raise ArithmeticError(
                    f"differences by {name} disagree at {place}: {first} and {second}"
                )
            slopes.append(slope)
    return tuple(slopes)


def _difference(place: tuple[float, ...], phase: PhaseFunction, number: int, step: Any) -> Any:
    ends = []
    for sign in (1, -1):
        foot, height, x0, x1, sigma_t = (
            mpf(v) + sign * step * (number == k) for k, v in enumerate(place)
        )
        own = phase
        if isinstance(phase, HenyeyGreenstein) and number == len(place):
            own = HenyeyGreenstein(float(mpf(phase.g) + sign * step))
        ends.append(_by_path(foot, height, x0, x1, sigma_t, own))
    return (ends[0] - ends[1]) / (2 * step)


def isotropic_closed_form(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, *, digits: int = 20
) -> Any:
    """Return J [1/m] of an isotropic medium by the complex exponential integral (module
    docstring, last equation).

    Parameters and special values are those of `integrate_certified`.

    Raises
    ------
    InputError
        As `integrate_certified` does.

    Notes
    -----
    Valid for height > 0 or the light on the segment. The difference of the two terms loses digits
    where a segment is short or dim; the precision is raised until `digits` are left.
    """
    special = _special(foot, height, x0, x1, sigma_t, digits)
    if special is not None:
        return mpf(special)
    if height == 0:
        raise InputError(
            "height is 0; the closed form wants a positive height: use integrate_certified"
        )
    precision = digits + 30
    for _ in range(8):
        with mp.workdps(precision):
            value, size = _closed_form(*map(mpf, (foot, height, x0, x1, sigma_t)))
            if abs(value) > size * mpf(10) ** (digits + 5 - precision):
                return value
        precision *= 2
    raise ArithmeticError(
        f"the closed form loses more than {precision // 2} digits for x0={x0!r}, x1={x1!r}"
    )


def _special(
    foot: float, height: float, x0: float, x1: float, sigma_t: float, digits: int
) -> float | None:
    """Check the inputs; return J where it takes no quadrature."""
    if digits < _FEWEST_DIGITS:
        raise InputError(
            f"digits is {digits}; expected at least {_FEWEST_DIGITS}: below, use analytic.panels"
        )
    for name, number in (("foot", foot), ("height", height), ("x0", x0), ("sigma_t", sigma_t)):
        signed = name in ("foot", "x0")
        if not (math.isfinite(number) and (signed or number >= 0)):
            raise InputError(
                f"{name} is {number}; expected a finite number{'' if signed else ' >= 0'}"
            )
    if not x1 >= x0:
        raise InputError(f"x1 is {x1}; expected a number >= x0 = {x0}, or inf")
    if x0 == x1:
        return 0.0
    return math.inf if height == 0 and x0 <= foot <= x1 else None


def _by_distance(
    foot: Any, height: Any, x0: Any, x1: Any, sigma_t: Any, phase: PhaseFunction
) -> Any:
    """Integrate the definition over s = x - foot by tanh-sinh."""
    s0, s1 = x0 - foot, x1 - foot
    scale = height if height > 0 else min(abs(s0), abs(s1))

    def integrand(s: Any) -> Any:
        r = mp.sqrt(height * height + s * s)
        return mp.exp(-sigma_t * (foot + s + r)) * phase.mp(-s / r) / (r * r)

    if mp.isinf(s1) and sigma_t > 0:
        # Behind the foot the exponent grows by at least 2 sigma_t a unit; 100 more
        # e-folds than there are digits.
        s1 = max(s0, mp.zero) + scale + (mp.dps * mp.log(10) + 100) / (2 * sigma_t)
    marks = [mp.zero]
    reach = max(abs(s0), abs(s1) if mp.isfinite(s1) else 64 * max(abs(s0), scale))
    mark = scale / 2
    while mark < reach:
        marks += [mark, -mark]
        mark *= 3
    marks += [scale * mp.sinh(mp.atanh(-c)) for c in _kinks(phase)]
    if sigma_t > 0:
        marks += [max(s0, mp.zero) + mp.mpf(4) ** k / sigma_t for k in range(-2, 5)]
    return _quadrature(integrand, s0, s1, marks, method="tanh-sinh")


def _by_path(foot: Any, height: Any, x0: Any, x1: Any, sigma_t: Any, phase: PhaseFunction) -> Any:
    """Integrate over w, the logarithm of the path, by Gauss-Legendre."""
    s0, s1 = x0 - foot, x1 - foot
    if height == 0:
        return _beside_light(foot, s0, s1, sigma_t, phase)
    w0 = mp.asinh(s0 / height)
    # 1/cosh w falls by an e-fold for each unit behind the foot, the exponential
    # by sigma_t h (e^w - e^w0).
    folds = mp.dps * mp.log(10) + 100
    w1 = max(w0, mp.zero) + folds
    if mp.isfinite(s1):
        w1 = min(w1, mp.asinh(s1 / height))
    if sigma_t > 0:
        w1 = min(w1, mp.log(mp.exp(w0) + folds / (sigma_t * height)))

    def integrand(w: Any) -> Any:
        return mp.exp(-sigma_t * (foot + height * mp.exp(w))) * phase.mp(-mp.tanh(w)) / mp.cosh(w)

    count = int(mp.ceil((w1 - w0) / 2))
    marks = [w0 + (w1 - w0) * k / count for k in range(1, count)] + [
        mp.atanh(-c) for c in _kinks(phase)
    ]
    return _quadrature(integrand, w0, w1, marks, method="gauss-legendre") / height


def _beside_light(foot: Any, s0: Any, s1: Any, sigma_t: Any, phase: PhaseFunction) -> Any:
    """Integrate a ray through the light, the light beside the segment: r = |s|, over
    the reciprocal u = 1/|s|.
    """
    if s1 < 0:  # before the light the path has the length foot all along
        return mp.exp(-sigma_t * foot) * phase.mp(1) * (1 / -s1 - 1 / -s0)
    u0, u1 = mp.zero if mp.isinf(s1) else 1 / s1, 1 / s0

    def integrand(u: Any) -> Any:
        return mp.exp(-sigma_t * (foot + 2 / u)) if u > 0 else mp.one if sigma_t == 0 else mp.zero

    marks = [u1 / 2**k for k in range(1, 24)]
    marks += [1 / (s0 + mp.mpf(2) ** k / sigma_t) for k in range(-3, 10)] if sigma_t > 0 else []
    return phase.mp(-1) * _quadrature(integrand, u0, u1, marks, method="gauss-legendre")


def _kinks(phase: PhaseFunction) -> list[Any]:
    """Return the cosines at which the slope of a table jumps, in the current precision."""
    if not isinstance(phase, Tabulated):
        return [mpf(float(c)) for c in phase.kinks]
    last = len(phase.kinks) + 1
    return [mpf(2 * k - last) / last for k in range(1, last)]


def _quadrature(
    integrand: Callable[[Any], Any], start: Any, end: Any, marks: list[Any], *, method: str
) -> Any:
    """Integrate between all marks that lie inside, to the working precision relative to the result.

    mpmath stops at an absolute error, so the integrand is divided by the integral, as known
    so far, until that is 1.
    """
    points = [start, *sorted({m for m in marks if start < m < end}), end]
    size = abs(mp.quad(integrand, points, method=method, maxdegree=3))
    for _ in range(50):
        if size == 0:
            return mp.zero
        ratio = mp.quad(
            lambda v, size=size: integrand(v) / size, points, method=method, maxdegree=10
        )
        if 0.5 < abs(ratio) < 2:
            return ratio * size
        size *= abs(ratio)
    raise ArithmeticError(f"the {method} quadrature does not settle")


def _closed_form(foot: Any, height: Any, x0: Any, x1: Any, sigma_t: Any) -> tuple[Any, Any]:
    """Return the closed form and the size of its larger term, for the loss of digits."""

    def path_ratio(s: Any) -> Any:
        r = mp.sqrt(height * height + s * s)
        return (s + r) / height if s >= 0 else height / (r - s)

    a, e0 = sigma_t * height, path_ratio(x0 - foot)
    ends = [e0] if mp.isinf(x1) else [e0, path_ratio(x1 - foot)]
    terms = [mp.expj(-a) * mp.e1(a * (e - 1j)) if a > 0 else mp.pi / 2 - mp.atan(e) for e in ends]
    factor = 2 / height * mp.exp(-sigma_t * foot)
    difference = terms[0] - sum(terms[1:])
    return factor * (difference if a == 0 else mp.im(difference)), factor * abs(terms[0])
