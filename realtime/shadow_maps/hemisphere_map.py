# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps over hemispheres, of all points of an area light, in one array.

A light sample shines into the half space before its normal. A cube map would spend three of its six
faces on nothing; an octahedral map (Praun and Hoppe 2003; Cigolle et al. 2014) covers the half
space with one square. With the local coordinates (a, b, c) of a direction, c along the normal, and
s = |a| + |b| + c,

    u = (a + b) / s,     v = (a - b) / s,     both from -1 to 1.

The maps hold 1/s of the first surface, at the corners of the texels. On a plane that is linear in u
and v over a quadrant, as inverse depth is in a perspective map, and a point is lit where its own
1/s is not smaller.

A point *on* a surface is compared with the value of the nearest corner, where the surface may be
nearer to the light: by up to half of the change of 1/s from one corner to the next. A second array
therefore holds the values less half of the slopes to the flatter side of rows and of columns: a
plane never shadows itself, and edges move by less than half a texel.

The maps of N points follow one another, and all are cast at once, so that the number of
kernels does not grow with N.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import bytes_of
from airlight.realtime.scene.light_table import LightTable
from airlight.realtime.scene.lights import Light
from airlight.realtime.scene.media.medium import Rays
from airlight.realtime.shadow_maps.shadow_map import check_size, tiled_corners


@dataclass(frozen=True)
class HemisphereMaps:
    """The first hits of the rays of N light samples, map by map, row by row."""

    size: int  #: texels on a side
    inverse: Any  #: N (size + 1)^2 values 1/s, 0 where there is nothing [1/m]
    #: the same, less what a plane changes in half a texel [1/m]; None where no surface is asked for
    eased: Any

    def of(self, number: Any, light: Light) -> "HemisphereMap":
        """Return the maps of light samples of some numbers."""
        return HemisphereMap(self, light, number * (self.size + 1) ** 2, *_across(light))


@dataclass(frozen=True)
class HemisphereMap:
    """The map of a light sample, or of one of several in each lane."""

    maps: HemisphereMaps
    light: Light
    first: Any  #: its first entry
    across: Any
    up: Any

    def lit(self, point: Any) -> Any:
        """Return whether the light sample reaches points in the air [m]."""
        return self._reaches(self._local(point - self.light.position))

    def lit_along(self, rays: Rays) -> Callable[[Any], Any]:
        """Return a test of whether the light sample reaches rays at distances [m]: a
        sum for each coordinate.
        """
        start, way = self._local(rays.origin - self.light.position), self._local(rays.direction)
        return lambda x: self._reaches(
            [dr.fma(slope, x, first) for slope, first in zip(way, start, strict=True)]
        )

    def lit_surface(self, point: Any) -> Any:
        """Return whether the light sample reaches points on surfaces [m]."""
        own, corner = self._corner(self._local(point - self.light.position))
        return own >= dr.gather(type(own), self.maps.eased, corner)

    def beyond(self, point: Any, active: Any = True) -> Any:
        """Return how far points are behind what the map holds, over the distance of
        that from the light [1].
        """
        own, corner = self._corner(self._local(point - self.light.position))
        return dr.gather(type(own), self.maps.inverse, corner, active) / own - 1

    def _local(self, vector: Any) -> list[Any]:
        return [dr.dot(vector, axis) for axis in (self.across, self.up, self.light.normal)]

    def _reaches(self, place: Any) -> Any:
        own, corner = self._corner(place)
        return own >= dr.gather(type(own), self.maps.inverse, corner)

    def _corner(self, place: Any) -> tuple[Any, Any]:
        """Return 1/s of a place, by its coordinates, and the entry of the nearest corner."""
        (a, b, c), size = place, self.maps.size
        inverse = dr.rcp(dr.abs(a) + dr.abs(b) + dr.maximum(c, 0))
        scale, middle = 0.5 * size * inverse, 0.5 * (size + 1)
        # In whole numbers, whatever the place is: a light itself has no direction.
        column, row = (
            dr.minimum(mi.UInt32(dr.maximum(dr.fma(along, scale, middle), 0)), size)
            for along in (a + b, a - b)
        )
        return inverse, self.first + row * (size + 1) + column


def _across(light: Light) -> tuple[Any, Any]:
    """Return two unit vectors at right angles to the normal of a light sample."""
    normal = light.normal
    helper = dr.select(dr.abs(normal.x) < 0.5, type(normal)(1, 0, 0), type(normal)(0, 1, 0))
    across = dr.normalize(dr.cross(helper, normal))
    return across, dr.cross(normal, across)


def maps_memory(Float: Any, points: int, size: int) -> int:
    """Return how much the distances of maps take [bytes]."""
    return 2 * bytes_of(Float) * points * (size + 1) ** 2


def cast_hemisphere_maps(
    scene: Any, table: LightTable, size: int, *, for_surfaces: bool = True
) -> HemisphereMaps:
    """Cast the maps of light samples.

    `scene`: the Mitsuba scene that holds the occluders; `table`: the light samples; `size`:
    texels on a side of each map, a power of two; `for_surfaces`: whether points on surfaces will be asked for, not only
    those in the air. Raises InputError if `size` is not a power of two from 4 to 8192.
    """
    check_size(size)
    Float, side, points = type(table.rows.position.x), size + 1, table.count
    number, row, column = tiled_corners(points, side)
    there = (row < side) & (column < side)
    u, v = (dr.fma(Float(corner), 2.0 / size, -1.0) for corner in (column, row))
    a, b = 0.5 * (u + v), 0.5 * (u - v)
    c = dr.maximum(1 - dr.abs(a) - dr.abs(b), 0)
    light = table[number]
    assert light.facing is not None
    across, up = _across(light)
    aim = across * a + up * b + light.normal * c
    length = dr.norm(aim)
    direction = aim / length
    start = light.position + light.normal * light.facing.lift
    hit = scene.ray_intersect_preliminary(
        mi.Ray3f(mi.Point3f(start), mi.Vector3f(direction)), coherent=True, active=there
    )
    met = dr.select(hit.is_valid(), length / Float(hit.t), 0)
    inverse = dr.empty(Float, points * side * side)
    dr.scatter(inverse, met, (number * side + row) * side + column, there)
    dr.eval(inverse)
    eased = _eased(inverse, points, side) if for_surfaces else None
    dr.eval(eased)
    return HemisphereMaps(size, inverse, eased)


def _eased(inverse: Any, points: int, side: int) -> Any:
    """Return values less half of what they change to the flatter side,
    along rows and along columns.
    """
    index = dr.arange(mi.UInt32, points * side * side)
    line = index // side
    column, row = index - line * side, line % side
    slack, between = type(inverse)(0), (row == column) | (row + column == side - 1)
    for at, step in ((column, 1), (row, side)):
        before = dr.abs(
            dr.gather(type(inverse), inverse, dr.select(at > 0, index - step, index)) - inverse
        )
        after = dr.abs(
            dr.gather(type(inverse), inverse, dr.select(at < side - 1, index + step, index))
            - inverse
        )
        # At the ends of a row there is one side only; between two quadrants a plane has two slopes.
        both = dr.select(between, dr.maximum(before, after), dr.minimum(before, after))
        slack += dr.select(at == 0, after, dr.select(at == side - 1, before, both))
    # Beyond that, rounding: a hit and a point on the surface differ by some
    # units in the last place.
    return inverse * (1 - 1e-5) - 0.5 * slack
