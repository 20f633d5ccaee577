# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions in Dr.Jit, normalised so that their mean over the sphere is 1.

`cos_scatter` is the cosine of the scattering angle, +1 forward. The lobes "hazy" and "murky" of
Biri 2006 (annex, after Nishita 1987), 1 + 9((1+cos)/2)^8 and 1 + 50((1+cos)/2)^32, have the means 2
and 83/33 and are divided by them.

A phase function is a class: its code is the class, its parameters are data. Kernels ask it for its
values, the widths of its lobe, its power series, and know none by name. A new one derives from
`Phase` and gives its name and its values. How far rules of few nodes reach is tried on these values
(`realtime.scene.rule_reach`). Kernels that need a polynomial or a series refuse a phase function
without one.
"""

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi
import numpy as np
from drjit.scalar import ArrayXf64

from airlight.errors import InputError
from airlight.realtime.droplets import CUT, droplet_table, fraction_cut
from airlight.realtime.numerics.functions import between_entries, cell_of
from airlight.realtime.scene.rule_reach import Reach, reach_of, shortest


class Phase:
    """A phase function."""

    name: ClassVar[str]
    constant: ClassVar[bool] = False  #: whether it is 1 everywhere, so that integrands leave it out
    #: coefficients of ((1 + cos)/2)^0, ^1, ..., if it is one
    polynomial: ClassVar[tuple[float, ...] | None] = None
    #: d of `realtime.kernels.exact`: about the E = q/h at which the lobe ends
    scale: ClassVar[float] = 1.0
    edge: ClassVar[float | None] = None  #: the E at which it jumps; None: nowhere

    def evaluate_half(self, down, up) -> Any:
        """Return the value [1] from `down`, sin^2, and `up`, cos^2 of half the
        scattering angle, (1 -+ cos)/2.

        A lobe narrower than the rounding of the cosine, 1e-7, is a matter of `down` alone:
        with it nothing cancels.
        """
        raise NotImplementedError

    def evaluate(self, cos_scatter) -> Any:
        """Return the value [1]; divide by 4 pi for 1/sr. Valid for -1 <= cos_scatter <= 1."""
        up = 0.5 + 0.5 * cos_scatter
        return self.evaluate_half(1 - up, up)

    def density(self, f, c, scale) -> Any:
        """Return p/(1 + E^2) cosh v at E = scale f, c = cosh v = sqrt(1 + f^2), the integrand of
        `realtime.kernels.exact`.
        """
        # E is the tangent of half the scattering angle: cos^2 of it is 1/(1 + E^2).
        square = dr.square(scale * f)
        up = dr.rcp(square + 1)
        return c * up * self.evaluate_half(square * up, up)

    @property
    def reach(self) -> Reach:
        """How far rules of few nodes reach; a phase function whose parameters are arrays has
        another way to say it.
        """
        return _reach(self)

    def panel_width(self, Float) -> Any:
        """Return the widest panel in v, for arrays of a type."""
        return Float(self.reach.panel)

    def width(self, Float) -> Any:
        """Return the widest panel in ln E
        (`realtime.scene.media.integrate`), for arrays of a type.
        """
        return Float(self.reach.width)

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return the E where a forward lobe ends, at most 1, and the E where a backward
        lobe begins, at least 1.
        """
        return Float(self.scale), 1.0

    def series(self, degree: int) -> list[Any] | None:
        """Return the coefficients of p(-sin theta) in powers of theta,
        None where there are none.
        """
        return None


@dataclass(frozen=True)
class Isotropic(Phase):
    """The same in all directions."""

    name = "isotropic"
    constant = True
    polynomial = (1.0,)

    def evaluate_half(self, down, up) -> Any:
        """Return 1."""
        return type(up)(1)

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
    polynomial = (1.5, -3.0, 3.0)

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        # up - down is the cosine.
        return 0.75 * dr.fma(up - down, up - down, 1)

    def series(self, degree: int) -> list[Any]:
        """Return the coefficients of 3 (1 + sin^2)/4."""
        # The argument is -sin theta: its square is sin^2.
        sine = _sine(degree)
        return [0.75 * (a + b) for a, b in zip(_one(degree), series_product(sine, sine, degree))]


class _Power(Phase):
    """A constant and a power 2^doublings of (1 + cos)/2, divided by their mean."""

    doublings: ClassVar[int]
    weight: ClassVar[float]  #: of the power
    mean: ClassVar[float]

    def series(self, degree: int) -> list[Any]:
        """Return the coefficients by squaring those of (1 - sin)/2."""
        # (1 + cos)/2 at cos = -sin theta is (1 - sin)/2; each squaring doubles the power.
        constant = _one(degree)
        power = [0.5 * (a - b) for a, b in zip(constant, _sine(degree))]
        for _ in range(self.doublings):
            power = series_product(power, power, degree)
        return [(a + self.weight * b) / self.mean for a, b in zip(constant, power)]


@dataclass(frozen=True)
class Hazy(_Power):
    """(1 + 9 ((1 + cos)/2)^8) / 2."""

    name = "hazy"
    polynomial = (0.5, *[0.0] * 7, 4.5)
    scale = 0.7
    doublings, weight, mean = 3, 9.0, 2.0

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        # ((1 + cos)/2)^(2^3), with the mean 2 divided out.
        return 0.5 + 4.5 * _power(up, 3)


@dataclass(frozen=True)
class Murky(_Power):
    """(1 + 50 ((1 + cos)/2)^32) 33/83."""

    name = "murky"
    polynomial = (33 / 83, *[0.0] * 31, 50 * 33 / 83)
    scale = 0.5
    doublings, weight, mean = 5, 50.0, 83 / 33

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        # ((1 + cos)/2)^(2^5), with the mean 83/33 divided out.
        return (33 / 83) * dr.fma(50.0, _power(up, 5), 1)


@dataclass(frozen=True)
class HenyeyGreenstein(Phase):
    """(1 - g^2) / (1 + g^2 - 2 g cos)^(3/2), Henyey and Greenstein 1941."""

    g: Any  #: mean cosine, in (-1, 1)

    name = "hg"

    @staticmethod
    @lru_cache(maxsize=1)
    def reaches() -> tuple[Reach, Reach]:
        """Return how far rules reach for all forward lobes, and for all backward ones: g may differ
        between lanes.
        """
        # Rules are judged at g = 0 and at |g| = 0.95: of sharper lobes they reach as far.
        sharp = 0.95
        even = _reach(HenyeyGreenstein(0.0))
        forward, backward = (_reach(HenyeyGreenstein(g)) for g in (sharp, -sharp))
        return shortest(even, forward), shortest(even, backward)

    @property
    def reach(self) -> Reach:
        """How far rules reach whatever g is."""
        return shortest(*self.reaches())

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        # (1 - |g|)^2 + 4 |g| sin^2 of half the angle from the lobe's axis: a sum, which does not
        # cancel.
        g = type(up)(self.g)
        base = dr.fma(4 * dr.abs(g), dr.select(g >= 0, down, up), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) / (base * dr.sqrt(base))

    def evaluate(self, cos_scatter) -> Any:
        """Return the value.

        1 + g^2 - 2 g c cancels in the lobe of a sharp g; (1 - |g|)^2 + 2 |g| (1
        -+ c) is the same without.
        """
        g = type(cos_scatter)(self.g)
        base = dr.fma(2 * dr.abs(g), 1 - dr.mulsign(cos_scatter, g), dr.square(1 - dr.abs(g)))
        return (1 - g) * (1 + g) / (base * dr.sqrt(base))

    def density(self, f, c, scale) -> Any:
        """Return it by (1 - g)(1 + g)/b^(3/2) with b (1 + E^2) = (1 - g)^2 + (1 + g)^2
        E^2, whatever the sign of g.

        All that is left of it are a reciprocal and a square root.
        """
        square = dr.square(scale * f)
        g = type(f)(self.g)
        inverse = dr.rcp(dr.fma(square, dr.square((1 + g) / (1 - g)), 1))
        return (
            dr.sqrt(dr.fma(square, inverse, inverse)) * inverse * c * ((1 + g) / dr.square(1 - g))
        )

    def panel_width(self, Float) -> Any:
        """Return the widest panel in v by the sign of g: a backward lobe rises within
        the range of integration.
        """
        forward, backward = (Float(reach.panel) for reach in self.reaches())
        return dr.select(Float(self.g) >= 0, forward, backward)

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return (1 - |g|)/(1 + |g|) of a forward lobe, and its inverse of a backward one."""
        forward, backward = dr.maximum(Float(self.g), 0), dr.maximum(-Float(self.g), 0)
        return (1 - forward) / (1 + forward), (1 + backward) / (1 - backward)

    def series(self, degree: int) -> list[Any]:
        """Return the series of (1 - g^2) b^(-3/2), b = 1 + g^2 + 2 g sin theta,
        from b y' = -(3/2) b' y.
        """
        g = self.g
        # The coefficients of theta^(n-1) on both sides give n b_0 y_n from the ones before.
        b = [1 + g * g] + [2 * g * s for s in _sine(degree)[1:]]
        y = [(1 - g) * (1 + g) * dr.rsqrt(b[0]) / b[0]]
        for n in range(1, degree + 1):
            y.append(
                sum((-1.5 * k - (n - k)) * b[k] * y[n - k] for k in range(1, n + 1)) / (n * b[0])
            )
        return y


@dataclass(frozen=True)
class Tabulated(Phase):
    """Linear between values of mean 1 at regularly spaced cosines from -1 to 1."""

    values: Any
    lobe: float = 1.0  #: E = tan(angle/2) at which a forward lobe has fallen to half, at most 1
    reaches: Reach | None = None  #: as `tabulated` finds it

    name = "tabulated"

    @property
    def reach(self) -> Reach:
        """How far rules reach in the table."""
        assert self.reaches is not None
        return self.reaches

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return the E where the lobe ends, and 1."""
        return Float(self.lobe), 1.0

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return self.evaluate(up - down)

    def evaluate(self, cos_scatter) -> Any:
        """Return the value."""
        # The cosine from -1 to 1 as a place from 0 to 1.
        (value,) = between_entries(self.values, [(0.5 * (cos_scatter + 1), dr.width(self.values))])
        return value


@dataclass(frozen=True)
class HgDraine(Phase):
    """(1 - w) of Henyey and Greenstein's function and w of Draine's, which Jendersie and d'Eon
    2023 fitted to droplets.

    Draine's is hg(g_D) (1 + alpha cos^2), divided by its mean 1 + alpha (1 + 2 g_D^2)/3.
    """

    diameter: float  #: of the droplets [um], 5 to 50

    name = "hg-draine"

    def __post_init__(self):
        if not 5 <= self.diameter <= 50:
            raise InputError(
                f"the diameter of 'hg-draine' is {self.diameter} um; expected 5 to 50 um"
            )

    @property
    def lobes(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """The fraction and the mean cosine of Henyey and Greenstein's
        function, then of Draine's.
        """
        d = self.diameter
        # The paper's fits, by the diameter in um.
        fraction = math.exp(-0.665888 - 0.599085 / (d - 0.641583))
        narrow, wide = (
            math.exp(-0.0990567 / (d - 1.67154)),
            math.exp(-0.428934 - 2.20679 / (d + 3.91029)),
        )
        return (1 - fraction, narrow), (fraction, wide)

    @property
    def rise(self) -> tuple[float, float]:
        """The factors of 1 and of cos^2 in Draine's function, times the fraction of its lobe."""
        (_, _), (fraction, wide) = self.lobes
        alpha = math.exp(3.62489 - 8.29288 / (self.diameter + 5.52825))
        mean = 1 + alpha * (1 + 2 * wide * wide) / 3
        return fraction / mean, fraction * alpha / mean

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        (fraction, narrow), (_, wide) = self.lobes
        constant, square = self.rise
        cos = up - down
        # Henyey and Greenstein's narrow lobe, then Draine's: the wide lobe times 1 + alpha cos^2.
        first = HenyeyGreenstein(narrow).evaluate_half(down, up)
        second = HenyeyGreenstein(wide).evaluate_half(down, up)
        return dr.fma(fraction, first, dr.fma(square * cos, cos, constant) * second)

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return (1 - g)/(1 + g) of the narrow lobe, and 1."""
        (_, narrow), _ = self.lobes
        return Float((1 - narrow) / (1 + narrow)), 1.0

    def series(self, degree: int) -> list[Any]:
        """Return the coefficients of both lobes, Draine's times those of its square."""
        (fraction, narrow), (_, wide) = self.lobes
        constant, square = self.rise
        sine = _sine(degree)
        # The factor with cos^2 = sin^2 theta as a series.
        rise = [
            constant * a + square * b
            for a, b in zip(_one(degree), series_product(sine, sine, degree))
        ]
        first, second = (
            HenyeyGreenstein(dr.opaque(mi.Float64, g)).series(degree) for g in (narrow, wide)
        )
        return [fraction * a + b for a, b in zip(first, series_product(rise, second, degree))]


@dataclass(frozen=True)
class Mie(Phase):
    """Water droplets, from the table of `realtime.droplets`."""

    entries: Any  #: values and slopes in turn
    lobe: float  #: E = tan(angle/2) at which the peak has fallen to half
    #: as `named_phase` finds it: the finer the function ripples, the shorter
    reaches: Reach | None = None

    name = "mie"

    @property
    def reach(self) -> Reach:
        """How far rules reach among the ripples."""
        assert self.reaches is not None
        return self.reaches

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2, Hermite's cubic between two entries."""
        # Entries are even in sin/(sin + cos) of half the angle, which is 0 forward and 1 backward.
        near, far = dr.sqrt(down), dr.sqrt(up)
        count = dr.width(self.entries) // 2
        cell, t = cell_of(near / (near + far) * (count - 1), count)
        value, slope, next_value, next_slope = (
            dr.gather(type(t), self.entries, 2 * cell + number) for number in range(4)
        )
        # Hermite's cubic with the values and the slopes of both entries.
        rise = next_value - value
        cubic = slope + next_slope - 2 * rise
        return dr.fma(t, dr.fma(t, dr.fma(t, cubic, rise - slope - cubic), slope), value)

    def lobe_scales(self, Float) -> tuple[Any, Any]:
        """Return the E where the peak ends, and 1."""
        return Float(self.lobe), 1.0


@dataclass(frozen=True)
class ModifiedMie(Mie):
    """The same without what is below five degrees, divided by what is left
    (Bouthors 2008, appendix).
    """

    left: float = 1.0  #: fraction of the light beyond five degrees

    name = "mie-modified"
    edge: ClassVar[float] = math.tan(math.radians(0.5 * CUT))

    def evaluate_half(self, down, up) -> Any:
        """Return the value from (1 -+ cos)/2."""
        return dr.select(
            down < math.sin(math.radians(0.5 * CUT)) ** 2,
            0,
            super().evaluate_half(down, up) / self.left,
        )


#: The phase functions of the toolkit.
PHASES: tuple[type[Phase], ...] = (
    Isotropic,
    Rayleigh,
    Hazy,
    Murky,
    HenyeyGreenstein,
    Tabulated,
    HgDraine,
    Mie,
    ModifiedMie,
)


def named_phase(words: str, *, g=None, values=None, Float: Any = None) -> Phase:
    """Return a phase function of the toolkit.

    Parameters
    ----------
    words
        The name of one of `PHASES`, then by colons for 'hg' g, for 'hg-draine' the diameter [um],
        for 'mie' and 'mie-modified' the effective radius [um], gamma and the wavelength [um].
    g
        'hg': mean cosine, in (-1, 1), where the words do not say it.
    values
        'tabulated': values of mean 1 at regularly spaced cosines from -1 to 1.
    Float
        Array type of the tables of droplets; None: `mi.Float`.

    Raises
    ------
    InputError
        For words that name no phase function, a cell that is no number, or droplets out of range.
    """
    name, *cells = words.split(":")
    by_name = {phase.name: phase for phase in PHASES}
    if name not in by_name:
        raise InputError(f"the phase function is '{words}'; expected one of {', '.join(by_name)}")
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        raise InputError(
            f"the phase function is '{words}'; expected numbers after '{name}:'"
        ) from None
    # The most numbers that the words of each may have.
    if len(numbers) > {
        HenyeyGreenstein.name: 1,
        HgDraine.name: 1,
        Mie.name: 3,
        ModifiedMie.name: 3,
    }.get(name, 0):
        raise InputError(f"the phase function is '{words}'; it has fewer numbers: leave some out")
    # Phase functions with parameters, one by one; the others have none.
    if name in (Mie.name, ModifiedMie.name):
        return _droplets(name, Float or mi.Float, *numbers)
    if name == HgDraine.name:
        return HgDraine(*numbers) if numbers else HgDraine(12.0)
    if name == HenyeyGreenstein.name:
        if numbers and not -1 < numbers[0] < 1:
            raise InputError(
                f"the mean cosine of '{words}' is {numbers[0]:g}; expected more than -1, less than "
                "1"
            )
        return HenyeyGreenstein((Float or mi.Float)(numbers[0]) if numbers else g)
    if name == Tabulated.name:
        return Tabulated(values) if values is None else tabulated(values)
    return by_name[name]()


def tabulated(values) -> Tabulated:
    """Return a table as it is read: `values` of mean 1 at regularly spaced cosines from -1
    to 1, an array of Dr.Jit.
    """
    host = np.array(values, dtype=np.float64)
    # The lobe ends at the last cosine whose value is less than half of that at 1, at
    # E = tan(angle/2), and at E = 1 if it is wider.
    below = host < 0.5 * host[-1]
    cosine = np.linspace(-1.0, 1.0, len(host))[np.flatnonzero(below)[-1]] if below.any() else -1.0
    lobe = min(math.sqrt((1 - cosine) / max(1 + cosine, 1e-6)), 1.0)
    # Rules may leave 1e-3: a table leaves more between its entries. Where it has next to nothing,
    # they may leave 1e-3 of the mean, 1: the end of a lobe in a panel would have no relative error.
    eager = Tabulated(ArrayXf64(host + (host.min() < 1e-2)))
    return Tabulated(values, lobe, reach_of(eager.evaluate_half, (lobe, 1.0), 1e-3))


def _droplets(
    name: str, Float, radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55
) -> Phase:
    # Rules are tried on the whole function on the host, to 1e-5: the table of droplets leaves more
    # between its entries. Without its peak the lobe ends where the peak was cut.
    table = droplet_table(radius, gamma, wavelength)
    eager, entries = Mie(ArrayXf64(table.entries), table.peak), Float(table.entries)
    modified = name == ModifiedMie.name
    lobe = ModifiedMie.edge if modified else table.peak
    reach = reach_of(eager.evaluate_half, (lobe, 1.0), 1e-5)
    if modified:
        return ModifiedMie(entries, lobe, reach, 1 - fraction_cut(radius, gamma, wavelength))
    return Mie(entries, lobe, reach)


@lru_cache(maxsize=64)
def _reach(phase: Phase) -> Reach:
    """Return how far rules reach for a phase function whose parameters are plain numbers."""
    first, last = map(float, phase.lobe_scales(float))
    return reach_of(phase.evaluate_half, (first, last))


def series_product(left, right, degree: int) -> list[Any]:
    """Return the coefficients of the product of two power series, `left` and
    `right`, up to a degree.
    """
    return [sum(left[n - k] * right[k] for k in range(n + 1)) for n in range(degree + 1)]


def _one(degree: int) -> list[float]:
    return [1.0] + [0.0] * degree


def _sine(degree: int) -> list[float]:
    """Return the coefficients of sin theta."""
    return [
        0.0 if n % 2 == 0 else (-1.0) ** (n // 2) / math.factorial(n) for n in range(degree + 1)
    ]


def _power(base, doublings: int):
    for _ in range(doublings):
        base = base * base
    return base
