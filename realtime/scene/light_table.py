# SPDX-License-Identifier: BSD-3-Clause
"""Lights of one structure as a table, from which each ray takes lights by number, and by chance after their power.

A loop over lights in Python makes a kernel that grows with them. A table makes all of them one: its rows are gathered.
The power of a light is its intensity times the solid angle that it shines into, and tables pick a light by the inverse
of the sum of powers: the least number whose sum of powers is above a fraction of the total.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.numerics.array_types import aligned_array, host_numbers
from realtime.scene.lights import Light


@dataclass(frozen=True)
class LightTable:
    """Lights that have the same fields."""

    first: int  #: the number of one of them in the scene: what all have in common is its
    count: int
    columns: tuple[Any, ...]  #: the components of all their arrays, a light a row
    sums: Any  #: of the powers up to each light, as fractions of all
    fractions: Any  #: of each in the power of all

    def light(self, number: Any, like: Light) -> Light:
        """Return the lights of some numbers, counted from 0; `like` is one of them."""
        return _taken(like, iter(self.columns), number)

    def pick(self, fraction: Any) -> tuple[Any, Any]:
        """Return a number for each fraction from 0 to 1, and the probability of that number if fractions are even."""
        number = dr.zeros(mi.UInt32, dr.width(fraction))
        if self.count > 1:
            number = dr.binary_search(
                0, self.count - 1, lambda place: dr.gather(type(fraction), self.sums, place) <= fraction
            )
        return number, dr.gather(type(fraction), self.fractions, number)


def light_tables(lights: Sequence[Light]) -> tuple[LightTable, ...]:
    """Return the tables of the lights of a scene that have a place, by structure; those at infinity are in none."""
    by_structure: dict[Any, list[int]] = {}
    for number, light in enumerate(lights):
        if light.w:
            by_structure.setdefault(tuple(value is None for value in vars(light).values()), []).append(number)
    return tuple(_table(numbers, [lights[number] for number in numbers]) for numbers in by_structure.values())


def _table(numbers: list[int], lights: list[Light]) -> LightTable:
    arrays = [list(_arrays(light)) for light in lights]
    read = host_numbers(*(array for own in arrays for array in own))
    columns, every = [], len(arrays[0])
    for place, array in enumerate(arrays[0]):
        values = np.stack(read[place::every])
        scalar = type(array.x) if dr.depth_v(array) > 1 else type(array)
        columns += [aligned_array(scalar, column) for column in values.T]
    Float = type(lights[0].position.x)
    # A light begins with its position and intensity, a spot goes on with axis and cut-off.
    power = np.stack(read[1::every]).mean(axis=1)
    if lights[0].cone is not None:
        power = power * (1 - np.cos(np.concatenate(read[3::every])))
    power = power if power.sum() > 0 else np.ones(len(lights))
    sums = np.cumsum(power) / power.sum()
    return LightTable(
        numbers[0], len(lights), tuple(columns), aligned_array(Float, sums), aligned_array(Float, power / power.sum())
    )


def _arrays(value: Any) -> Iterator[Any]:
    """Yield the arrays that a light holds, in the order of its fields."""
    if is_dataclass(value) and not isinstance(value, type):
        for item in fields(value):
            yield from _arrays(getattr(value, item.name))
    elif dr.is_array_v(value):
        yield value


def _taken(value: Any, columns: Iterator[Any], number: Any) -> Any:
    """Return a light with the rows of some numbers in place of its arrays."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value, **{item.name: _taken(getattr(value, item.name), columns, number) for item in fields(value)}
        )
    if not dr.is_array_v(value):
        return value
    if dr.depth_v(value) == 1:
        return dr.gather(type(value), next(columns), number)
    return type(value)(*(dr.gather(type(value.x), next(columns), number) for _ in range(len(value))))
