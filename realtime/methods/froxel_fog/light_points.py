# SPDX-License-Identifier: BSD-3-Clause
"""The points of lights with extent as tables, so that one loop goes over them, whatever their number.

The shadow maps of all points of a light are cast at once, into one array.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np

from realtime.numerics.aligned import aligned_array
from realtime.numerics.array_types import four_numbers
from realtime.scene.lights import Facing, Light
from realtime.shadow_maps.shadow_map import cast_cube_maps, lit_in_cube


@dataclass(frozen=True)
class LightPointTable:
    """The points of one light with extent."""

    source: int  #: the number of the light
    count: int  #: how many points it has
    positions: Any  #: three coordinates [m] and the lift [m], four numbers each
    normals: Any  #: three components, and the chord [m], four numbers each
    distances: Any = None  #: of the shadow maps of all points, one after the other [m]; None: rays are cast
    size: int = 0  #: texels on a side of a face of these

    def point(self, number: Any, like: Light) -> Light:
        """Return the light points of some numbers; what all have in common is that of `like`, one of them."""
        Float, Vector = type(self.positions), type(like.position)
        place = dr.gather(four_numbers(Float), self.positions, number)
        way = dr.gather(four_numbers(Float), self.normals, number)
        facing = Facing(Vector(way.x, way.y, way.z), Vector(0), place.w, way.w)
        return replace(like, position=Vector(place.x, place.y, place.z), facing=facing)

    def lit(self, number: Any, light: Light, point: Any) -> Any:
        """Return whether points [m] are lit by a light point, by its shadow map."""
        return lit_in_cube(self.distances, self.size, number, point - light.position)


def tabulated(lights: Sequence[Light]) -> tuple[LightPointTable, ...]:
    """Return the tables of the light points among the lights of a scene, by their lights."""
    sources = dict.fromkeys(light.source for light in lights if light.source is not None)
    return tuple(_table(source, [light for light in lights if light.source == source]) for source in sources)


def _table(source: int, points: list[Light]) -> LightPointTable:
    Float = type(points[0].position.x)
    positions, normals = [], []
    for light in points:
        facing = light.facing
        assert facing is not None
        positions.append([*np.array(light.position).ravel(), *np.array(facing.lift)])
        normals.append([*np.array(facing.normal).ravel(), *np.array(facing.chord)])
    columns = (aligned_array(Float, np.array(rows, dtype=np.float64).ravel()) for rows in (positions, normals))
    return LightPointTable(source, len(points), *columns)


def with_maps(table: LightPointTable, geometry: Any, like: Light, size: int) -> LightPointTable:
    """Return a table with the shadow maps of its points.

    Parameters
    ----------
    table
        Without them.
    geometry
        The Mitsuba scene that holds the occluders.
    like
        One of the points.
    size
        Texels on a side of a face.
    """
    distances = cast_cube_maps(geometry, lambda number: table.point(number, like), table.count, size)
    return replace(table, distances=distances, size=size)
