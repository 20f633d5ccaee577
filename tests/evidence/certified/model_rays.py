# SPDX-License-Identifier: BSD-3-Clause
"""The column `value` of `model_rays.csv`, from the definition, in mpmath; nothing of this project is
imported.

The other columns are the inputs, and count as exact. A lamp has, with foot t and height h of its
perpendicular on the ray and r = sqrt(h^2 + (x - t)^2),

    K = int_{x0}^{x1} exp(-sigma (a x + b r + M)) p(-(x - t)/r) f(r) w(r) dx      [1/m],

p Henyey and Greenstein's function of mean 1, f the distance law with its length l, power d and
scale s, w the window with s = r/R, both as the words of `airlight.Model` have them. The integral is
cut at the foot and where r is R or l, and taken over x = t + h sinh(v), in panels of 1 at most in
v, over which neither the phase function nor the law changes fast.

A sun of the height mu over an exponential layer has, z the height of a point and dz the rise of the
ray,

    K = int_{x0}^{x1} sigma(z) exp(-a tau(0,x) - b tau(x,sun)) dx,      sigma(z) = sigma exp(-z/H),

with tau(0,x) = sigma H (1 - exp(-dz x/H))/dz and tau(x,sun) = sigma(z) H/mu, from z = 0 on. It is
taken over x, and not by its closed form.
"""

from collections.abc import Callable, Mapping
from itertools import pairwise
from typing import Any

from mpmath import mp, mpf

DIGITS = 20
PRECISION = 45  # decimal digits that are carried

Row = Mapping[str, str]


def value(row: Row) -> str:
    """Return the text of the cell `value` of a row.

    Raises ArithmeticError if the quadrature has not converged to more digits than are printed.
    """
    with mp.workdps(PRECISION):
        found = _sun(row) if row["light"] == "sun" else _lamp(row)
        return str(mp.nstr(found, DIGITS, strip_zeros=False))


def _number(row: Row, name: str) -> Any:
    return mpf(float(row[name]))


def _law(row: Row) -> Callable[[Any], Any]:
    length, power, scale = (_number(row, name) for name in ("length", "power", "scale"))
    return {
        "power": lambda r: r**-power,
        "softened": lambda r: scale / (r * r + length * length),
        "clamped": lambda r: max(r, length) ** -power,
        "sphere": lambda r: 2 / (r * r + length**2 + r * mp.sqrt(r * r + length**2)),
    }[row["law"]]


def _window(row: Row) -> Callable[[Any], Any]:
    end = _number(row, "end")
    return {
        "none": lambda r: mp.one,
        "quartic": lambda r: (1 - (r / end) ** 4) ** 2,
        "fourth": lambda r: 1 - (r / end) ** 4,
        "square": lambda r: (1 - (r / end) ** 2) ** 2,
        "linear": lambda r: 1 - r / end,
        "cut": lambda r: mp.one,
    }[row["window"]]


def _lamp(row: Row) -> Any:
    foot, height, x0, x1, sigma_t, g, a, b, path = (
        _number(row, name)
        for name in ("foot", "height", "x0", "x1", "sigma_t", "g", "a", "b", "path")
    )
    law, window, length, end = _law(row), _window(row), _number(row, "length"), _number(row, "end")

    def integrand(x: Any) -> Any:
        r = mp.sqrt(height**2 + (x - foot) ** 2)
        cosine = (foot - x) / r if r else mp.zero
        phase = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** (mpf(3) / 2)
        depth = sigma_t * (a * x + b * r + path)
        return mp.exp(-depth) * phase * law(r) * window(r)

    # The part of the ray in the range, cut where the law has a kink, and at the foot.
    if row["window"] != "none":
        if end <= height:
            return mp.zero
        half = mp.sqrt(end**2 - height**2)
        x0, x1 = max(x0, foot - half), min(x1, foot + half)
        if x0 >= x1:
            return mp.zero
    marks = [x0, foot, x1]
    if length > height:
        half = mp.sqrt(length**2 - height**2)
        marks += [foot - half, foot + half]
    marks = sorted({x for x in marks if x0 <= x <= x1})
    return _summed(
        lambda v: integrand(foot + height * mp.sinh(v)) * height * mp.cosh(v),
        [mp.asinh((x - foot) / height) for x in marks],
    )


def _sun(row: Row) -> Any:
    rise, mu, scale, sigma_t, a, b, x0, x1 = (
        _number(row, name) for name in ("rise", "mu", "H", "sigma_t", "a", "b", "x0", "x1")
    )

    def integrand(x: Any) -> Any:
        density = sigma_t * mp.exp(-rise * x / scale)
        before = sigma_t * scale * -mp.expm1(-rise * x / scale) / rise
        return density * mp.exp(-a * before - b * density * scale / mu)

    # Parts over which neither the density nor the depth changes by more than a factor e.
    count = min(64, max(1, int(mp.ceil((x1 - x0) * (abs(rise) / scale + sigma_t)))))
    return _summed(integrand, [x0 + (x1 - x0) * mpf(part) / count for part in range(count + 1)])


def _summed(integrand: Callable[[Any], Any], marks: list[Any]) -> Any:
    """Return an integral over intervals, each in panels of 1 at most."""
    points = [marks[0]]
    for first, last in pairwise(marks):
        count = max(1, int(mp.ceil(last - first)))
        points += [first + (last - first) * mpf(number) / count for number in range(1, count + 1)]
    found, error = mp.quad(integrand, points, method="gauss-legendre", maxdegree=9, error=True)
    if error > abs(found) * mpf(10) ** -(DIGITS + 3):
        raise ArithmeticError(
            f"the quadrature of {mp.nstr(found, DIGITS)} errs by {mp.nstr(error, 3)}"
        )
    return found
