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
from itertools import chain
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.area_lights.points import LightSamples, PlacedPoints, place_points
from airlight.realtime.area_lights.shape import AreaLight
from airlight.realtime.numerics.array_types import (
    ArrayTypes,
    aligned_array,
    aligned_numbers,
    host_numbers,
    types_of,
)
from airlight.realtime.numerics.functions import summed
from airlight.realtime.scene.lights import Facing, Light


def sampled_lights(
    lights: Sequence[AreaLight], samples: LightSamples, Float: Any
) -> tuple[tuple[Light, ...], tuple["LightTable", ...]]:
    """Return the light samples of area lights, light after light, and a table of those of each.

    Parameters
    ----------
    lights
        The area lights.
    samples
        How many there are of each light, and in which pattern.
    Float
        The type of the numbers of the samples.

    Raises
    ------
    InputError
        For a number or a pattern that does not exist.
    """
    types = types_of(Float)
    points, tables = [], []
    for number, light in enumerate(lights):
        placed = place_points(light, samples.points, samples.pattern)
        points.append(_points_of(placed, number, types))
        tables.append(_table_of(placed, number, types))
    return tuple(chain(*points)), tuple(tables)


def _table_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> "LightTable":
    """Return the rows of placed points, which the host knows: a read of the lights themselves would
    wait for the device.
    """
    count = len(placed.positions)

    def column(scalar: Any, numbers: Any) -> Any:
        return aligned_array(scalar, np.broadcast_to(numbers, count))

    def vector(kind: Any, scalar: Any, rows: Any) -> Any:
        return kind(*(column(scalar, numbers) for numbers in rows))

    facing = Facing(
        vector(mi.Vector3d, mi.Float64, placed.normals.T),
        column(types.scalar, placed.lift),
        column(types.scalar, placed.chord),
    )
    position = vector(types.vector, types.scalar, placed.positions.T)
    intensity = vector(types.color, types.scalar, placed.intensity)
    light = Light(position, intensity, facing=facing, source=source)
    return LightTable(light, count, flat=_face_alike(placed))


def _face_alike(placed: PlacedPoints) -> bool:
    return bool(np.all(placed.normals == placed.normals[0]))


def _points_of(placed: PlacedPoints, source: int, types: ArrayTypes) -> list[Light]:
    # Arrays that all points share are made once: a frame after a light
    # moved makes all arrays again.
    intensity = types.color(*aligned_numbers(types.scalar, placed.intensity))
    lift, chord = aligned_numbers(types.scalar, np.array([placed.lift, placed.chord]))
    # The samples of a flat light have one normal: one array serves all.
    alike = _face_alike(placed)
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
    #: whether they are the samples of an area light that all face the same way, bit for bit
    flat: bool = False

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


def light_tables(
    lights: Sequence[Light], made: Sequence[LightTable] = ()
) -> tuple[LightTable, ...]:
    """Return the tables of some lights, in the order of the first light of each.

    A light at infinity is a table by itself.

    Parameters
    ----------
    lights
        Lights of any kind.
    made
        Tables of area lights, as `sampled_lights` returns them. A light of which `lights` has one
        sample has them all. The other tables are stacked: of several lights, that waits for the
        device.
    """
    known = {table.rows.source: table for table in made}
    return tuple(known.get(group[0].source) or _table(group) for group in alike(lights))


def alike(lights: Sequence[Light]) -> list[tuple[Light, ...]]:
    """Return the lights of each table."""
    several: dict[Any, list[Light]] = {}
    for number, light in enumerate(lights):
        # A light at infinity has its number for a key, which no other light shares.
        several.setdefault(structure(light) if light.w else number, []).append(light)
    return list(map(tuple, several.values()))


def by_tables(lights: Sequence[Light]) -> tuple[Light, ...]:
    """Return lights in the order of their tables, in which `View.lights` has them."""
    return tuple(light for group in alike(lights) for light in group)


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
    # Intensity as the mean of red, green and blue, in one read, as each waits for the device.
    mean = dr.mean(mi.Vector3d(light.intensity))
    # A cone has the solid angle 2 pi (1 - cos): all lights of a table have one, or none has.
    if light.cone is not None:
        mean *= 1 - mi.Float64(light.cone.cos)
    # An array of one entry serves all rows.
    power = np.array(mean) * np.ones(table.count)
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
