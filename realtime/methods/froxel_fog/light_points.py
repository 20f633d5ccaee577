# SPDX-License-Identifier: BSD-3-Clause
"""The points of lights with extent as tables, so that one loop goes over them, whatever their number."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.numerics.array_types import aligned_array, four_numbers
from realtime.scene.light_points import read_light_points
from realtime.scene.lights import Facing, Light
from realtime.shadow_maps.hemisphere_map import HemisphereMaps, LightFrame, cast_hemisphere_maps


@dataclass(frozen=True)
class LightPointTable:
    """The points of one light with extent; four numbers a point in each array."""

    source: int  #: the number of the light
    count: int  #: how many points it has
    places: Any  #: three coordinates and the lift [m]
    normals: Any  #: unit vectors, and nothing
    across: Any  #: unit vectors across these, and nothing
    maps: HemisphereMaps | None = None  #: of all points; None: rays are cast

    def point(self, number: Any, like: Light) -> Light:
        """Return the light point of a number; what all have in common is that of `like`, one of them."""
        Float, Vector = type(self.places), type(like.position)
        place, way = (dr.gather(four_numbers(Float), rows, number) for rows in (self.places, self.normals))
        facing = Facing(mi.Vector3d(way.xyz), place.w, Float(0))
        return replace(like, position=Vector(place.xyz), facing=facing)

    def lit(self, number: Any, light: Light, point: Any) -> Any:
        """Return whether a light point reaches points in the air [m], by its map."""
        assert self.maps is not None
        frame = self._frame(number, light)
        return self.maps.lit(number, frame.local(point - light.position))

    def frame(self, number: Any, like: Light) -> LightFrame:
        """Return the light point of a number with its frame; `like` is one of them."""
        return self._frame(number, self.point(number, like))

    def _frame(self, number: Any, light: Light) -> LightFrame:
        assert light.facing is not None
        normal = light.normal
        across = type(normal)(dr.gather(four_numbers(type(self.across)), self.across, number).xyz)
        return LightFrame(light.position, across, dr.cross(normal, across), normal, light.facing.lift)

    def with_maps(self, geometry: Any, like: Light, size: int) -> "LightPointTable":
        """Return the table with maps, of `size` texels on a side, of the shapes of a Mitsuba scene."""
        frames = self.frame(dr.arange(mi.UInt32, self.count), like)
        dr.eval(frames)
        return replace(self, maps=cast_hemisphere_maps(geometry, frames, self.count, size, for_surfaces=False))


def tabulated(lights: Sequence[Light]) -> tuple[LightPointTable, ...]:
    """Return the tables of the light points among the lights of a scene, by their lights."""
    sources = dict.fromkeys(light.source for light in lights if light.source is not None)
    return tuple(_table(source, [light for light in lights if light.source == source]) for source in sources)


def _table(source: int, points: list[Light]) -> LightPointTable:
    Float = type(points[0].position.x)
    read = read_light_points(points)

    def rows(vectors: Any, last: Any) -> Any:
        return aligned_array(Float, np.hstack([vectors, last]).ravel())

    nothing = np.zeros((len(points), 1))
    places, normals, across = rows(read.position, read.lift), rows(read.normal, nothing), rows(read.across, nothing)
    return LightPointTable(source, len(points), places, normals, across)
