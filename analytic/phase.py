# SPDX-License-Identifier: BSD-3-Clause
"""Phase functions, normalised so that their mean over the sphere is 1.

The mean over the sphere is (1/2) int_{-1}^{1} p(c) dc, c the cosine of the scattering angle, +1 forward. With

    up = (1 + c)/2 = cos^2(angle/2),    down = (1 - c)/2 = sin^2(angle/2)

the six functions read

    isotropic   1
    rayleigh    3 (1 + c^2)/4
    hazy        (1 + 9 up^8)/2          mean of up^8  = 1/9:   1 + 9/9   = 2      (Biri 2006, annex, after Nishita 1987)
    murky       (1 + 50 up^32) 33/83    mean of up^32 = 1/33:  1 + 50/33 = 83/33  (the same)
    hg          (1 - g^2) / (1 + g^2 - 2 g c)^(3/2)                               (Henyey and Greenstein 1941)
    tabulated   linear between values at regularly spaced c, divided by their mean (the trapezoid rule, exact here)

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

from analytic.errors import InputError

Array = NDArray[np.float64]

#: The names that `PhaseFunction` accepts.
PHASE_NAMES = ("isotropic", "rayleigh", "hazy", "murky", "hg", "tabulated")

_HAZY_MEAN, _MURKY_MEAN = 2.0, 83.0 / 33.0


@dataclass(frozen=True)
class PhaseFunction:
    """A phase function of mean 1 over the sphere; call it with cosines of the scattering angle.

    Parameters
    ----------
    name
        One of `PHASE_NAMES`.
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

    def __post_init__(self):
        if self.name not in PHASE_NAMES:
            raise InputError(unknown_phase(self.name))
        if not isinstance(self.g, (int, float, np.floating)) or not -1 < self.g < 1:
            raise InputError(f"g is {self.g}; wanted a number between -1 and 1, both excluded: give the mean cosine")
        if self.g != 0 and self.name != "hg":
            raise InputError(f"g is {self.g} for the phase function '{self.name}', which has none; use 'hg' or drop g")
        if (self.table is not None) != (self.name == "tabulated"):
            raise InputError(
                f"the phase function '{self.name}' came with{'out' if self.table is None else ''} a table; "
                "give a table for 'tabulated' and for no other"
            )
        if self.table is not None:
            object.__setattr__(self, "table", _checked_table(self.table))

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
        values = [mpf(v) for v in self.table or ()]
        last = len(values) - 1
        mean = (mp.fsum(values) - (values[0] + values[last]) / 2) / last
        position = (1 + c) / 2 * last
        cell = min(max(int(mp.floor(position)), 0), last - 1)
        share = position - cell
        return (values[cell] * (1 - share) + values[cell + 1] * share) / mean

    @property
    def is_constant(self) -> bool:
        """Whether it is 1 in all directions, so that integrands can leave it out."""
        return self.name == "isotropic"

    def series(self, degree: int) -> list[float] | None:
        """Return the coefficients of p(-sin theta) in powers of theta up to a degree; None for one with kinks.

        With c = -sin theta the lobes are powers of U = (1 + c)/2 (hazy 8, murky 32) and of 1 + g^2 - 2 g c
        (Henyey-Greenstein, -3/2), by the recurrence of J. C. P. Miller (Knuth, Seminumerical Algorithms, 4.7): U P' = n
        U' P for P = U^n, any real n, so k U_0 P_k = sum_{i=1}^{k} (n i - (k - i)) U_i P_{k-i}. U_0 = 1/2 and 1 + g^2
        are never zero.
        """
        if self.table is not None:
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
        up = _scaled_plus(c, 0.5, 0.5)
        if self.name == "hazy":
            return _scaled_plus(_power_series(up, 8), 9 / 2, 1 / 2)
        return _scaled_plus(_power_series(up, 32), 50 * 33 / 83, 33 / 83)

    @property
    def kinks(self) -> Array:
        """Cosines strictly between -1 and 1 at which the slope jumps, in increasing order; empty if smooth."""
        if self.table is None:
            return np.empty(0)
        return np.linspace(-1.0, 1.0, len(self.table))[1:-1]


def unknown_phase(name: object) -> str:
    """Say that a phase function is unknown, with the nearest name and all of them."""
    near = difflib.get_close_matches(str(name), PHASE_NAMES, n=1, cutoff=0.3)
    hint = f"did you mean '{near[0]}'? " if near else ""
    return f"no phase function is called '{name}'; {hint}Use one of {', '.join(PHASE_NAMES)}"


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
        raise InputError(f"the table of a phase function is {table!r}; wanted a list of numbers") from None
    if len(values) < 2:
        raise InputError(f"the table of a phase function has {len(values)} value; wanted at least 2, from -1 to +1")
    for index, value in enumerate(values):
        if not (math.isfinite(value) and value >= 0):
            raise InputError(f"value {index} of the phase function's table is {value}; wanted finite values >= 0")
    if _table_mean(np.asarray(values)) <= 0:
        raise InputError("all values of the phase function's table are 0; wanted at least one above 0")
    return values
