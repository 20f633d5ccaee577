# SPDX-License-Identifier: BSD-3-Clause
"""The column `value` of `height_fog_rays.csv`, from the definition, in mpmath; nothing of
this project is imported.

The other columns are the inputs, and count as exact; directions are divided by their length. With
the height z of a point, the density is

    sigma(z) = sigma_0 + sum_i sigma_i exp(-(z - z_i)/H_i),     clamped: sigma_i exp(-max(z - z_i, 0)/H_i),

and its antiderivative S(z) is closed. A segment of length l between the heights a and b has the
optical depth l (S(b) - S(a))/(b - a); the difference loses as many digits as a and b have in
common, which the precision spares.

A light at a place, with foot and height h of its perpendicular on the ray and x =
foot + h sinh w, r = h cosh w:

    K = int_{x0}^{x1} sigma exp(-tau(o,x) - tau(x,light)) p(c) / r^2 dx = int sigma exp(..) p(-tanh w) / r dw.

Over w the integrand has no peak of the light. It is cut where the ray crosses the base of a clamped
layer, and in panels over each of which neither w nor z/H changes by more than 1, on which
Gauss-Legendre rules converge fast.

The sun, mu its height: the exponent E(x) = tau(o,x) + tau(x,sun) is linear in tau(o,x) with the
slope 1 - dz/mu, since tau(x,sun) is the integral of the density over height above x, over mu. With
t = tau(x0,x)

    K = p int_0^{tau(x0,x1)} exp(-E(x0) - (1 - dz/mu) t) dt = p exp(-E(x0)) (1 - exp(-q))/(1 - dz/mu),

q = (1 - dz/mu) tau(x0,x1); in the limit of q to 0 it is p exp(-E(x0)) tau(x0,x1).
"""

import math
from collections.abc import Mapping
from typing import Any

from mpmath import mp, mpf

DIGITS = 20
# decimal digits that are carried, of which differences of heights and of the sun's slope take some
PRECISION = 60
_CLOSE = mpf(10) ** -40  # of a height or a slope: what is nearer to 0 is 0, and its limit is taken


def value(row: Mapping[str, str]) -> str:
    """Return the text of the cell `value` of a row.

    Raises ArithmeticError if the quadrature has not converged to more digits than are printed.
    """
    with mp.workdps(PRECISION):
        return str(
            mp.nstr(_sun(row) if row["light"] == "sun" else _place(row), DIGITS, strip_zeros=False)
        )


def _numbers(row: Mapping[str, str], point: str) -> list[Any]:
    return [mpf(float(row[point + axis])) for axis in "xyz"]


def _unit(vector: list[Any]) -> list[Any]:
    length = mp.sqrt(_dot(vector, vector))
    return [part / length for part in vector]


def _dot(first: list[Any], second: list[Any]) -> Any:
    return mp.fsum(a * b for a, b in zip(first, second, strict=True))


class _Fog:
    """The density of a row and its antiderivative over height."""

    def __init__(self, row: Mapping[str, str]) -> None:
        cell = {
            name: mpf(float(row[name])) for name in row if name[-1] in "012" and name[0] in "szH"
        }
        self.layers = [(cell[f"sigma_{i}"], cell[f"z_{i}"], cell[f"H_{i}"]) for i in "12"]
        self.constant, self.clamped = cell["sigma_0"], bool(int(row["clamped"]))

    def density(self, z: Any) -> Any:
        return self.constant + mp.fsum(
            sigma * mp.exp(-(max(z - base, mp.zero) if self.clamped else z - base) / scale)
            for sigma, base, scale in self.layers
        )

    def below(self, z: Any) -> Any:
        """Return the antiderivative: of each layer from its base, with the sign of z - z_i."""
        total = self.constant * z
        for sigma, base, scale in self.layers:
            flat = self.clamped and z < base
            total += sigma * (z - base if flat else -scale * mp.expm1(-(z - base) / scale))
        return total

    def depth(self, low: Any, high: Any, length: Any) -> Any:
        """Return the optical depth of a segment between two heights."""
        if abs(high - low) <= _CLOSE * (1 + abs(low)):
            return length * self.density(low)
        return length * (self.below(high) - self.below(low)) / (high - low)

    def above(self, z: Any) -> Any:
        """Return the integral of the density over all heights above one;
        infinite with a constant.
        """
        assert not self.constant
        assert not self.clamped
        return mp.fsum(
            sigma * scale * mp.exp(-(z - base) / scale) for sigma, base, scale in self.layers
        )


def _phase(g: Any, cosine: Any) -> Any:
    return (1 - g * g) / (1 + g * g - 2 * g * cosine) ** (mpf(3) / 2)


def _sun(row: Mapping[str, str]) -> Any:
    fog, g = _Fog(row), mpf(float(row["g"]))
    origin, way, towards = _numbers(row, "o"), _unit(_numbers(row, "d")), _unit(_numbers(row, "l"))
    x0, x1 = float(row["x0"]), float(row["x1"])
    start = origin[2] + x0 * way[2]
    before = fog.depth(origin[2], start, mpf(x0)) + fog.above(start) / towards[2]
    slope = 1 - way[2] / towards[2]
    if math.isinf(x1):
        depth = fog.above(start) / way[2] if way[2] > 0 else mp.inf
    else:
        depth = fog.depth(start, origin[2] + mpf(x1) * way[2], mpf(x1) - mpf(x0))
    lit = depth if abs(slope) <= _CLOSE else -mp.expm1(-slope * depth) / slope
    return _phase(g, _dot(towards, way)) * mp.exp(-before) * lit


def _place(row: Mapping[str, str]) -> Any:
    fog, g = _Fog(row), mpf(float(row["g"]))
    origin, way, light = _numbers(row, "o"), _unit(_numbers(row, "d")), _numbers(row, "l")
    away = [a - b for a, b in zip(light, origin, strict=True)]
    foot = _dot(away, way)
    beside = [a - foot * b for a, b in zip(away, way, strict=True)]
    height = mp.sqrt(_dot(beside, beside))

    def integrand(w: Any) -> Any:
        x, r = foot + height * mp.sinh(w), height * mp.cosh(w)
        z = origin[2] + x * way[2]
        depth = fog.depth(origin[2], z, x) + fog.depth(z, light[2], r)
        return fog.density(z) * mp.exp(-depth) * _phase(g, -mp.tanh(w)) / r

    def place(x: Any) -> Any:
        return mp.asinh((x - foot) / height)

    x0, x1 = (mpf(float(row[name])) for name in ("x0", "x1"))
    ends = {place(x0), place(x1)}
    if fog.clamped and way[2]:
        crossed = [(base - origin[2]) / way[2] for _, base, _ in fog.layers]
        ends |= {place(x) for x in crossed if x0 < x < x1}
    steepest = max(
        abs(way[2]) / scale + fog.density(min(origin[2], light[2])) for _, _, scale in fog.layers
    )
    marks: list[Any] = []
    for first, last in zip(sorted(ends), sorted(ends)[1:], strict=False):
        # Panels in which w changes by at most 1, and x by at most a scale
        # height or a mean free path.
        span = height * (mp.sinh(last) - mp.sinh(first))
        count = max(1, int(mp.ceil(last - first)), min(64, int(mp.ceil(span * steepest))))
        marks += [first + (last - first) * mpf(number) / count for number in range(count)]
    found, error = mp.quad(
        integrand, [*marks, max(ends)], method="gauss-legendre", maxdegree=9, error=True
    )
    if error > abs(found) * mpf(10) ** -(DIGITS + 5):
        raise ArithmeticError(
            f"the quadrature of {mp.nstr(found, DIGITS)} errs by {mp.nstr(error, 3)}"
        )
    return found
