# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps by ray casting into plain arrays: one face for a spot or a directional
light, six for a point light.

A face is cut into size^2 texels over (u, v) in [-1, 1]^2 (`realtime.shadow_maps.projection`); a map
holds at each of their (size + 1)^2 *corners* the distance *along the ray* from the light to the
first surface [m], infinite where there is none. The outermost values therefore lie on the edges of
the face, where faces of a cube meet with equal values.

The face of a directional light is a rectangle across it that just covers the media. It lies where
the media end; the ray of (u, v) starts at position + u across + v up - depth axis, before all
shapes, and goes along the axis. Surfaces beside that rectangle are in no map: rays find their
shadows.

Directions are computed in float64 and rounded once, to the float32 that rays are cast in: a ray
that passes an edge closely meets the same surface whatever the precision of the method, and one map
can stand for both.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.memory import check_memory
from airlight.realtime.numerics.array_types import bytes_of
from airlight.realtime.parameters import parameter
from airlight.realtime.scene.light_table import LightTable
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.projection import (
    Projection,
    cube_coordinates,
    light_faces,
    light_projection,
    map_ray,
)


@dataclass(frozen=True)
class ShadowMap:
    """Distances from a light to the nearest surface, face by face, row by row."""

    size: int  #: texels on a side
    distance: Any  #: faces (size + 1)^2 values along the rays, from `first` on [m]
    projection: Projection
    first: Any = 0

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return self.projection.faces


@dataclass(frozen=True)
class ShadowMaps:
    """The shadow maps of the lights of a table, one after another."""

    size: int  #: texels on a side
    distance: Any  #: of `ShadowMap`
    projection: Projection | None  #: of a single light; None for several, from whom it follows

    def of(self, number: Any, light: Light) -> ShadowMap:
        """Return the maps of lights of some numbers."""
        if self.projection is not None:
            return ShadowMap(self.size, self.distance, self.projection)
        first = number * (light_faces(light) * (self.size + 1) ** 2)
        return ShadowMap(self.size, self.distance, light_projection(light), first)


def check_size(size) -> None:
    """Refuse a resolution that no shadow map can have.

    Raises InputError if `size` is not a power of two from 4 to 8192.
    """
    if not isinstance(size, int) or size < 4 or size > 8192 or size & (size - 1):
        raise InputError(f"map: got {size!r}, expected a power of two from 4 to 8192")


def map_size(default: int, help: str) -> Any:
    """Return the field of a parameter that is the resolution of a shadow map [texels]."""
    return parameter(default, help, check=check_size, wanted="a power of two from 4 to 8192")


def map_memory(light: Light, size: int) -> int:
    """Return how much the distances of the shadow map of a light take [bytes]."""
    number = bytes_of(type(light.position.x))
    return number * light_faces(light) * (size + 1) ** 2


def check_maps(lights: Sequence[Light], size: int, needed: int | None = None) -> None:
    """Refuse maps of some lights that need more memory than the machine has; `needed`
    bytes, or what distances take.
    """
    needed = sum(map_memory(light, size) for light in lights) if needed is None else needed
    check_memory(f"map: {size} texels for {len(lights)} light(s)", needed, "use a smaller map")


def cast_shadow_map(scene, light: Light, size: int) -> ShadowMap:
    """Cast the shadow map of one light; see `cast_shadow_maps`."""
    return cast_shadow_maps(scene, LightTable(light, 1), size).of(0, light)


def cast_shadow_maps(scene, table: LightTable, size: int) -> ShadowMaps:
    """Cast the shadow maps of all lights of a table at once.

    `scene`: the Mitsuba scene that holds the occluders; `table`: the lights; `size`: texels on a
    side, a power of two. Raises InputError if `size` is not a power of two from 4 to 8192.
    """
    check_size(size)
    Double = mi.Float64
    side, faces = size + 1, light_faces(table.rows)
    face, row, column = tiled_corners(table.count * faces, side)
    # Squares of 4 x 4 corners reach beyond the face, where no ray is cast.
    inside = (row < side) & (column < side)
    number = face // faces
    # Whole numbers and powers of two: exact, so that neighbouring faces cast the same rays
    # along their common edge.
    u, v = (dr.fma(Double(corner), 2.0 / size, -1.0) for corner in (column, row))
    cast = cast_map_rays(scene, table[number], (face - number * faces, u, v), inside)
    distance = dr.empty(type(cast), table.count * faces * side * side)
    dr.scatter(distance, cast, (face * side + row) * side + column, inside)
    projection = light_projection(table.rows) if table.count == 1 else None
    # Evaluated once: every kernel that reads the distances would cast the rays again.
    dr.eval(distance, projection)
    return ShadowMaps(size, distance, projection)


def inverse_depth(shadow_map: ShadowMap):
    """Return the inverse planar depth [1/m], or the height for parallel rays [m], at
    every corner of the texels.
    """
    # Corners lie face by face, row by row, at equal steps of u and v from -1 to 1.
    size, distance = shadow_map.size, shadow_map.distance
    Float = type(distance)
    index = dr.arange(mi.UInt32, dr.width(distance))
    row = index // (size + 1)
    u = dr.fma(Float(index - row * (size + 1)), 2.0 / size, -1.0)
    v = dr.fma(Float(row % (size + 1)), 2.0 / size, -1.0)
    return shadow_map.projection.inverse_depth((u, v), distance)


def tiled_corners(faces: int, side: int):
    """Return face, row and column of corners in squares of 4 x 4, so that rays side by
    side in a packet stay close.

    The last squares reach beyond the face.
    """
    # Squares a row, rounded up; lanes count squares, and the 16 corners within one.
    across = -(-side // 4)
    lane = dr.arange(mi.UInt32, faces * across * across * 16)
    square, within = lane // 16, lane % 16
    row = square // across
    face = row // across
    return face, 4 * (row - face * across) + within // 4, 4 * (square - row * across) + within % 4


def texel_rays(light: Light, size: int) -> tuple[Any, Any, Any]:
    """Return the rays of a directional light through the middles of the texels of its
    map, in squares of 4 x 4.

    `light`: a directional area light; `size`: texels on a side, a multiple of 4. Returns where the
    rays start [m] and their unit direction, in float64, and the numbers of their texels, row by
    row.
    """
    _, row, column = tiled_corners(1, size)
    u, v = (dr.fma(mi.Float64(texel), 2.0 / size, 1.0 / size - 1) for texel in (column, row))
    return *map_ray(light, mi.UInt32(0), u, v), row * size + column


def cast_map_rays(scene, light: Light, place, active=True):
    """Return the distances to the first surface along rays of a light's map, infinite
    where there is none [m].

    `scene`: the Mitsuba scene that holds the occluders; `light`: the light; `place`: the face and u
    and v there, in float64; `active`: lanes to cast rays in.
    """
    Float = type(light.position.x)
    start, unit = map_ray(light, *place)
    skipped: Any = 0
    # Rays of a light sample start off its shape; the map counts from the sample.
    if light.facing is not None:
        start, skipped = light.rays_from(unit)
    ray = mi.Ray3f(mi.Point3f(start), mi.Vector3f(unit))
    hit = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
    return dr.select(
        hit.is_valid(), Float(hit.t + skipped) if light.facing is not None else Float(hit.t), dr.inf
    )


def lit_in_map(shadow_map: ShadowMap, light: Light, point):
    """Return whether the light reaches a point [m] by the nearest value of its shadow map."""
    Float, projection = type(point.x), shadow_map.projection
    d = point - light.position
    if projection.basis is None:
        face, u, v = cube_coordinates(d)
    else:
        face = mi.UInt32(0)
        a, b, _, c = projection.homogeneous(face, d, 1)
        u, v = (a / c, b / c) if projection.w else (a, b)
    # The nearest corner is the whole number below (u + 1) size/2 + 1/2.
    size = shadow_map.size
    column, row = (_nearest(dr.fma(place, 0.5 * size, 0.5 * (size + 1)), size) for place in (u, v))
    texel = shadow_map.first + (face * (size + 1) + row) * (size + 1) + column
    stored = dr.gather(Float, shadow_map.distance, texel)
    # Distances are compared as squares. Parallel rays start `depth` above the rectangle, in which
    # the light's position lies, from where d counts.
    if projection.w:
        return dr.squared_norm(d) <= dr.square(stored)
    return projection.products(face, d)[2] <= stored - projection.depth


def _nearest(place, last: int):
    """Return the whole number below a place, from 0 to `last`, whatever the place is.

    Where a ray passes through the light itself, (u, v) is NaN. `dr.clip` lets NaN through, and as a
    whole number it is 2^32 - 1: a load from there ends the process. The upper bound is therefore
    one of whole numbers.
    """
    return dr.minimum(mi.UInt32(dr.maximum(place, 0)), last)
