# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions, normalised so that their mean over the sphere is 1.

The mean over the sphere is (1/2) int_{-1}^{1} p(c) dc, c the cosine of the
scattering angle, +1 forward. With

    up = (1 + c)/2 = cos^2(angle/2),    down = (1 - c)/2 = sin^2(angle/2)

the functions read

    isotropic   1
    rayleigh    3 (1 + c^2)/4
    hazy        (1 + 9 up^8)/2          mean of up^8  = 1/9:   1 + 9/9   = 2      (Biri 2006, annex, after Nishita 1987)
    murky       (1 + 50 up^32) 33/83    mean of up^32 = 1/33:  1 + 50/33 = 83/33  (the same)
    hg          (1 - g^2) / (1 + g^2 - 2 g c)^(3/2)                               (Henyey and Greenstein 1941)
    cornette-shanks  hg(g) 3 (1 + c^2)/(2 (2 + g^2)),  the mean of c^2 over an hg being (1 + 2 g^2)/3   (1992)
    tabulated   linear between values at regularly spaced c, divided by their mean (the trapezoid rule, exact here)
    hg-draine   (1 - w) hg(g_HG) + w (1 + alpha c^2)/(1 + alpha (1 + 2 g_D^2)/3) hg(g_D)
    mie, mie-modified   water droplets, `analytic.droplets`, at one wavelength

The second term of `hg-draine` is Draine's function (2003, ApJ 598, 1017): the mean of c^2 over an
hg is (1 + 2 g^2)/3. Jendersie and d'Eon (SIGGRAPH 2023 Talks) fitted both terms to fog and clouds,
for diameters d of 5 to 50 um:

    g_HG = exp(-0.0990567/(d - 1.67154))            g_D = exp(-2.20679/(d + 3.91029) - 0.428934)
    alpha = exp(3.62489 - 8.29288/(d + 5.52825))    w = exp(-0.599085/(d - 0.641583) - 0.665888)

Everything is evaluated from `up` and `down`, which a caller near the forward or backward direction
knows without cancellation: 1 + g^2 - 2 g c = (1 - g)^2 + 4 g down = (1 + g)^2 - 4 g up, all terms
positive in the first for g > 0, in the second for g < 0.
"""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import numpy as np
from mpmath import mp, mpf
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.droplets import WATER, Droplets, Modified, Optics, optics
from airlight.errors import InputError, nearest

Array = NDArray[np.float64]

#: The phase functions of scenes, and of Biri 2006.
PHASE_NAMES = ("isotropic", "rayleigh", "hazy", "murky", "hg", "tabulated")


class PhaseFunction:
    """A phase function of mean 1 over the sphere; call it with cosines of the scattering angle.

    Notes
    -----
    Valid for -1 <= cosine <= 1. Multiply by 1/(4 pi) for 1/sr.

    The cosine is Mitsuba's too, as evaluated in version 3.9.1: for light that travels along +z
    (`wi` = -z in its interaction record) `eval_pdf` with `wo` = +z gives the largest value of an
    'hg' of positive g and the last value of a 'tabphase'. Its values are these divided by 4 pi.
    """

    name: ClassVar[str]
    #: whether it is 1 in all directions, so that integrands can leave it out
    is_constant: ClassVar[bool] = False

    def __call__(self, cos_scatter: ArrayLike) -> Array:
        """Evaluate at cosines of the scattering angle [1], any shape; the
        result has the same shape.
        """
        c = np.asarray(cos_scatter, dtype=np.float64)
        return self.from_half(0.5 - 0.5 * c, 0.5 + 0.5 * c)

    def from_half(self, down: Array, up: Array) -> Array:
        """Evaluate from `down`, sin^2, and `up`, cos^2 of half the scattering angle
        [1], arrays of one shape.

        Where both are known without cancellation, the value has none either.
        """
        return self._value(down, up)

    def _value(self, down: Array, up: Array) -> Array:
        """Return what `from_half` returns."""
        raise NotImplementedError

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine, `cos_scatter`, in mpmath at its current precision
        [1]; parameters are exact.
        """
        raise NotImplementedError

    def series(self, degree: int) -> list[float] | None:
        """Return the coefficients of p(-sin theta) in powers of theta up to a degree;
        None where there are none.

        With c = -sin theta the lobes are powers of U = (1 + c)/2 (hazy 8, murky 32) and of 1 +
        g^2 - 2 g c (Henyey-Greenstein, -3/2), by the recurrence of J. C. P. Miller (Knuth,
        Seminumerical Algorithms, 4.7): U P' = n U' P for P = U^n, any real n, so k U_0 P_k =
        sum_{i=1}^{k} (n i - (k - i)) U_i P_{k-i}. U_0 = 1/2 and 1 + g^2 are never zero.
        """
        return None

    @property
    def kinks(self) -> Array:
        """Cosines strictly between -1 and 1 at which the slope jumps, in
        increasing order; empty if smooth.
        """
        return np.empty(0)


@dataclass(frozen=True)
class Isotropic(PhaseFunction):
    """The same in all directions."""

    name = "isotropic"
    is_constant = True

    def _value(self, down: Array, up: Array) -> Array:
        return np.ones_like(up)

    def mp(self, cos_scatter: Any) -> Any:
        """Return 1."""
        return mpf(1)

    def series(self, degree: int) -> list[float]:
        """Return 1, 0, 0, .."""
        return _scaled_plus([0.0] * (degree + 1), 0.0, 1.0)


@dataclass(frozen=True)
class Rayleigh(PhaseFunction):
    """3 (1 + c^2)/4."""

    name = "rayleigh"

    def _value(self, down: Array, up: Array) -> Array:
        return 0.75 + 0.75 * np.square(up - down)

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        c = mpf(cos_scatter)
        return mpf(3) / 4 * (1 + c * c)

    def series(self, degree: int) -> list[float]:
        """Return the coefficients of 3 (1 + sin^2)/4."""
        cosine = _cosine(degree)
        return _scaled_plus(_product(cosine, cosine), 0.75, 0.75)


class _Power(PhaseFunction):
    """A constant and a power of (1 + c)/2, divided by their mean 1 + weight/(power + 1)."""

    squarings: ClassVar[int]  #: of (1 + c)/2, whose power is 2^squarings
    weight: ClassVar[int]  #: of the power

    @property
    def _ends(self) -> tuple[int, int]:
        """The numerator and the denominator of the mean."""
        # The mean of up^n is 1/(n + 1), n = 2^squarings; the mean of the sum is 1 + weight/(n + 1).
        below = 2**self.squarings + 1
        return below + self.weight, below

    def _value(self, down: Array, up: Array) -> Array:
        above, below = self._ends
        # Squaring up again and again gives up^(2^squarings) without a logarithm.
        for _ in range(self.squarings):
            up = np.square(up)
        return (1 + self.weight * up) / (above / below)

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        above, below = self._ends
        return (1 + self.weight * ((1 + mpf(cos_scatter)) / 2) ** 2**self.squarings) * below / above

    def series(self, degree: int) -> list[float]:
        """Return the coefficients, from the series of the power of (1 - sin)/2."""
        above, below = self._ends
        lobe = _power_series(_scaled_plus(_cosine(degree), 0.5, 0.5), 2**self.squarings)
        return _scaled_plus(lobe, self.weight * below / above, below / above)


@dataclass(frozen=True)
class Hazy(_Power):
    """(1 + 9 up^8)/2."""

    name = "hazy"
    squarings, weight = 3, 9


@dataclass(frozen=True)
class Murky(_Power):
    """(1 + 50 up^32) 33/83."""

    name = "murky"
    squarings, weight = 5, 50


@dataclass(frozen=True)
class HenyeyGreenstein(PhaseFunction):
    """(1 - g^2) / (1 + g^2 - 2 g c)^(3/2).

    Raises
    ------
    InputError
        For a g out of range.
    """

    g: float  #: mean cosine [1], in (-1, 1)

    name = "hg"

    def __post_init__(self) -> None:
        if not isinstance(self.g, (int, float, np.floating)) or not -1 < self.g < 1:
            raise InputError(
                f"g is {self.g}; expected a number between -1 and 1, both excluded: give the mean "
                "cosine"
            )

    def _value(self, down: Array, up: Array) -> Array:
        g = self.g
        # 1 + g^2 - 2 g c as a sum of two terms that are both positive.
        base = (1 - g) ** 2 + 4 * g * down if g >= 0 else (1 + g) ** 2 - 4 * g * up
        return (1 - g) * (1 + g) / (base * np.sqrt(base))

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        g = mpf(self.g)
        return (1 - g * g) / (1 + g * g - 2 * g * mpf(cos_scatter)) ** mpf("1.5")

    def series(self, degree: int) -> list[float]:
        """Return the coefficients by Miller's recurrence."""
        g = self.g
        base = _scaled_plus(_cosine(degree), -2 * g, 1 + g * g)
        return [(1 - g * g) * p for p in _power_series(base, -1.5)]


@dataclass(frozen=True)
class CornetteShanks(PhaseFunction):
    """That of Henyey and Greenstein times 1 + c^2, divided by the mean 2 (2 + g^2)/3.

    Raises
    ------
    InputError
        For a g out of range.
    """

    g: float  #: of Henyey and Greenstein's function [1], in (-1, 1)

    name = "cornette-shanks"

    @cached_property
    def _lobe(self) -> HenyeyGreenstein:
        return HenyeyGreenstein(self.g)

    def __post_init__(self) -> None:
        _ = self._lobe  # refuses a g out of range

    def _value(self, down: Array, up: Array) -> Array:
        # The mean of c^2 over the lobe is (1 + 2 g^2)/3; up - down is c.
        rise = 1 + np.square(up - down)
        return self._lobe.from_half(down, up) * rise * (1.5 / (2 + self.g**2))

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        c, g = mpf(cos_scatter), mpf(self.g)
        return self._lobe.mp(c) * (1 + c * c) * 3 / (2 * (2 + g * g))

    def series(self, degree: int) -> list[float]:
        """Return the coefficients: those of the lobe times 1 + sin^2."""
        cosine, scale = _cosine(degree), 1.5 / (2 + self.g**2)
        rise = _scaled_plus(_product(cosine, cosine), scale, scale)
        return _product(self._lobe.series(degree), rise)


@dataclass(frozen=True)
class Tabulated(PhaseFunction):
    """Linear between values at regularly spaced cosines.

    Raises
    ------
    InputError
        For fewer than two values, negative or infinite ones, or none above 0.
    """

    #: from cosine -1 (backward) to +1 (forward), in any unit: they are divided by their mean
    table: Sequence[float]

    name = "tabulated"

    def __post_init__(self) -> None:
        object.__setattr__(self, "table", _checked_table(self.table))

    def _value(self, down: Array, up: Array) -> Array:
        values = np.asarray(self.table)
        # `up` is (1 + c)/2, so that the regular cosines are regular in it.
        return np.interp(up, np.linspace(0.0, 1.0, len(values)), values / _table_mean(values))

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        values = [mpf(v) for v in self.table]
        cells = len(values) - 1
        # The trapezoid rule, which is exact for a function that is linear between its values.
        mean = (mp.fsum(values) - (values[0] + values[cells]) / 2) / cells
        position = (1 + mpf(cos_scatter)) / 2 * cells
        # The cell that holds the cosine; c = 1 belongs to the last one.
        cell = min(max(int(mp.floor(position)), 0), cells - 1)
        fraction = position - cell
        return (values[cell] * (1 - fraction) + values[cell + 1] * fraction) / mean

    @property
    def kinks(self) -> Array:
        """The cosines of all values but the ends."""
        return np.linspace(-1.0, 1.0, len(self.table))[1:-1]


@dataclass(frozen=True)
class HgDraine(PhaseFunction):
    """The fit of Jendersie and d'Eon 2023 to droplets of a diameter.

    Raises
    ------
    InputError
        For a diameter that the fit does not hold for.
    """

    diameter: float = 12.0  #: [um], 5 to 50

    name = "hg-draine"

    def __post_init__(self) -> None:
        if not 5 <= self.diameter <= 50:
            raise InputError(
                f"the diameter of 'hg-draine' is {self.diameter} um; expected 5 to 50 um, where "
                "the fit holds"
            )

    @property
    def g_hg(self) -> float:
        """The mean cosine of the first lobe [1]."""
        return math.exp(-0.0990567 / (self.diameter - 1.67154))

    @property
    def g_d(self) -> float:
        """The g of Draine's function [1]."""
        return math.exp(-2.20679 / (self.diameter + 3.91029) - 0.428934)

    @property
    def alpha(self) -> float:
        """The weight of c^2 in Draine's function [1]."""
        return math.exp(3.62489 - 8.29288 / (self.diameter + 5.52825))

    @property
    def weight(self) -> float:
        """The fraction of Draine's function [1]."""
        return math.exp(-0.599085 / (self.diameter - 0.641583) - 0.665888)

    @property
    def norm(self) -> float:
        """The mean of 1 + alpha c^2 over the second lobe [1]."""
        return 1 + self.alpha * (1 + 2 * self.g_d**2) / 3

    @property
    def _lobes(self) -> tuple[HenyeyGreenstein, HenyeyGreenstein]:
        return HenyeyGreenstein(self.g_hg), HenyeyGreenstein(self.g_d)

    def _value(self, down: Array, up: Array) -> Array:
        first, second = (lobe.from_half(down, up) for lobe in self._lobes)
        # up - down is c.
        rise = 1 + self.alpha * np.square(up - down)
        return (1 - self.weight) * first + self.weight * second * rise / self.norm

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        c = mpf(cos_scatter)
        first, second = (lobe.mp(c) for lobe in self._lobes)
        alpha, weight = mpf(self.alpha), mpf(self.weight)
        # The fits are taken in float64; from them on all is exact to mpmath's precision.
        norm = 1 + alpha * (1 + 2 * mpf(self.g_d) ** 2) / 3
        return (1 - weight) * first + weight * second * (1 + alpha * c * c) / norm

    def series(self, degree: int) -> list[float]:
        """Return the coefficients of both lobes, the second times 1 + alpha sin^2."""
        first, second = (lobe.series(degree) for lobe in self._lobes)
        cosine = _cosine(degree)
        # c^2 = sin^2 theta in the second lobe's factor (1 + alpha c^2)/norm.
        rise = _scaled_plus(_product(cosine, cosine), self.alpha / self.norm, 1 / self.norm)
        draine = _product(second, rise)
        return [(1 - self.weight) * a + self.weight * b for a, b in zip(first, draine)]


@dataclass(frozen=True)
class Mie(PhaseFunction):
    """Water droplets.

    Raises
    ------
    InputError
        For a wavelength without a refractive index.
    """

    droplets: Droplets = field(default_factory=Droplets)  #: their sizes
    wavelength: float = 0.55  #: [um]

    name = "mie"

    def __post_init__(self) -> None:
        if self.wavelength not in WATER:
            wavelengths = ", ".join(f"{each:g}" for each in WATER)
            raise InputError(
                f"the wavelength of '{self.name}' is {self.wavelength} um; expected one of "
                f"{wavelengths} um"
            )

    @property
    def _optics(self) -> Optics:
        """The optics of the droplets, computed once for each kind."""
        return optics(self.droplets, self.wavelength)

    def _value(self, down: Array, up: Array) -> Array:
        return self._optics.from_half(down, up)

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate the Legendre series, whose moments count as exact, at one cosine in mpmath."""
        c = mpf(cos_scatter)
        # P_{-1}, which counts 0 times, and P_0.
        total, lower, legendre = mp.zero, mp.zero, mp.one
        for order, moment in enumerate(self._optics.chi.tolist()):
            total += (2 * order + 1) * mpf(moment) * legendre
            # (l + 1) P_{l+1} = (2 l + 1) c P_l - l P_{l-1}.
            lower, legendre = (
                legendre,
                ((2 * order + 1) * c * legendre - order * lower) / (order + 1),
            )
        return total


@dataclass(frozen=True)
class MieModified(Mie):
    """Water droplets without the forward peak, divided by the fraction of the rest."""

    name = "mie-modified"

    def _value(self, down: Array, up: Array) -> Array:
        return Modified(self._optics).from_half(down, up)

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine in mpmath."""
        c = mpf(cos_scatter)
        # Forward of the edge of the peak the function is 0; the rest is scaled to the mean 1.
        if c > self.kinks[0]:
            return mp.zero
        return super().mp(c) / (1 - mpf(Modified(self._optics).removed))

    @property
    def kinks(self) -> Array:
        """The cosine of the edge of the peak."""
        return np.cos(np.deg2rad([Modified.angle]))


#: Makes a phase function from the numbers behind its name, by the name, and how
#: many numbers there may be.
_NUMBERS: dict[str, tuple[Callable[..., PhaseFunction], int]] = {
    "isotropic": (Isotropic, 0),
    "rayleigh": (Rayleigh, 0),
    "hazy": (Hazy, 0),
    "murky": (Murky, 0),
    "hg": (HenyeyGreenstein, 1),
    "cornette-shanks": (lambda g=0.0: CornetteShanks(g), 1),
    "tabulated": (Tabulated, 0),
    "hg-draine": (HgDraine, 1),
    "mie": (lambda *numbers: Mie(*_droplets(*numbers)), 3),
    "mie-modified": (lambda *numbers: MieModified(*_droplets(*numbers)), 3),
}


def _droplets(
    radius: float = 6.0, gamma: float = 2.0, wavelength: float = 0.55
) -> tuple[Droplets, float]:
    return Droplets(radius, gamma), wavelength


def phase_from_words(
    words: str, *, g: float = 0.0, table: Sequence[float] | None = None
) -> PhaseFunction:
    """Return a phase function by words such as 'hg', 'hg-draine:12' and 'mie:6:2:0.55'.

    `words`: a name, then by colons for 'hg' g, for 'hg-draine' the diameter [um], for 'mie' and
    'mie-modified' r_e [um], gamma and the wavelength [um]; missing numbers have defaults; `g`:
    of 'hg' where the words do not say it; `table`: of 'tabulated', see `Tabulated`. Raises
    InputError for an unknown name, numbers that are none or too many of them, those out of range,
    and 'tabulated' without a table.
    """
    # A name, and numbers behind it, parted by colons.
    name, *cells = words.strip().lower().split(":")
    if name not in _NUMBERS:
        near = nearest(name, _NUMBERS) or "."
        raise InputError(
            f"no phase function is called '{name}'{near} Use one of {', '.join(_NUMBERS)}"
        )
    # A name says how many numbers it takes: too many of them and words that are no numbers have a
    # message each.
    make, most = _NUMBERS[name]
    if len(cells) > most:
        raise InputError(
            f"the phase function is '{words}'; expected at most {most} numbers after '{name}'"
        )
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        raise InputError(
            f"the phase function is '{words}'; expected numbers after '{name}', parted by colons"
        ) from None
    # A table has too many values for words: it comes by itself.
    if name == "tabulated":
        if table is None:
            raise InputError(
                "the phase function 'tabulated' came without a table; give one, or use another name"
            )
        return Tabulated(table)
    # A scene may have g as a number of its own; words that say it have precedence.
    if name == "hg" and not numbers:
        return HenyeyGreenstein(g)
    return make(*numbers)


def _cosine(degree: int) -> list[float]:
    """Return the series of c = -sin theta: 0, -1, 0, 1/3!, 0, -1/5!, .."""
    return [
        0.0 if k % 2 == 0 else (-1.0) ** ((k + 1) // 2) / math.factorial(k)
        for k in range(degree + 1)
    ]


def _product(first: list[float], second: list[float]) -> list[float]:
    """Return the series of a product, up to the degree of both."""
    return [math.fsum(first[i] * second[k - i] for i in range(k + 1)) for k in range(len(first))]


def _power_series(u: list[float], n: float) -> list[float]:
    """Return the series of U^n by Miller's recurrence."""
    # k U_0 P_k = sum_{i=1}^{k} (n i - (k - i)) U_i P_{k-i}, from P_0 = U_0^n on.
    p = [u[0] ** n]
    for k in range(1, len(u)):
        p.append(
            math.fsum((n * i - (k - i)) * u[i] * p[k - i] for i in range(1, k + 1)) / (k * u[0])
        )
    return p


def _scaled_plus(series: list[float], factor: float, constant: float) -> list[float]:
    """Return factor times a series plus a constant."""
    return [factor * value + (constant if k == 0 else 0.0) for k, value in enumerate(series)]


def _table_mean(values: Array) -> float:
    # The trapezoid rule over equal steps: the values at both ends count half.
    return float((values.sum() - 0.5 * (values[0] + values[-1])) / (len(values) - 1))


def _checked_table(table: Sequence[float]) -> tuple[float, ...]:
    try:
        values = tuple(float(v) for v in table)
    except (TypeError, ValueError):
        raise InputError(
            f"the table of a phase function is {table!r}; expected a list of numbers"
        ) from None
    # One value has no interval over which to be linear.
    if len(values) < 2:
        raise InputError(
            f"the table of a phase function has {len(values)} value; expected at least 2, from -1 "
            "to +1"
        )

    for index, value in enumerate(values):
        if not (math.isfinite(value) and value >= 0):
            raise InputError(
                f"value {index} of the phase function's table is {value}; expected finite values "
                ">= 0"
            )
    # Values are divided by their mean.
    if _table_mean(np.asarray(values)) <= 0:
        raise InputError(
            "all values of the phase function's table are 0; expected at least one above 0"
        )
    return values
