# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions, normalised so that their mean over the sphere is 1.

The mean over the sphere is (1/2) int_{-1}^{1} p(c) dc, c the cosine of the scattering angle, +1 forward. With

    up = (1 + c)/2 = cos^2(angle/2),    down = (1 - c)/2 = sin^2(angle/2)

the functions read

    isotropic   1
    rayleigh    3 (1 + c^2)/4
    hazy        (1 + 9 up^8)/2          mean of up^8  = 1/9:   1 + 9/9   = 2      (Biri 2006, annex, after Nishita 1987)
    murky       (1 + 50 up^32) 33/83    mean of up^32 = 1/33:  1 + 50/33 = 83/33  (the same)
    hg          (1 - g^2) / (1 + g^2 - 2 g c)^(3/2)                               (Henyey and Greenstein 1941)
    tabulated   linear between values at regularly spaced c, divided by their mean (the trapezoid rule, exact here)
    hg-draine   (1 - w) hg(g_HG) + w (1 + alpha c^2)/(1 + alpha (1 + 2 g_D^2)/3) hg(g_D)
    mie, mie-modified   water droplets, `analytic.droplets`, at one wavelength

The second term of `hg-draine` is Draine's function (2003, ApJ 598, 1017): the mean of c^2 over an hg is (1 + 2 g^2)/3.
Jendersie and d'Eon (SIGGRAPH 2023 Talks) fitted both terms to fog and clouds, for diameters d of 5 to 50 um:

    g_HG = exp(-0.0990567/(d - 1.67154))            g_D = exp(-2.20679/(d + 3.91029) - 0.428934)
    alpha = exp(3.62489 - 8.29288/(d + 5.52825))    w = exp(-0.599085/(d - 0.641583) - 0.665888)

Everything is evaluated from `up` and `down`, which a caller near the forward or backward direction knows without
cancellation: 1 + g^2 - 2 g c = (1 - g)^2 + 4 g down = (1 + g)^2 - 4 g up, all terms positive in the first for g > 0, in
the second for g < 0.
"""

import difflib
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from mpmath import mp, mpf
from numpy.typing import ArrayLike, NDArray

from airlight.analytic.droplets import WATER, Droplets, Modified, Optics, optics
from airlight.errors import InputError

Array = NDArray[np.float64]

#: The names that `PhaseFunction` accepts.
PHASE_NAMES = ("isotropic", "rayleigh", "hazy", "murky", "hg", "tabulated")
#: Those of droplets, which it accepts too.
DROPLET_NAMES = ("hg-draine", "mie", "mie-modified")

_DROPLETS = ("mie", "mie-modified")  # those with sizes

_HAZY_MEAN, _MURKY_MEAN = 2.0, 83.0 / 33.0


@dataclass(frozen=True)
class PhaseFunction:
    """A phase function of mean 1 over the sphere; call it with cosines of the scattering angle.

    Parameters
    ----------
    name
        One of `PHASE_NAMES` or `DROPLET_NAMES`.
    g
        Mean cosine [1], only for 'hg', in (-1, 1).
    table
        Only for 'tabulated': at least two non-negative values at regularly spaced cosines from -1 (backward) to +1
        (forward), in any unit: they are divided by their mean.

    Raises
    ------
    InputError
        For an unknown name, a `g` or `table` out of range, or one that the named function does not have.

    Notes
    -----
    Valid for -1 <= cosine <= 1. Multiply by 1/(4 pi) for 1/sr.

    The cosine is Mitsuba's too, as evaluated in version 3.9.1: for light that travels along +z (`wi` = -z in its
    interaction record) `eval_pdf` with `wo` = +z gives the largest value of an 'hg' of positive g and the last value of
    a 'tabphase'. Its values are these divided by 4 pi.
    """

    name: str
    g: float = 0.0
    table: Sequence[float] | None = None
    droplets: Droplets | None = None
    wavelength: float = 0.55
    diameter: float | None = None

    def __post_init__(self):
        if self.name not in (*PHASE_NAMES, *DROPLET_NAMES):
            raise InputError(unknown_phase(self.name))
        if not isinstance(self.g, (int, float, np.floating)) or not -1 < self.g < 1:
            raise InputError(f"g is {self.g}; expected a number between -1 and 1, both excluded: give the mean cosine")
        if self.g != 0 and self.name != "hg":
            raise InputError(f"g is {self.g} for the phase function '{self.name}', which has none; use 'hg' or drop g")
        if (self.table is not None) != (self.name == "tabulated"):
            raise InputError(
                f"the phase function '{self.name}' came with{'out' if self.table is None else ''} a table; "
                "give a table for 'tabulated' and for no other"
            )
        if self.table is not None:
            object.__setattr__(self, "table", _checked_table(self.table))
        self._check_droplets()

    def _check_droplets(self):
        """Fill in the droplets of the functions that have some, refuse them for others."""
        if self.droplets is not None and self.name not in _DROPLETS:
            raise InputError(f"the phase function '{self.name}' came with droplets; give them for 'mie' and no other")
        if self.diameter is not None and self.name != "hg-draine":
            raise InputError(
                f"the phase function '{self.name}' came with a diameter; give it for 'hg-draine' and no other"
            )
        if self.name in _DROPLETS:
            if self.wavelength not in WATER:
                known = ", ".join(f"{each:g}" for each in WATER)
                raise InputError(f"the wavelength of '{self.name}' is {self.wavelength} um; expected one of {known} um")
            object.__setattr__(self, "droplets", self.droplets or Droplets())
        if self.name == "hg-draine":
            diameter = 12.0 if self.diameter is None else self.diameter
            if not 5 <= diameter <= 50:
                raise InputError(
                    f"the diameter of 'hg-draine' is {diameter} um; expected 5 to 50 um, where the fit holds"
                )
            object.__setattr__(self, "diameter", diameter)

    @property
    def _draine(self) -> "HgDraine":
        """The fit for the diameter, which 'hg-draine' always has."""
        assert self.diameter is not None
        return hg_draine_fit(self.diameter)

    def __call__(self, cos_scatter: ArrayLike) -> Array:
        """Evaluate at cosines of the scattering angle [1], any shape; the result has the same shape."""
        c = np.asarray(cos_scatter, dtype=np.float64)
        return self.from_half(0.5 - 0.5 * c, 0.5 + 0.5 * c)

    def from_half(self, down: Array, up: Array) -> Array:
        """Evaluate from `down`, sin^2, and `up`, cos^2 of half the scattering angle [1], arrays of one shape.

        Where both are known without cancellation, the value has none either.
        """
        if self.name == "isotropic":
            return np.ones_like(up)
        if self.name == "rayleigh":
            return 0.75 + 0.75 * np.square(up - down)
        if self.name == "hazy":
            return (1 + 9 * _power_of_two(up, 3)) / _HAZY_MEAN
        if self.name == "murky":
            return (1 + 50 * _power_of_two(up, 5)) / _MURKY_MEAN
        if self.name == "hg":
            g = self.g
            base = (1 - g) ** 2 + 4 * g * down if g >= 0 else (1 + g) ** 2 - 4 * g * up
            return (1 - g) * (1 + g) / (base * np.sqrt(base))
        if self.name == "hg-draine":
            fit = self._draine
            first, second = (PhaseFunction("hg", g=g).from_half(down, up) for g in (fit.g_hg, fit.g_d))
            return (1 - fit.weight) * first + fit.weight * second * (1 + fit.alpha * np.square(up - down)) / fit.norm
        if self.name in _DROPLETS:
            return self._scattering.from_half(down, up)
        values = np.asarray(self.table)
        scaled = values / _table_mean(values)
        return np.interp(up, np.linspace(0.0, 1.0, len(values)), scaled)

    def mp(self, cos_scatter: Any) -> Any:
        """Evaluate one cosine, `cos_scatter`, in mpmath at its current precision [1]; g and table are exact."""
        c = mpf(cos_scatter)
        if self.name == "isotropic":
            return mpf(1)
        if self.name == "rayleigh":
            return mpf(3) / 4 * (1 + c * c)
        if self.name == "hazy":
            return (1 + 9 * ((1 + c) / 2) ** 8) / 2
        if self.name == "murky":
            return (1 + 50 * ((1 + c) / 2) ** 32) * 33 / 83
        if self.name == "hg":
            g = mpf(self.g)
            return (1 - g * g) / (1 + g * g - 2 * g * c) ** mpf("1.5")
        if self.name == "hg-draine":
            fit = self._draine
            first, second = (PhaseFunction("hg", g=g).mp(c) for g in (fit.g_hg, fit.g_d))
            alpha, weight = mpf(fit.alpha), mpf(fit.weight)
            norm = 1 + alpha * (1 + 2 * mpf(fit.g_d) ** 2) / 3
            return (1 - weight) * first + weight * second * (1 + alpha * c * c) / norm
        if self.name in _DROPLETS:
            return self._mp_droplets(c)
        values = [mpf(v) for v in self.table or ()]
        last = len(values) - 1
        mean = (mp.fsum(values) - (values[0] + values[last]) / 2) / last
        position = (1 + c) / 2 * last
        cell = min(max(int(mp.floor(position)), 0), last - 1)
        fraction = position - cell
        return (values[cell] * (1 - fraction) + values[cell + 1] * fraction) / mean

    @property
    def _scattering(self) -> Optics | Modified:
        """The optics of the droplets; computed once for each kind."""
        full = optics(self.droplets, self.wavelength)
        return full if self.name == "mie" else Modified(full)

    def _mp_droplets(self, c: Any) -> Any:
        """Evaluate the Legendre series of droplets, whose moments count as exact."""
        scattering = self._scattering
        if isinstance(scattering, Modified):
            if c > self.kinks[0]:
                return mp.zero
            return PhaseFunction("mie", droplets=self.droplets, wavelength=self.wavelength).mp(c) / (
                1 - mpf(scattering.removed)
            )
        total, before, last = mp.zero, mp.zero, mp.one
        for order, moment in enumerate(scattering.chi.tolist()):
            total += (2 * order + 1) * mpf(moment) * last
            before, last = last, ((2 * order + 1) * c * last - order * before) / (order + 1)
        return total

    @property
    def is_constant(self) -> bool:
        """Whether it is 1 in all directions, so that integrands can leave it out."""
        return self.name == "isotropic"

    def series(self, degree: int) -> list[float] | None:
        """Return the coefficients of p(-sin theta) in powers of theta up to a degree; None for a table or droplets.

        With c = -sin theta the lobes are powers of U = (1 + c)/2 (hazy 8, murky 32) and of 1 + g^2 - 2 g c
        (Henyey-Greenstein, -3/2), by the recurrence of J. C. P. Miller (Knuth, Seminumerical Algorithms, 4.7): U P' = n
        U' P for P = U^n, any real n, so k U_0 P_k = sum_{i=1}^{k} (n i - (k - i)) U_i P_{k-i}. U_0 = 1/2 and 1 + g^2
        are never zero.
        """
        if self.table is not None or self.name in _DROPLETS:
            return None
        # c = -sin theta: 0, -1, 0, 1/3!, 0, -1/5!, ...
        c = [0.0 if k % 2 == 0 else (-1.0) ** ((k + 1) // 2) / math.factorial(k) for k in range(degree + 1)]
        if self.is_constant:
            return _scaled_plus([0.0] * (degree + 1), 0.0, 1.0)
        if self.name == "rayleigh":
            square = [math.fsum(c[i] * c[k - i] for i in range(k + 1)) for k in range(degree + 1)]
            return _scaled_plus(square, 0.75, 0.75)
        if self.name == "hg":
            g = self.g
            return [(1 - g * g) * p for p in _power_series(_scaled_plus(c, -2 * g, 1 + g * g), -1.5)]
        if self.name == "hg-draine":
            fit = self._draine
            first, second = (PhaseFunction("hg", g=g).series(degree) or [] for g in (fit.g_hg, fit.g_d))
            square = [math.fsum(c[i] * c[k - i] for i in range(k + 1)) for k in range(degree + 1)]
            rise = _scaled_plus(square, fit.alpha / fit.norm, 1 / fit.norm)
            draine = [math.fsum(second[i] * rise[k - i] for i in range(k + 1)) for k in range(degree + 1)]
            return [(1 - fit.weight) * a + fit.weight * b for a, b in zip(first, draine)]
        up = _scaled_plus(c, 0.5, 0.5)
        if self.name == "hazy":
            return _scaled_plus(_power_series(up, 8), 9 / 2, 1 / 2)
        return _scaled_plus(_power_series(up, 32), 50 * 33 / 83, 33 / 83)

    @property
    def kinks(self) -> Array:
        """Cosines strictly between -1 and 1 at which the slope jumps, in increasing order; empty if smooth."""
        if self.name == "mie-modified":
            return np.cos(np.deg2rad([Modified.angle]))
        if self.table is None:
            return np.empty(0)
        return np.linspace(-1.0, 1.0, len(self.table))[1:-1]


@dataclass(frozen=True)
class HgDraine:
    """The constants of 'hg-draine' [1]."""

    g_hg: float
    g_d: float
    alpha: float
    weight: float

    @property
    def norm(self) -> float:
        """Return the mean of 1 + alpha c^2 over the second lobe [1]."""
        return 1 + self.alpha * (1 + 2 * self.g_d**2) / 3


def hg_draine_fit(diameter: float) -> HgDraine:
    """Return the fit of Jendersie and d'Eon 2023 for a diameter of droplets [um], 5 to 50."""
    return HgDraine(
        math.exp(-0.0990567 / (diameter - 1.67154)),
        math.exp(-2.20679 / (diameter + 3.91029) - 0.428934),
        math.exp(3.62489 - 8.29288 / (diameter + 5.52825)),
        math.exp(-0.599085 / (diameter - 0.641583) - 0.665888),
    )


def phase_from_words(words: str, *, g: float = 0.0) -> PhaseFunction:
    """Return a phase function by words such as 'hg', 'hg-draine:12' and 'mie:6:2:0.55'.

    `words`: a name of `PHASE_NAMES` or `DROPLET_NAMES`, then by colons for 'hg' g, for 'hg-draine' the diameter [um],
    for 'mie' and 'mie-modified' r_e [um], gamma and the wavelength [um]; what is left out has its default; `g`: of 'hg'
    where the words do not say it. Raises InputError for an unknown name, numbers that are none or too many of them, and
    those out of range.
    """
    name, *cells = words.strip().lower().split(":")
    most = {"hg": 1, "hg-draine": 1} | dict.fromkeys(_DROPLETS, 3)
    if name not in (*PHASE_NAMES, *DROPLET_NAMES):
        raise InputError(unknown_phase(name))
    if len(cells) > most.get(name, 0):
        raise InputError(
            f"the phase function is '{words}'; expected at most {most.get(name, 0)} numbers after '{name}'"
        )
    try:
        numbers = [float(cell) for cell in cells]
    except ValueError:
        raise InputError(
            f"the phase function is '{words}'; expected numbers after '{name}', parted by colons"
        ) from None
    if name == "hg":
        return PhaseFunction(name, g=numbers[0] if numbers else g)
    if name == "hg-draine":
        return PhaseFunction(name, diameter=numbers[0] if numbers else None)
    if name in _DROPLETS:
        radius, gamma, wavelength = numbers + [6.0, 2.0, 0.55][len(numbers) :]
        return PhaseFunction(name, droplets=Droplets(radius, gamma), wavelength=wavelength)
    return PhaseFunction(name)


def unknown_phase(name: object) -> str:
    """Say that a phase function is unknown, with the nearest name and all of them."""
    known = (*PHASE_NAMES, *DROPLET_NAMES)
    near = difflib.get_close_matches(str(name), known, n=1, cutoff=0.3)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return f"no phase function is called '{name}'; {hint}Use one of {', '.join(known)}"


def _power_series(u: list[float], n: float) -> list[float]:
    """Return the series of U^n by Miller's recurrence."""
    p = [u[0] ** n]
    for k in range(1, len(u)):
        p.append(math.fsum((n * i - (k - i)) * u[i] * p[k - i] for i in range(1, k + 1)) / (k * u[0]))
    return p


def _scaled_plus(series: list[float], factor: float, constant: float) -> list[float]:
    """Return factor times a series plus a constant."""
    return [factor * value + (constant if k == 0 else 0.0) for k, value in enumerate(series)]


def _power_of_two(base: Array, squarings: int) -> Array:
    for _ in range(squarings):
        base = np.square(base)
    return base


def _table_mean(values: Array) -> float:
    return float((values.sum() - 0.5 * (values[0] + values[-1])) / (len(values) - 1))


def _checked_table(table: Sequence[float]) -> tuple[float, ...]:
    try:
        values = tuple(float(v) for v in table)
    except (TypeError, ValueError):
        raise InputError(f"the table of a phase function is {table!r}; expected a list of numbers") from None
    if len(values) < 2:
        raise InputError(f"the table of a phase function has {len(values)} value; expected at least 2, from -1 to +1")
    for index, value in enumerate(values):
        if not (math.isfinite(value) and value >= 0):
            raise InputError(f"value {index} of the phase function's table is {value}; expected finite values >= 0")
    if _table_mean(np.asarray(values)) <= 0:
        raise InputError("all values of the phase function's table are 0; expected at least one above 0")
    return values
