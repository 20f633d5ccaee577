# SPDX-License-Identifier: BSD-3-Clause
"""The design: scene SEED is point SEED of one scrambled Halton sequence, whose beginning covers the ranges evenly.

What a scene has once or may have first (the optical depth, how many lights, the kind of each) is a coordinate of the
point. What it has many of, such as the places of casters, comes from a stream of random numbers that the seed begins.
The scrambling (random permutations of digits, Owen 2017) is the same for all seeds; without it neighbouring
coordinates of such a sequence are correlated.

`ranges.toml` covers the methods' whole field; a file of one's own overrides it. A pair is a range, a table of numbers
are the weights of a choice.
"""

import math
import tomllib
import zlib
from collections.abc import Mapping
from functools import cache, lru_cache
from pathlib import Path
from typing import Any
from urllib.parse import quote, unquote

import numpy as np
from numpy.typing import NDArray
from scipy.stats import qmc

from analytic.errors import InputError, nearest

FILE = Path(__file__).with_name("ranges.toml")  #: of ranges as they are drawn without a file of one's own

Ranges = dict[str, Any]

PREFIX = "random:"
_SAFE = "/:\\"  # what stands in a path as it is, besides letters, digits, '_', '.', '-' and '~'

#: The names of the coordinates of a point.
COORDINATES: tuple[str, ...] = tuple(tomllib.loads(FILE.read_text(encoding="utf-8"))["coordinates"])
_SCRAMBLING = 2417
LARGEST_SEED = 10**9


class Draws:
    """Numbers of a scene: coordinates of its point first, then of its stream."""

    def __init__(self, seed: int, attempt: int = 0, part: str = "") -> None:
        self._seed, self._attempt = seed, attempt
        entropy = [seed, attempt, zlib.crc32(part.encode())]
        self._bits = np.random.PCG64(np.random.SeedSequence(entropy))
        self._point = point(seed) if not part else {}

    def of(self, part: str) -> "Draws":
        """Return the stream of a part of the scene: what one part draws does not move the others."""
        return Draws(self._seed, self._attempt, part)

    def share(self, name: str = "") -> float:
        """Return a number within (0, 1), the coordinate of that name if the point has one."""
        if name in self._point:
            return self._point[name]
        # The highest 53 bits: the stream of raw numbers is what NumPy promises never to change.
        return ((int(self._bits.random_raw()) >> 11) + 0.5) * 2.0**-53

    def between(self, low: float, high: float, *, name: str = "") -> float:
        """Return a number within a range, evenly."""
        return low + (high - low) * self.share(name)

    def logarithmic(self, low: float, high: float, *, name: str = "") -> float:
        """Return a number within a range of positive numbers, evenly in the logarithm."""
        return float(low * math.exp(math.log(high / low) * self.share(name)))

    def count(self, low: float, high: float, *, name: str = "") -> int:
        """Return a whole number from `low` to `high`, evenly in the logarithm."""
        return min(math.floor(self.logarithmic(low + 0.5, high + 1.5, name=name) - 0.5), int(high))

    def few(self, low: float, high: float, *, name: str = "") -> int:
        """Return a whole number from `low` to `high`, of which small ones come more often than by `count`."""
        span = math.log((high + 1.5) / (low + 0.5))
        return min(math.floor((low + 0.5) * math.exp(span * self.share(name) ** 2) - 0.5), int(high))

    def pick(self, weights: Mapping[str, float], name: str = "") -> str:
        """Return one of several words by their weights."""
        left = self.share(name) * sum(weights.values())
        for word, weight in weights.items():
            left -= weight
            if left < 0:
                return word
        return [word for word, weight in weights.items() if weight > 0][-1]

    def vector(self) -> NDArray[np.float64]:
        """Return a unit vector, evenly over the sphere, (3,)."""
        z, angle = self.between(-1, 1), self.between(0, 2 * math.pi)
        across = math.sqrt(1 - z * z)
        return np.array([across * math.cos(angle), across * math.sin(angle), z])

    def in_ball(self) -> NDArray[np.float64]:
        """Return a point within the unit ball, evenly, (3,)."""
        return self.vector() * self.share() ** (1 / 3)


@lru_cache(maxsize=64)
def point(seed: int) -> Mapping[str, float]:
    """Return the coordinates of a seed by name, each within (0, 1)."""
    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(f"random scene: got the seed {seed}, wanted a whole number from 0 to {LARGEST_SEED}")
    sequence = qmc.Halton(len(COORDINATES), scramble=True, rng=np.random.default_rng(_SCRAMBLING))
    sequence.fast_forward(seed)
    values = sequence.random(1)[0]
    return dict(zip(COORDINATES, (float(min(max(value, 1e-9), 1 - 1e-9)) for value in values), strict=True))


@cache
def _defaults() -> tuple[Ranges, Mapping[str, tuple[float, float]]]:
    """Return the ranges as they are drawn without a file, and the limits that they may have."""
    ranges = tomllib.loads(FILE.read_text(encoding="utf-8"))
    del ranges["coordinates"]
    limits = ranges.pop("limits")
    return ranges, limits


def read_ranges(path: Path) -> Ranges:
    """Read ranges from a TOML file, whose folder of meshes lies beside it."""
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"ranges: cannot read {path}: {error}") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"ranges: {path} is no TOML: {error}") from error
    if isinstance(table.get("meshes"), str) and table["meshes"]:
        table["meshes"] = str(path.parent / table["meshes"])
    return ranges_from(table, str(path))


def ranges_from(table: Mapping[str, Any], where: str = "ranges") -> Ranges:
    """Return the usual ranges with what a table says in their place.

    Unknown names, ranges that are empty or beyond what can be drawn, and weights of which none is above 0 are refused.
    """
    usual, limits = _defaults()
    changed: Ranges = {}
    for name, value in table.items():
        if name not in usual:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(usual)}{nearest(name, usual)}")
        if name in limits:
            changed[name] = _checked_range(f"{where}: {name}", value, *limits[name])
        elif name != "meshes":
            changed[name] = _checked_weights(f"{where}: {name}", value, tuple(usual[name]))
        elif not isinstance(value, str) or (value and not Path(value).is_dir()):
            raise InputError(f"{where}: {name} is {value!r}; wanted a folder of .obj and .ply files")
        else:
            changed[name] = value
    return usual | changed


def _checked_range(where: str, value: Any, least: float, most: float) -> tuple[float, float]:
    pair = value if isinstance(value, list | tuple) else [value, value]
    if len(pair) != 2 or not all(_is_number(each) for each in pair) or not least <= pair[0] <= pair[1] <= most:
        raise InputError(f"{where} is {value!r}; wanted [from, to], two numbers from {least:g} to {most:g}")
    return float(pair[0]), float(pair[1])


def _checked_weights(where: str, value: Any, names: tuple[str, ...]) -> dict[str, float]:
    if not isinstance(value, Mapping):
        raise InputError(f"{where} is {value!r}; wanted a table of weights, such as {{ {names[0]} = 1 }}")
    for name, weight in value.items():
        if name not in names:
            raise InputError(f"{where}: got {name!r}, wanted some of {', '.join(names)}{nearest(name, names)}")
        if not _is_number(weight) or weight < 0:
            raise InputError(f"{where}: {name} has the weight {weight!r}; wanted a number of 0 or more")
    if not any(value.values()):
        raise InputError(f"{where}: no weight is above 0; wanted one at least")
    return {name: float(value.get(name, 0.0)) for name in names}


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


# Names --------------------------------------------------------------------------------------------------------------


def is_random(name: str) -> bool:
    """Return whether a name is that of a random scene."""
    return name.startswith(PREFIX)


def random_name(seed: int | str, ranges: Path | None = None) -> str:
    """Return the name of a random scene, which may be drawn from a file of ranges."""
    return f"{PREFIX}{seed}" + (f",ranges={quote(str(ranges.resolve()), safe=_SAFE)}" if ranges else "")


def random_parts(name: str) -> tuple[int, Path | None]:
    """Return the seed in a name, and the file of ranges that it goes on with."""
    seed, comma, option = name.removeprefix(PREFIX).partition(",")
    if not (seed.isascii() and seed.isdecimal()):
        raise InputError(f"scene: got {name!r}, wanted {PREFIX}SEED, a whole number, for example {PREFIX}7")
    key, _, value = option.partition("=")
    if comma and (key != "ranges" or not value or "," in value):
        raise InputError(f"scene: got {option!r} in {name!r}, wanted ranges=FILE.toml after the seed")
    return int(seed), Path(unquote(value)) if comma else None
