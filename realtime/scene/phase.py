# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions in Dr.Jit, normalised so that their mean over the sphere is 1.

`cos_scatter` is the cosine of the scattering angle, +1 forward. The lobes "hazy" and "murky" of Biri 2006 (annex, after
Nishita 1987), 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means 2 and 83/33 and are divided by them.

A phase function is a class: its code is the class, its parameters are data. Kernels ask it for what they need, its
values, the widths of its lobe, its power series, and know none by name. A new one derives from `Phase` and says its
name and its values; what it does not say besides is taken from a function with kinks, which is slow and right for any,
and what it does not have (a polynomial, a series) the kernels that need it refuse.
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi


@dataclass(frozen=True)
class Reach:
    """How far rules of fixed sizes serve a phase function, each found by trial."""

    panel: float = 0.4  #: widest panel of `realtime.kernels.panels`, in v
    few: float = 0.1  #: longest segment for four nodes of `realtime.kernels.short_segments`, over its distance
    more: float = 0.2  #: and for eight nodes
    turn: float = 0.25  #: of the largest angle of a panel at the light, `realtime.bounded_media.panels`


class Phase:
    """A phase function."""

    name: ClassVar[str]
    constant: ClassVar[bool] = False  #: whether it is 1 everywhere, so that integrands leave it out
    reach: ClassVar[Reach] = Reach()
    polynomial: ClassVar[tuple[float, ...] | None] = None  #: coefficients of ((1 + cos)/2)^0, ^1, ..., if it is one
    scale: ClassVar[float] = 1.0  #: d of `realtime.kernels.exact`: about the E = q/h at which the lobe ends
    fit_scale: ClassVar[float] = 1.0  #: m of `realtime.kernels.polynomial_piece`

    def evaluate_half(self, down, up) -> Any:
        """Return the value [1] from `down`, sin^2, and `up`, cos^2 of half the scattering angle, (1 -+ cos)/2.

        A lobe narrower than the rounding of the cosine, 1e-7, is a matter of `down` alone: with it nothing cancels.
        """
        raise NotImplementedError

    def evaluate(self, cos_scatter) -> Any:
        """Return the value [1]; divide by 4 pi for 1/sr. Valid for -1 <= cos_scatter <= 1."""
        up = 0.5 + 0.5 * cos_scatter
        return self.evaluate_half(1 - up, up)

    def density(self, f, c, scale) -> Any:
        """Return p/(1 + E^2) cosh v at E = scale f, c = cosh v = sqrt(1 + f^2), as `realtime.kernels.panels` wants."""
        square = dr.square(scale * f)
        up = dr.rcp(square + 1)
        return c * up * self.evaluate_half(square * up, up)

    def panel_width(self, Float) -> Any:
        """Return the widest panel in v, for arrays of a type."""
        return Float(self.reach.panel)

    def largest_turn(self) -> Any:
        """Return `Reach.turn`."""
        return self.reach.turn

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return the E where a forward lobe ends, at most 1, and the E where a backward lobe begins, at least 1."""
        return Float(self.scale), 1.0

    def fit_scales(self, Float) -> tuple[Any, Any]:
        """Return m of `realtime.kernels.polynomial_piece`, and the E beyond which p/(1 + E^2) falls like 1/E^2."""
        return Float(self.fit_scale), Float(1)

    def series(self, degree: int) -> list[Any] | None:
        """Return the coefficients of p(-sin theta) in powers of theta, None where there are none."""
        return None


@dataclass(frozen=True)
class Isotropic(Phase):
    """The same in all directions."""

    name = "isotropic"
    constant = True
    reach = Reach(panel=2.9, few=0.55, more=1.7, turn=1.0)
    polynomial = (1.0,)

    def evaluate_half(self, down, up) -> Any:
        """Return 1."""
        return type(up)(1)

    def evaluate(self, cos_scatter) -> Any:
        """Return 1."""
        return type(cos_scatter)(1)

    def density(self, f, c, scale) -> Any:
        """Return 1/c: where the scale is 1 it is p/c."""
        return dr.rcp(c)

    def series(self, degree: int) -> list[Any]:
        """Return 1, 0, 0, ..."""
        return _one(degree)


@dataclass(frozen=True)
class Rayleigh(Phase):
    """3 (1 + cos^2)/4."""

    name = "rayleigh"
    reach = Reach(panel=1.5, few=0.5, more=1.5, turn=0.8)
    polynomial = (1.5, -3.0, 3.0)

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return 0.75 * dr.fma(up - down, up - down, 1)

    def evaluate(self, cos_scatter) -> Any:
        """Return the value."""
        return 0.75 * dr.fma(cos_scatter, cos_scatter, 1)

    def density(self, f, c, scale) -> Any:
        """Return p/c: the scale is 1."""
        inverse = dr.rcp(c)
        cos = dr.fma(2 * inverse, inverse, -1)
        return inverse * dr.fma(0.75 * cos, cos, 0.75)

    def series(self, degree: int) -> list[Any]:
        """Return the coefficients of 3 (1 + sin^2)/4."""
        sine = _sine(degree)
        return [0.75 * (a + b) for a, b in zip(_one(degree), series_product(sine, sine, degree))]


class _Power(Phase):
    """A constant and a power 2^doublings of (1 + cos)/2, divided by their mean."""

    doublings: ClassVar[int]
    weight: ClassVar[float]  #: of the power
    mean: ClassVar[float]

    def series(self, degree: int) -> list[Any]:
        """Return the coefficients by squaring those of (1 - sin)/2."""
        constant = _one(degree)
        power = [0.5 * (a - b) for a, b in zip(constant, _sine(degree))]
        for _ in range(self.doublings):
            power = series_product(power, power, degree)
        return [(a + self.weight * b) / self.mean for a, b in zip(constant, power)]


@dataclass(frozen=True)
class Hazy(_Power):
    """(1 + 9 ((1 + cos)/2)^8) / 2."""

    name = "hazy"
    reach = Reach(panel=1.15, few=0.45, more=1.3, turn=0.6)
    polynomial = (0.5, *[0.0] * 7, 4.5)
    scale, fit_scale = 0.7, 0.6
    doublings, weight, mean = 3, 9.0, 2.0

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return 0.5 + 4.5 * _power(up, 3)

    def evaluate(self, cos_scatter) -> Any:
        """Return the value."""
        return 0.5 + 4.5 * _power(0.5 + 0.5 * cos_scatter, 3)


@dataclass(frozen=True)
class Murky(_Power):
    """(1 + 50 ((1 + cos)/2)^32) 33/83."""

    name = "murky"
    reach = Reach(panel=0.75, few=0.4, more=1.3, turn=0.35)
    polynomial = (33 / 83, *[0.0] * 31, 50 * 33 / 83)
    scale, fit_scale = 0.5, 0.35
    doublings, weight, mean = 5, 50.0, 83 / 33

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return (33 / 83) * dr.fma(50.0, _power(up, 5), 1)

    def evaluate(self, cos_scatter) -> Any:
        """Return the value."""
        return (33 / 83) * dr.fma(50.0, _power(0.5 + 0.5 * cos_scatter, 5), 1)


@dataclass(frozen=True)
class HenyeyGreenstein(Phase):
    """(1 - g^2) / (1 + g^2 - 2 g cos)^(3/2), Henyey and Greenstein 1941."""

    g: Any  #: mean cosine, in (-1, 1)

    name = "hg"
    reach = Reach(few=0.55, more=1.9)
    #: Widest panels by the sign of g: a backward lobe rises within the range of integration.
    panels: ClassVar[tuple[float, float]] = (2.4, 1.7)

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        g = type(up)(self.g)
        base = dr.fma(4 * dr.abs(g), dr.select(g >= 0, down, up), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) * dr.rsqrt(base) / base

    def evaluate(self, cos_scatter) -> Any:
        """Return the value.

        1 + g^2 - 2 g c cancels in the lobe of a sharp g; (1 - |g|)^2 + 2 |g| (1 -+ c) is the same without.
        """
        g = type(cos_scatter)(self.g)
        base = dr.fma(2 * dr.abs(g), 1 - dr.mulsign(cos_scatter, g), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) * dr.rsqrt(base) / base

    def density(self, f, c, scale) -> Any:
        """Return it by (1 - g)(1 + g)/b^(3/2) with b (1 + E^2) = (1 - g)^2 + (1 + g)^2 E^2, whatever the sign of g.

        All that is left of it are a reciprocal and a square root.
        """
        square = dr.square(scale * f)
        g = type(f)(self.g)
        inverse = dr.rcp(dr.fma(square, dr.square((1 + g) / (1 - g)), 1))
        return dr.sqrt(dr.fma(square, inverse, inverse)) * inverse * c * ((1 + g) / dr.square(1 - g))

    def panel_width(self, Float) -> Any:
        """Return the widest panel in v by the sign of g."""
        forward, backward = (Float(width) for width in self.panels)
        return dr.select(Float(self.g) >= 0, forward, backward)

    def largest_turn(self) -> Any:
        """Return the share of the largest angle, about the width of the lobe."""
        return dr.maximum(1 - dr.abs(self.g), 0.03)

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return (1 - |g|)/(1 + |g|) of a forward lobe, and its inverse of a backward one."""
        forward, backward = dr.maximum(Float(self.g), 0), dr.maximum(-Float(self.g), 0)
        return (1 - forward) / (1 + forward), (1 + backward) / (1 - backward)

    def fit_scales(self, Float) -> tuple[Any, Any]:
        """Return min(1, d) and d = (1 - g)/(1 + g)."""
        g = Float(self.g)
        spread = (1 - g) / (1 + g)
        return dr.minimum(1, spread), spread

    def series(self, degree: int) -> list[Any]:
        """Return the series of (1 - g^2) b^(-3/2), b = 1 + g^2 + 2 g sin theta, from b y' = -(3/2) b' y."""
        g = self.g
        b = [1 + g * g] + [2 * g * s for s in _sine(degree)[1:]]
        y = [(1 - g) * (1 + g) * dr.rsqrt(b[0]) / b[0]]
        for n in range(1, degree + 1):
            y.append(sum((-1.5 * k - (n - k)) * b[k] * y[n - k] for k in range(1, n + 1)) / (n * b[0]))
        return y


@dataclass(frozen=True)
class Tabulated(Phase):
    """Linear between values of mean 1 at regularly spaced cosines from -1 to 1."""

    values: Any

    name = "tabulated"

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return self.evaluate(up - down)

    def evaluate(self, cos_scatter) -> Any:
        """Return the value."""
        c = cos_scatter
        last = dr.width(self.values) - 1
        position = dr.clip((c + 1) * (0.5 * last), 0, last)
        index = dr.minimum(mi.UInt32(position), last - 1)
        weight = position - type(c)(index)
        low = dr.gather(type(c), self.values, index)
        high = dr.gather(type(c), self.values, index + 1)
        return dr.lerp(low, high, weight)


#: Those of the toolkit.
PHASES: tuple[type[Phase], ...] = (Isotropic, Rayleigh, Hazy, Murky, HenyeyGreenstein, Tabulated)


def named_phase(name: str, *, g=None, values=None) -> Phase:
    """Return a phase function of the toolkit.

    Parameters
    ----------
    name
        Of one of `PHASES`.
    g
        'hg': mean cosine, in (-1, 1).
    values
        'tabulated': values of mean 1 at regularly spaced cosines from -1 to 1.
    """
    given = {HenyeyGreenstein: (g,), Tabulated: (values,)}
    made = {phase.name: phase for phase in PHASES}[name]
    return made(*given.get(made, ()))


def evaluate(phase: Phase, cos_scatter):
    """Return the value of a phase function at `cos_scatter` [1]; see `Phase.evaluate`."""
    return phase.evaluate(cos_scatter)


def series_product(left, right, degree: int) -> list[Any]:
    """Return the coefficients of the product of two power series, `left` and `right`, up to a degree."""
    return [sum(left[n - k] * right[k] for k in range(n + 1)) for n in range(degree + 1)]


def _one(degree: int) -> list[float]:
    return [1.0] + [0.0] * degree


def _sine(degree: int) -> list[float]:
    """Return the coefficients of sin theta."""
    return [0.0 if n % 2 == 0 else (-1.0) ** (n // 2) / math.factorial(n) for n in range(degree + 1)]


def _power(base, doublings: int):
    for _ in range(doublings):
        base = base * base
    return base
