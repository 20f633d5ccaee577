# SPDX-License-Identifier: BSD-3-Clause
"""Lights of one structure as a table, a light a row, and the samples of area lights.

A loop over lights in Python makes a kernel that grows with them. A table holds all of them in one
light of arrays: its rows are gathered, and `LightTable.sum` is the one loop over lights.

The power of a light is its intensity times the solid angle that it shines into, and a table draws a
light by the inverse of the sum of powers: the least number whose sum of powers is above a fraction
of the total.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, fields, is_dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.area_lights.points import PlacedPoints, place_points
from airlight.realtime.numerics.array_types import (
    ArrayTypes,
    aligned_array,
    aligned_numbers,
    host_numbers,
    types_of,
)
from airlight.realtime.numerics.functions import summed
from airlight.realtime.scene.lights import Facing, Light
from airlight.realtime.scene.read_scene import Scene


def light_samples(scene: Scene, points: int, pattern: str) -> tuple[Light, ...]:
    """Return the light samples of the area lights of a scene, light after light.

    Parameters
    ----------
    scene
        The scene.
    points, pattern
        Fields of `realtime.area_lights.points.LightSamples`.

    Raises
    ------
    InputError
        For a number or a pattern that does not exist.
    """
    types = types_of(type(scene.camera.origin.x))
    placed = [place_points(light, points, pattern) for light in scene.area_lights]
    return tuple(
        point
        for number, of_light in enumerate(placed)
        for point in _points_of(of_light, number, types)
    )


def _points_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> list[Light]:
    # Arrays that all points share are made once: a frame after a light
    # moved makes all arrays again.
    intensity = types.color(*aligned_numbers(types.scalar, placed.intensity))
    lift, chord = aligned_numbers(types.scalar, np.array([placed.lift, placed.chord]))
    # The samples of a flat light have one normal: one array serves all.
    alike = len(placed.normals) > 1 and bool(np.all(placed.normals == placed.normals[0]))
    normals = placed.normals[:1] if alike else placed.normals
    facings = [
        Facing(mi.Vector3d(*aligned_numbers(mi.Float64, normal)), lift, chord) for normal in normals
    ]
    return [
        Light(
            _vector(position, types),
            intensity,
            facing=facings[0 if alike else number],
            source=source,
        )
        for number, position in enumerate(placed.positions)
    ]


def _vector(values, types: ArrayTypes):
    return types.vector(*aligned_numbers(types.scalar, values))


@dataclass(frozen=True)
class LightTable:
    """Lights that have the same fields."""

    rows: Light  #: its arrays have a row for each light; all that is no array is common to them
    count: int

    def __getitem__(self, number: Any) -> Light:
        """Return the lights of some numbers, counted from 0."""
        return self.rows if self.count == 1 else _gathered(self.rows, number)

    def sum(self, term: Callable[[Light, Any], Any], zero: Any) -> Any:
        """Return the sum over the lights of `term(light, number)`, in one loop;
        `zero` is the sum of none.

        The code of a kernel has the term once, however many lights there are.
        """
        # One light needs no loop, and its number no gather.
        if self.count == 1:
            return zero + term(self.rows, mi.UInt32(0))
        return summed(self.count, lambda number: term(self[number], number), zero)


def structure(light: Light) -> Any:
    """Return which fields a light has, and which area light it is a sample of: one table
    holds lights alike in both.
    """
    return light.source, tuple(value is None for value in vars(light).values())


def light_tables(lights: Sequence[Light]) -> tuple[LightTable, ...]:
    """Return the tables of some lights, in the order of the first light of each.

    A light at infinity is a table by itself.

    Parameters
    ----------
    lights
        Lights of any kind.
    """
    return tuple(map(_table, alike(lights)))


def alike(lights: Sequence[Light]) -> list[tuple[Light, ...]]:
    """Return the lights of each table."""
    several: dict[Any, list[Light]] = {}
    for number, light in enumerate(lights):
        # A light at infinity has its number for a key, which no other light shares.
        several.setdefault(structure(light) if light.w else number, []).append(light)
    return list(map(tuple, several.values()))


def lights_apart(tables: Iterable[LightTable], *, by_source: bool) -> Iterator[LightTable]:
    """Yield each light as a table by itself; `by_source`: the samples of an area light together."""
    for table in tables:
        if by_source and table.rows.source is not None:
            yield table
        else:
            yield from (LightTable(table[number], 1) for number in range(table.count))


def _table(lights: tuple[Light, ...]) -> LightTable:
    if len(lights) == 1:
        return LightTable(lights[0], 1)
    # All in one transfer, as each waits for the device.
    arrays = list(_arrays(lights[0]))
    read = host_numbers(*(array for light in lights for array in _arrays(light)))
    columns = []
    # `read` has the arrays of the first light, then those of the second, and so on. The numbers of
    # all lights at one place of a light become a column of the table, by component of a vector.
    for place, array in enumerate(arrays):
        scalar = type(array.x) if dr.depth_v(array) > 1 else type(array)
        columns.append(
            [aligned_array(scalar, column) for column in np.stack(read[place :: len(arrays)]).T]
        )
    stacked = (type(array)(*column) for array, column in zip(arrays, columns, strict=True))
    return LightTable(_with_arrays(lights[0], lambda _: next(stacked)), len(lights))


@dataclass(frozen=True)
class LightChoice:
    """The lights of a table, drawn by their powers."""

    sums: Any  #: of the powers up to each light, as fractions of all
    fractions: Any  #: of each in the power of all

    def pick(self, fraction: Any) -> tuple[Any, Any]:
        """Return a number for each fraction from 0 to 1, and the probability of that
        number if fractions are even.
        """
        number, count = dr.zeros(mi.UInt32, dr.width(fraction)), dr.width(self.sums)
        # The least number whose sum of powers is above the fraction.
        if count > 1:
            number = dr.binary_search(
                0, count - 1, lambda place: dr.gather(type(fraction), self.sums, place) <= fraction
            )
        return number, dr.gather(type(fraction), self.fractions, number)


def light_choice(table: LightTable) -> LightChoice:
    """Return the choice of a light of a table by its power; all alike where none has any.

    Parameters
    ----------
    table
        One of the tables that `light_tables` returns.
    """
    light = table.rows
    # Intensity as the mean of red, green and blue; an array of one entry serves all rows.
    power = np.stack([np.array(channel) for channel in light.intensity]).mean(axis=0) * np.ones(
        table.count
    )
    # A cone has the solid angle 2 pi (1 - cos): all lights of a table have one, or none has.
    if light.cone is not None:
        power = power * (1 - np.array(light.cone.cos))
    power = power if power.sum() > 0 else np.ones(table.count)
    Float = type(light.position.x)
    fractions = power / power.sum()
    return LightChoice(aligned_array(Float, np.cumsum(fractions)), aligned_array(Float, fractions))


def _arrays(value: Any) -> Iterator[Any]:
    """Yield the arrays that a light holds, in the order of its fields."""
    if is_dataclass(value) and not isinstance(value, type):
        for item in fields(value):
            yield from _arrays(getattr(value, item.name))
    elif dr.is_array_v(value):
        yield value


def _with_arrays(value: Any, new_array: Callable[[Any], Any]) -> Any:
    """Return a light with other arrays, each made of the old one, in the order of its fields."""
    if is_dataclass(value) and not isinstance(value, type):
        return replace(
            value,
            **{
                item.name: _with_arrays(getattr(value, item.name), new_array)
                for item in fields(value)
            },
        )
    return new_array(value) if dr.is_array_v(value) else value


def _gathered(rows: Light, number: Any) -> Light:
    """Return the rows of some numbers."""

    def gathered(array: Any) -> Any:
        if dr.depth_v(array) == 1:
            return dr.gather(type(array), array, number)
        # A vector is gathered component by component.
        return type(array)(*(dr.gather(type(array.x), component, number) for component in array))

    return _with_arrays(rows, gathered)
