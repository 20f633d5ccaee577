# SPDX-License-Identifier: BSD-3-Clause
"""A request for a slab, with its checks."""

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

from airlight.errors import InputError
from airlight.validation.slab.phases import PhasePair, phase_pair

#: The sets of orders of Bouthors 2008, section 5.1; order 1 stands apart.
SETS = ("1", "2", "3-4", "5-6", "7-8", "9-12", "13-18", "19-30", "31-inf")
LARGEST_ORDER = 1000
THICKEST = 1e4
LARGEST_SUN = 89.999999  #: [degrees]; above, the cosine loses its digits


@dataclass(frozen=True)
class SlabRequest:
    """A slab, the sun, and what is wanted of it."""

    tau: float  #: thickness [mean free paths]
    sun: float  #: its zenith angle [degrees]
    phase: PhasePair
    albedo: float
    orders: tuple[str, ...]  #: names of the sets of orders: '3', '3-4', '31-inf', 'all'
    depths: tuple[float, ...]  #: where fluence, flux and radiance are wanted [mean free paths]
    directions: tuple[tuple[float, float], ...]  #: mu, positive upwards, and phi [degrees]

    @property
    def mu0(self) -> float:
        """Cosine of the sun's zenith angle."""
        return math.cos(math.radians(self.sun))

    @property
    def ranges(self) -> list[tuple[int, float]]:
        """First and last order of each set."""
        return [order_range(name) for name in self.orders]


def slab_request(
    tau: float,
    sun: float,
    *,
    phase: str = "isotropic",
    albedo: float = 1.0,
    orders: str | Sequence[str | int] = "sets",
    depths: str | Sequence[float] | None = None,
    directions: str | Sequence[tuple[float, float]] = (),
) -> SlabRequest:
    """Return a request that was checked; words are read as the command takes them."""
    tau, sun, albedo = (
        _number(name, value) for name, value in (("tau", tau), ("sun", sun), ("albedo", albedo))
    )
    thinnest = 1e-6
    if not thinnest <= tau <= THICKEST:
        raise InputError(
            f"tau: got {tau:g}, expected a thickness of {thinnest:g} to {THICKEST:g} mean "
            "free paths"
        )
    if not 0 <= sun <= LARGEST_SUN:
        raise InputError(
            f"sun: got {sun:g}, expected a zenith angle from 0 to below 90 degrees; at 90 no light "
            "enters the slab"
        )
    if not 0 <= albedo <= 1:
        raise InputError(f"albedo: got {albedo:g}, expected a fraction from 0 to 1")
    return SlabRequest(
        tau=tau,
        sun=sun,
        phase=phase_pair(phase),
        albedo=albedo,
        orders=parse_orders(orders),
        depths=_depths(depths, tau),
        directions=_directions(directions),
    )


def order_range(name: str) -> tuple[int, float]:
    """Return first and last order of a set by its name."""
    if name == "all":
        return 1, math.inf
    # '3', '3-4' or '3-inf', with numbers short enough for `int`.
    form = re.fullmatch(r"(\d{1,9})(?:-(\d{1,9}|inf))?", name)
    if form is None:
        raise InputError(
            f"orders: got {name!r}, expected for example 1,2,4,8 or 3-4 or 31-inf, or sets, or all"
        )
    first = int(form[1])
    last = math.inf if form[2] == "inf" else int(form[2] or first)
    if first < 1:
        raise InputError(
            f"orders: got {name!r}, expected orders from 1 on; light of order 0 was never scattered"
        )
    if last < first:
        raise InputError(
            f"orders: got {name!r}, which ends before it begins; write {form[2]}-{first}"
        )
    # A set without an end needs the orders before it one by one; the rest is one sum.
    highest = first - 1 if math.isinf(last) else last
    if highest > LARGEST_ORDER:
        raise InputError(
            f"orders: got {name!r}, expected orders up to {LARGEST_ORDER}, or {LARGEST_ORDER}-inf"
        )
    return first, last


def parse_orders(given: str | Sequence[str | int]) -> tuple[str, ...]:
    """Return the names of sets of orders in the order given, each once;
    'sets' stands for `SETS`.
    """
    words = given.split(",") if isinstance(given, str) else [str(word) for word in given]
    names = [
        name for word in words for name in (SETS if word.strip() == "sets" else (word.strip(),))
    ]
    # Each is checked before anything is computed.
    for name in names:
        order_range(name)
    if not names:
        raise InputError("orders: got none, expected for example 1,2,4,8 or sets or all")
    return tuple(dict.fromkeys(names))


def _depths(given: str | Sequence[float] | None, tau: float) -> tuple[float, ...]:
    # Both faces.
    if given is None:
        return (0.0, tau)
    words = [word for word in given.split(",") if word.strip()] if isinstance(given, str) else given
    depths = tuple(_number("depths", word) for word in words)
    for depth in depths:
        if not 0 <= depth <= tau:
            raise InputError(
                f"depths: got {depth:g}, expected depths of 0 to tau, {tau:g} mean free paths"
            )
    return depths


def _directions(given: str | Sequence[tuple[float, float]]) -> tuple[tuple[float, float], ...]:
    if isinstance(given, str):
        pairs = [tuple(word.split(":")) for word in given.split(",") if word.strip()]
    else:
        pairs = [tuple(map(str, pair)) for pair in given]
    directions = []
    for pair in pairs:
        if len(pair) != 2:
            raise InputError(
                f"directions: got {':'.join(pair)!r}, expected MU:PHI, for example 0.5:180,-1:0"
            )
        mu, phi = (_number("directions", word) for word in pair)
        # Horizontal light never leaves the slab.
        if not 1e-6 <= abs(mu) <= 1:
            raise InputError(
                f"directions: got mu = {mu:g}, expected -1 to 1, positive upwards, and not "
                "horizontal (0): from 1e-6 on"
            )
        directions.append((mu, phi))
    return tuple(directions)


def _number(name: str, word: str | float) -> float:
    try:
        value = float(word)
    except (TypeError, ValueError):
        raise InputError(f"{name}: got {word!r}, expected a number") from None
    if not math.isfinite(value):
        raise InputError(f"{name}: got {value}, expected a finite number")
    return value
