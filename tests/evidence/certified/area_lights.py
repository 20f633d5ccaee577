# SPDX-License-Identifier: BSD-3-Clause
"""Certified rows for area lights: one point of a light with its cosine, and spheres beside rays.

    python -m tests.evidence.certified.area_lights

writes them to `validation/certified`. A point of a light sends I cos_l into the direction of the
angle theta at the point, with cos_l = axial sin(theta) + across cos(theta): `axial` and `across`
are the components of its normal along the ray and towards the foot of the ray. Over the part of the
ray where that is positive

    J = int exp(-sigma_t (x + r)) p(c) cos_l / r^2 dx      [1/m]

is taken by tanh-sinh over x, and over w = asinh((x - foot)/h) by Gauss and Legendre with more
digits; both must agree to 15 digits. A sphere of radiance 1 gives K of
`tests.evidence.closed_forms`: over directions within its cone, and over distances to its surface.
"""

import json
from collections.abc import Callable
from typing import Any

from mpmath import mp, mpf

from airlight.validation.certified.files import FOLDER

SCHEMA = "airlight-certified-area/1"
_DIGITS = 15

#: sigma_t, foot, height, x0, x1, axial, across, g (None: isotropic); arbitrary
#: numbers, exact in binary.
POINTS: tuple[tuple[float | None, ...], ...] = (
    (0.21875, 1.5, 0.8125, 0.0, 4.25, 0.28125, -0.75, None),
    (0.21875, 1.5, 0.8125, 0.0, 4.25, 0.28125, 0.75, None),
    (1.375, 2.25, 0.34375, 0.5, 6.0, -0.9375, 0.125, None),
    (0.4375, -1.25, 0.59375, 0.0, 3.5, 0.6875, 0.5, 0.625),
    (0.109375, 3.125, 0.046875, 1.0, 9.5, 0.0, 1.0, -0.375),
)
#: sigma_t, height, radius, foot, x0, x1.
SPHERES: tuple[tuple[float, ...], ...] = (
    (0.21, 0.83, 0.1, 2.0, 0.0, 5.0),
    (0.21, 0.83, 0.3, 2.0, 0.0, 5.0),
    (0.21, 0.83, 0.6, 2.0, 0.0, 5.0),
    (1.3, 0.83, 0.3, 2.0, 0.0, 5.0),
    (0.21, 0.35, 0.3, 2.0, 0.0, 5.0),
)


def certified_rows() -> dict[str, Any]:
    """Return all rows, values with 15 digits as text."""
    names: tuple[str, ...] = ("sigma_t", "foot", "height", "x0", "x1", "axial", "across", "g")
    points = [
        dict(zip(names, row, strict=True)) | {"J": _text(point_integral(*row))} for row in POINTS
    ]
    names = ("sigma_t", "height", "radius", "foot", "x0", "x1")
    spheres = [
        dict(zip(names, row, strict=True)) | {"K": _text(sphere_integral(*row))} for row in SPHERES
    ]
    return {"schema": SCHEMA, "points": points, "spheres": spheres}


def point_integral(
    sigma_t: Any, foot: Any, height: Any, x0: Any, x1: Any, axial: Any, across: Any, g: Any = None
) -> Any:
    """Return J [1/m] of one point of a light as an mpmath number; arguments as in
    `POINTS`, lengths in metres.
    """

    def by_distance() -> Any:
        sigma, f, h, low, high, a, b = (
            mpf(v) for v in (sigma_t, foot, height, x0, x1, axial, across)
        )
        low, high = _lit(low, high, f, h, a, b)

        def integrand(x: Any) -> Any:
            s = x - f
            r = mp.sqrt(h * h + s * s)
            return mp.exp(-sigma * (x + r)) * _phase(-s / r, g) * (a * s + b * h) / r**3

        return mp.quad(integrand, _marks(low, high, f, h))

    def by_logarithm() -> Any:
        sigma, f, h, low, high, a, b = (
            mpf(v) for v in (sigma_t, foot, height, x0, x1, axial, across)
        )
        low, high = (mp.asinh((x - f) / h) for x in _lit(low, high, f, h, a, b))

        def integrand(w: Any) -> Any:
            sine = mp.tanh(w)
            cosine = a * sine + b / mp.cosh(w)
            return (
                mp.exp(-sigma * (f + h * mp.exp(w))) * _phase(-sine, g) * cosine / (h * mp.cosh(w))
            )

        count = max(1, int(mp.ceil(high - low)) * 2)
        return mp.quad(integrand, mp.linspace(low, high, count + 1), method="gauss-legendre")

    return _agreed(by_distance, by_logarithm)


def sphere_integral(
    sigma_t: float, height: float, radius: float, foot: float, x0: float, x1: float
) -> Any:
    """Return K [m] of a sphere of radiance 1 beside a ray as an mpmath
    number; lengths in metres.
    """

    def whole(inner: Callable[[Any, Any, Any], Any]) -> Any:
        sigma, h, radius_, f, low, high = (
            mpf(repr(v)) for v in (sigma_t, height, radius, foot, x0, x1)
        )

        def integrand(w: Any) -> Any:
            x = f + (h - radius_) * mp.sinh(w)
            d = mp.sqrt(h * h + (x - f) ** 2)
            return mp.exp(-sigma * x) * inner(sigma, d, radius_) * (h - radius_) * mp.cosh(w)

        ends = [mp.asinh((x - f) / (h - radius_)) for x in (low, high)]
        return mp.quad(integrand, mp.linspace(*ends, 7), method="gauss-legendre")

    def over_directions(sigma: Any, d: Any, radius_: Any) -> Any:
        # psi = alpha sin(t) takes the square root off the edge of the cone.
        alpha = mp.asin(radius_ / d)

        def integrand(t: Any) -> Any:
            psi = alpha * mp.sin(t)
            root = mp.sqrt(mp.fabs(radius_**2 - (d * mp.sin(psi)) ** 2))
            return (
                2
                * mp.pi
                * mp.sin(psi)
                * mp.exp(-sigma * (d * mp.cos(psi) - root))
                * alpha
                * mp.cos(t)
            )

        return mp.quad(integrand, [0, mp.pi / 4, mp.pi / 2], method="gauss-legendre")

    def over_distances(sigma: Any, d: Any, radius_: Any) -> Any:
        square = d * d - radius_**2

        def integrand(r: Any) -> Any:
            return (square / r**2 - 1) * mp.exp(-sigma * r)

        low, high = d - radius_, mp.sqrt(square)
        return (
            mp.pi
            / d
            * mp.quad(integrand, [low, mp.sqrt(low * high), high], method="gauss-legendre")
        )

    return _agreed(lambda: whole(over_directions), lambda: whole(over_distances))


def _lit(low: Any, high: Any, foot: Any, height: Any, axial: Any, across: Any) -> tuple[Any, Any]:
    """Return the part of a range of distances in which the cosine axial s +
    across height is positive.
    """
    if axial == 0:
        return low, high if across > 0 else low
    zero = foot - across * height / axial
    return (max(low, zero), max(high, zero)) if axial > 0 else (min(low, zero), min(high, zero))


def _marks(low: Any, high: Any, foot: Any, height: Any) -> list[Any]:
    inner = [foot + k * height for k in (-8, -2, 0, 2, 8)]
    return [low, *[mark for mark in inner if low < mark < high], high]


def _phase(c: Any, g: float | None) -> Any:
    if g is None:
        return mpf(1)
    return (1 - mpf(g) ** 2) / (1 + mpf(g) ** 2 - 2 * mpf(g) * c) ** mpf("1.5")


def _agreed(first: Callable[[], Any], second: Callable[[], Any]) -> Any:
    """Return what two routes at two precisions agree on to `_DIGITS` digits."""
    with mp.workdps(_DIGITS + 8):
        coarse = first()
    with mp.workdps(_DIGITS + 15):
        fine = second()
        if mp.fabs(coarse - fine) > mpf(10) ** -_DIGITS * mp.fabs(fine):
            raise ArithmeticError(
                f"two routes give {mp.nstr(coarse, 20)} and {mp.nstr(fine, 20)}; expected "
                f"{_DIGITS} equal digits"
            )
        return fine


def _text(value: Any) -> str:
    return str(mp.nstr(value, _DIGITS, min_fixed=-3, max_fixed=3))


if __name__ == "__main__":
    (FOLDER / "certified_area_lights.json").write_text(
        json.dumps(certified_rows(), indent=1) + "\n"
    )
