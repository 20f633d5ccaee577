# SPDX-License-Identifier: BSD-3-Clause
"""The design: scene SEED is point SEED of one scrambled Halton sequence, whose beginning
covers the ranges evenly.

Scene-wide choices (the optical depth, how many lights, the kind of each) are coordinates of the
point. Repeated choices, such as the places of occluders, come from a random generator that is
seeded with SEED. The scrambling (random permutations of digits, Owen 2017) is the same for all
seeds; without it neighbouring coordinates of such a sequence are correlated.

`ranges.toml` covers the methods' whole field; a user's file overrides it. A pair is a range, a
table of numbers are the weights of a choice.
"""

import math
import tomllib
import zlib
from collections.abc import Mapping
from functools import cache, lru_cache, partial
from pathlib import Path
from typing import Any

import numpy as np

from airlight.errors import InputError
from airlight.validation.arrays import Array
from airlight.validation.readers import Reader, read_named, read_number, read_table, read_toml

#: The ranges that are drawn from where a user gives no file.
FILE = Path(__file__).with_name("ranges.toml")

#: The distributions of a random scene by name, as a file has them: of a range its two ends; of a
#: choice the weights by word; `meshes` is a folder, or empty.
Ranges = dict[str, Any]

#: The names of the coordinates of a point.
COORDINATES: tuple[str, ...] = tuple(tomllib.loads(FILE.read_text(encoding="utf-8"))["coordinates"])

LARGEST_SEED = 10**9


class Draws:
    """Numbers of a scene: coordinates of its point first, then of its stream."""

    def __init__(self, seed: int, attempt: int = 0, part: str = "") -> None:
        self._seed, self._attempt = seed, attempt
        # The name of a part is hashed by CRC-32, which is the same on all machines and in all
        # versions of Python.
        entropy = [seed, attempt, zlib.crc32(part.encode())]
        self._bits = np.random.PCG64(np.random.SeedSequence(entropy))
        self._point = point(seed) if not part else {}

    def of(self, part: str) -> "Draws":
        """Return the stream of a part of the scene: the draws of one part do not move the others.

        The name of the part is a seed: with another name, old seeds would be other scenes.
        """
        return Draws(self._seed, self._attempt, part)

    def fraction(self, name: str = "") -> float:
        """Return a number within (0, 1), the coordinate of that name if the point has one."""
        if name in self._point:
            return self._point[name]
        # The highest 53 bits: the stream of raw numbers is what NumPy promises never to change.
        return ((int(self._bits.random_raw()) >> 11) + 0.5) * 2.0**-53

    def between(self, low: float, high: float, *, name: str = "") -> float:
        """Return a number within a range, evenly."""
        return low + (high - low) * self.fraction(name)

    def logarithmic(self, low: float, high: float, *, name: str = "") -> float:
        """Return a number within a range of positive numbers, evenly in the logarithm."""
        return float(low * math.exp(math.log(high / low) * self.fraction(name)))

    def count(self, low: float, high: float, *, name: str = "") -> int:
        """Return a whole number from `low` to `high`, evenly in the logarithm."""
        return min(math.floor(self.logarithmic(low + 0.5, high + 1.5, name=name) - 0.5), int(high))

    def few(self, low: float, high: float, *, name: str = "") -> int:
        """Return a whole number from `low` to `high`; small ones are likelier than by `count`."""
        # Evenly in the logarithm of the number would be `count`; the square of the fraction favours
        # small numbers.
        span = math.log((high + 1.5) / (low + 0.5))
        return min(
            math.floor((low + 0.5) * math.exp(span * self.fraction(name) ** 2) - 0.5), int(high)
        )

    def pick(self, weights: Mapping[str, float], name: str = "") -> str:
        """Return one of several words by their weights."""
        remainder = self.fraction(name) * sum(weights.values())
        for word, weight in weights.items():
            remainder -= weight
            if remainder < 0:
                return word
        # Rounding may leave a remainder of 0 after the last weight.
        return [word for word, weight in weights.items() if weight > 0][-1]

    def vector(self) -> Array:
        """Return a unit vector, evenly over the sphere, (3,)."""
        z, angle = self.between(-1, 1), self.between(0, 2 * math.pi)
        across = math.sqrt(1 - z * z)
        return np.array([across * math.cos(angle), across * math.sin(angle), z])

    def in_ball(self) -> Array:
        """Return a point within the unit ball, evenly, (3,)."""
        return self.vector() * self.fraction() ** (1 / 3)


@lru_cache(maxsize=64)
def point(seed: int) -> Mapping[str, float]:
    """Return the coordinates of a seed by name, each within (0, 1)."""
    from scipy.stats import qmc

    if not 0 <= seed <= LARGEST_SEED:
        raise InputError(
            f"random scene: got the seed {seed}, expected a whole number from 0 to {LARGEST_SEED}"
        )
    # Always the same scrambled sequence: a seed is the number of a point in it.
    scrambling = np.random.default_rng(2417)
    sequence = qmc.Halton(len(COORDINATES), scramble=True, rng=scrambling)
    # Each point follows from its number alone; `fast_forward` draws all points before it.
    sequence.num_generated = seed
    values = sequence.random(1)[0]
    # Away from 0 and 1: logarithms and inverse functions of coordinates stay finite.
    return dict(
        zip(COORDINATES, (float(min(max(value, 1e-9), 1 - 1e-9)) for value in values), strict=True)
    )


@cache
def _defaults() -> tuple[Ranges, Mapping[str, tuple[float, float]]]:
    """Return the ranges as they are drawn without a file, and the limits that they may have."""
    ranges = tomllib.loads(FILE.read_text(encoding="utf-8"))
    del ranges["coordinates"]
    limits = ranges.pop("limits")
    return ranges, limits


def read_ranges(path: Path) -> Ranges:
    """Read ranges from a TOML file, whose folder of meshes lies beside it."""
    table = read_toml("ranges", path)
    if isinstance(table.get("meshes"), str) and table["meshes"]:
        table["meshes"] = str(path.parent / table["meshes"])
    return ranges_from(table, str(path))


def ranges_from(table: Mapping[str, object], where: str = "ranges") -> Ranges:
    """Return the usual ranges, with those of a table in their place.

    Unknown names, ranges that are empty or beyond what can be drawn, and weights of which
    none is above 0 are refused.
    """
    usual, limits = _defaults()
    # A name with limits is a range; every other name is a table of weights.
    readers: dict[str, Reader[object]] = {"meshes": _folder}
    readers |= {name: partial(_range, limits=pair) for name, pair in limits.items()}
    readers |= {
        name: partial(_weights, names=tuple(usual[name])) for name in usual if name not in readers
    }
    try:
        return usual | read_named("", table, readers)
    except InputError as error:
        raise InputError(f"{where}: {error}") from None


def _folder(what: str, value: object) -> str:
    if not isinstance(value, str) or (value and not Path(value).is_dir()):
        raise InputError(f"{what} is {value!r}; expected a folder of .obj and .ply files")
    return value


def _range(what: str, value: object, *, limits: tuple[float, float]) -> tuple[float, float]:
    pair = value if isinstance(value, list | tuple) else [value, value]
    ends = [float(read_number(what, end, *limits)) for end in pair]
    if len(ends) != 2 or ends[0] > ends[1]:
        raise InputError(f"{what}: got {value!r}, expected [from, to]")
    return ends[0], ends[1]


def _weights(what: str, value: object, *, names: tuple[str, ...]) -> dict[str, float]:
    heaviest = 1e9  # weight of a choice
    read = partial(read_number, least=0, most=heaviest)
    weights = read_named(f"{what}.", read_table(what, value), dict.fromkeys(names, read))
    if not any(weights.values()):
        raise InputError(f"{what}: no weight is above 0; expected one at least")
    return {name: float(weights.get(name, 0.0)) for name in names}
