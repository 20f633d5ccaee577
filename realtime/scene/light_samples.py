# SPDX-License-Identifier: BSD-3-Clause
"""Area lights as light samples: what methods render of them.

**Lights of one structure as a table**, from which each ray takes lights by number, and by chance after their power.

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
from numpy.typing import NDArray

from airlight.realtime.area_lights.points import PlacedPoints, place_points
from airlight.realtime.numerics.array_types import ArrayTypes, aligned_array, aligned_numbers, host_numbers, types_of
from airlight.realtime.scene.lights import Facing, Light
from airlight.realtime.scene.read_scene import Scene

Array = NDArray[np.float64]


def light_samples(scene: Scene, points: int, pattern: str) -> tuple[Light, ...]:
    """Return the points of the area lights of a scene, light after light.

    `scene`: the scene; `points`, `pattern`: see `realtime.area_lights.points.LightSamples`. Raises InputError for a
    number or a pattern that there is not.
    """
    types = types_of(type(scene.camera.origin.x))
    placed = [place_points(light, points, pattern) for light in scene.area_lights]
    return tuple(point for number, of_light in enumerate(placed) for point in _points_of(of_light, number, types))


def _points_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> list[Light]:
    # Arrays that all points share are made once: a frame after a light moved makes all arrays again.
    intensity = types.color(*aligned_numbers(types.scalar, placed.intensity))
    lift, chord = aligned_numbers(types.scalar, np.array([placed.lift, placed.chord]))
    alike = len(placed.normals) > 1 and bool(np.all(placed.normals == placed.normals[0]))
    normals = placed.normals[:1] if alike else placed.normals
    facings = [Facing(mi.Vector3d(*aligned_numbers(mi.Float64, normal)), lift, chord) for normal in normals]
    return [
        Light(_vector(position, types), intensity, facing=facings[0 if alike else number], source=source)
        for number, position in enumerate(placed.positions)
    ]


def _vector(values, types: ArrayTypes):
    return types.vector(*aligned_numbers(types.scalar, values))


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
    arrays = list(_arrays(lights[0]))
    # All in one transfer, as each waits for the device: the arrays, and by name those that a power is made of.
    wanted = [[*_arrays(light), light.intensity, *([] if light.cone is None else [light.cone.cos])] for light in lights]
    read = host_numbers(*(array for of_light in wanted for array in of_light))
    columns, every = [], len(wanted[0])
    for place, array in enumerate(arrays):
        values = np.stack(read[place::every])
        scalar = type(array.x) if dr.depth_v(array) > 1 else type(array)
        columns += [aligned_array(scalar, column) for column in values.T]
    Float = type(lights[0].position.x)
    power = np.stack(read[len(arrays) :: every]).mean(axis=1)
    if lights[0].cone is not None:
        power = power * (1 - np.concatenate(read[len(arrays) + 1 :: every]))
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
