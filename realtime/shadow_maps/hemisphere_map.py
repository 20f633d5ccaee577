# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps over hemispheres, of all points of an area light, in one array.

A light sample shines into the half space before its plane. A cube map would spend three of its six
faces on nothing; an octahedral map (Praun and Hoppe 2003; Cigolle et al. 2014) covers the half
space with one square. With the local coordinates (a, b, c) of a direction, c along the normal, and
s = |a| + |b| + c,

    u = (a + b) / s,     v = (a - b) / s,     both from -1 to 1.

The maps hold 1/s of the first surface, at the corners of the texels. On a plane that is linear in u
and v over a quadrant, as inverse depth is in a perspective map, and a point is lit where its own
1/s is not smaller.

A point *on* a surface is compared with the value of the nearest corner. There the surface may be
nearer to the light, by up to half of the change of 1/s from one corner to the next. A second array
therefore holds eased values: less half of the slope to the flatter side, along rows and along
columns. A plane then never shadows itself, and edges move by less than half a texel.

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
        # Coordinates are linear along a ray: both products are taken once, not at every distance.
        start, way = self._local(rays.origin - self.light.position), self._local(rays.direction)
        return lambda x: self._reaches(
            [dr.fma(slope, x, first) for slope, first in zip(way, start, strict=True)]
        )

    def lit_surface(self, point: Any) -> Any:
        """Return whether the light sample reaches points on surfaces [m]."""
        inverse, corner = self._corner(self._local(point - self.light.position))
        return inverse >= dr.gather(type(inverse), self.maps.eased, corner)

    def beyond(self, point: Any, active: Any = True) -> Any:
        """Return how far points are behind the first surface of the map, over the distance
        of that surface from the light [1].
        """
        inverse, corner = self._corner(self._local(point - self.light.position))
        return dr.gather(type(inverse), self.maps.inverse, corner, active) / inverse - 1

    def _local(self, vector: Any) -> list[Any]:
        return [dr.dot(vector, axis) for axis in (self.across, self.up, self.light.normal)]

    def _reaches(self, place: Any) -> Any:
        inverse, corner = self._corner(place)
        return inverse >= dr.gather(type(inverse), self.maps.inverse, corner)

    def _corner(self, place: Any) -> tuple[Any, Any]:
        """Return 1/s of a place, by its coordinates, and the entry of the nearest corner."""
        # A point behind the plane of the sample is in no map: c = 0 puts it on the border.
        (a, b, c), size = place, self.maps.size
        inverse = dr.rcp(dr.abs(a) + dr.abs(b) + dr.maximum(c, 0))
        # The nearest corner is the whole number below (u + 1) size/2 + 1/2.
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
    # Any vector that is not parallel to the normal will do to start from.
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

    `scene`: the Mitsuba scene that holds the occluders; `table`: the light samples; `size`: texels
    on a side of each map, a power of two; `for_surfaces`: whether points on surfaces will be asked
    for, not only points in the air. Raises InputError if `size` is not a power of two from 4 to
    8192.
    """
    check_size(size)
    Float, side, points = type(table.rows.position.x), size + 1, table.count
    number, row, column = tiled_corners(points, side)
    # Squares of 4 x 4 corners reach beyond the map, where no ray is cast.
    inside = (row < side) & (column < side)
    # The direction through (u, v) with s = 1: a, b and what |a| + |b| leave for c.
    u, v = (dr.fma(Float(corner), 2.0 / size, -1.0) for corner in (column, row))
    a, b = 0.5 * (u + v), 0.5 * (u - v)
    c = dr.maximum(1 - dr.abs(a) - dr.abs(b), 0)
    light = table[number]
    assert light.facing is not None
    across, up = _across(light)
    aim = across * a + up * b + light.normal * c
    length = dr.norm(aim)
    direction = aim / length
    # Rays start a little before the light's shape, and count from there.
    start = light.position + light.normal * light.facing.lift
    hit = scene.ray_intersect_preliminary(
        mi.Ray3f(mi.Point3f(start), mi.Vector3f(direction)), coherent=True, active=inside
    )
    # A hit at t lies at t/length times that direction, which has s = 1: 1/s = length/t.
    hit_inverse = dr.select(hit.is_valid(), length / Float(hit.t), 0)
    inverse = dr.empty(Float, points * side * side)
    dr.scatter(inverse, hit_inverse, (number * side + row) * side + column, inside)
    # Evaluate it once: every kernel that reads it would cast the rays again.
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
    # a = 0 and b = 0 are the diagonals of the square.
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
        change = dr.select(between, dr.maximum(before, after), dr.minimum(before, after))
        slack += dr.select(at == 0, after, dr.select(at == side - 1, before, change))
    # Beyond that, rounding: a hit and a point on the surface differ by some
    # units in the last place.
    return inverse * (1 - 1e-5) - 0.5 * slack
