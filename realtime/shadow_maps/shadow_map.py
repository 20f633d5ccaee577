# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps by ray casting into plain arrays: one face for a spot or a directional light, six for a point light.

A face looks along an axis with two vectors across it: the direction through (u, v) in [-1, 1]^2 is axis + u across +
v up, with |across| = |up| = 1 for a cube face and tan(cutoff) for a spot, whose cone just fits. Each face is cut into
size^2 texels; a map holds at each of their (size + 1)^2 *corners* the distance *along the ray* from the light to the
first surface [m], infinite where there is none. So the outermost values lie on the edges of the face, where the faces
of a cube meet with the same values. The planar depth, along the axis, is the distance over the length of axis + u
across + v up (`realtime.shadow_maps.inverse_depth_field`).

The face of a directional light is a rectangle across it that just covers the media, and |across|, |up| are half its
sides [m]. It lies where the media end; the ray of (u, v) starts at position + u across + v up - depth axis, before all
shapes, and goes along the axis. Surfaces beside that rectangle are in no map: rays find their shadows.

Directions are computed in float64 and rounded once, to the float32 that rays are cast in: a ray that passes an edge
closely meets the same surface whatever the precision of the method, and one map can stand for both.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.errors import InputError
from realtime.numerics.array_types import bytes_of
from realtime.parameters import parameter
from realtime.scene.lights import Light


@dataclass(frozen=True)
class ShadowMap:
    """Distances from a light to the nearest surface, face by face, row by row."""

    size: int  #: texels on a side
    distance: Any  #: faces (size + 1)^2 values along the rays [m]
    frame: tuple[Any, Any, Any] | None  #: of a spot or directional light: across, up and axis; None for a cube
    depth: Any = None  #: of a directional light: distance at which the media end; its rays are parallel [m]

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return 1 if self.frame else 6


def check_size(size) -> None:
    """Refuse what is no resolution of a shadow map.

    Raises
    ------
    InputError
        If `size` is not a power of two from 4 to 8192.
    """
    if not isinstance(size, int) or size < 4 or size > 8192 or size & (size - 1):
        raise InputError(f"map: got {size!r}, wanted a power of two from 4 to 8192")


def map_size(default: int, help: str) -> Any:
    """Return the field of a parameter that is the resolution of a shadow map [texels]."""
    return parameter(default, help, check=check_size, wanted="a power of two from 4 to 8192")


def map_memory(light: Light, size: int) -> int:
    """Return how much the distances of the shadow map of a light take [bytes]."""
    number = bytes_of(type(light.position.x))
    return number * (6 if light.kind == "point" else 1) * (size + 1) ** 2


def cast_shadow_map(scene, light: Light, size: int) -> ShadowMap:
    """Cast the shadow map of one light.

    Parameters
    ----------
    scene
        The Mitsuba scene that holds the occluders.
    light
        The light.
    size
        Texels on a side, a power of two.

    Raises
    ------
    InputError
        If `size` is not a power of two from 4 to 8192.
    """
    check_size(size)
    Double = mi.Float64
    frame = None if light.kind == "point" else _frame(light)
    side, faces = size + 1, 1 if frame else 6
    face, row, column = _tiled_corners(faces, side)
    there = (row < side) & (column < side)
    # Whole numbers and powers of two: exact, so that neighbouring faces cast the same rays along their common edge.
    u, v = (dr.fma(Double(one), 2.0 / size, -1.0) for one in (column, row))
    found = cast_map_rays(scene, light, (face, u, v), there)
    distance = dr.empty(type(found), faces * side * side)
    dr.scatter(distance, found, (face * side + row) * side + column, there)
    frame = frame and tuple(type(light.position)(one) for one in frame)
    depth = light.face.depth if light.kind == "directional" else None
    dr.eval(distance, frame, depth)  # once: whoever reads it would cast the rays again
    return ShadowMap(size, distance, frame, depth)


def _tiled_corners(faces: int, side: int):
    """Return face, row and column of corners in squares of 4 x 4, so that rays side by side in a packet stay close.

    The last squares reach beyond the face.
    """
    across = -(-side // 4)
    lane = dr.arange(mi.UInt32, faces * across * across * 16)
    square, within = lane // 16, lane % 16
    row = square // across
    face = row // across
    return face, 4 * (row - face * across) + within // 4, 4 * (square - row * across) + within % 4


def cast_map_rays(scene, light: Light, place, active=True):
    """Return the distances to the first surface along rays of a light's map, infinite where there is none [m].

    Parameters
    ----------
    scene
        The Mitsuba scene that holds the occluders.
    light
        The light.
    place
        The face and u and v there, in float64.
    active
        Lanes to cast rays in.
    """
    face, u, v = place
    Float = type(light.position.x)
    start = mi.Point3f(light.position)
    if light.kind == "point":
        # In this order the sum does not depend on which coordinate is which.
        unit = cube_direction(mi.Vector3d, face, u, v) * dr.rsqrt((dr.square(u) + dr.square(v)) + 1)
    else:
        across, up, axis = _frame(light)
        if light.kind == "directional":
            before = mi.Vector3d(light.position) - axis * mi.Float64(light.face.depth)
            start = mi.Point3f(before + across * u + up * v)
            unit = axis
        else:
            unit = dr.normalize(across * u + up * v + axis)
    ray = mi.Ray3f(start, mi.Vector3f(unit))
    hit = scene.ray_intersect_preliminary(ray, coherent=True, active=active)
    return dr.select(hit.is_valid(), Float(hit.t), dr.inf)


def lit_in_map(shadow_map: ShadowMap, light: Light, point):
    """Return whether the light reaches a point by the nearest value of its shadow map."""
    Float = type(point.x)
    d = point - light.position
    depth = None
    if shadow_map.frame is None:
        face, u, v = cube_coordinates(d)
    elif shadow_map.depth is not None:
        face = mi.UInt32(0)
        u, v, depth = parallel_coordinates(shadow_map.frame, d)
    else:
        face = mi.UInt32(0)
        a, b, c = face_coordinates(shadow_map.frame, face, d)
        u, v = a / c, b / c
    size = shadow_map.size
    column = mi.UInt32(dr.clip(dr.fma(u, 0.5 * size, 0.5 * (size + 1)), 0, size))
    row = mi.UInt32(dr.clip(dr.fma(v, 0.5 * size, 0.5 * (size + 1)), 0, size))
    stored = dr.gather(Float, shadow_map.distance, (face * (size + 1) + row) * (size + 1) + column)
    return dr.squared_norm(d) <= dr.square(stored) if depth is None else depth <= stored - shadow_map.depth


def face_products(frame, face, vector):
    """Return the scalar products of a vector with the across, up and axis of a face; `frame` is that of the map."""
    if frame:
        return tuple(dr.dot(vector, one) for one in frame)
    x, y, z = vector.x, vector.y, vector.z
    axis = face >> 1
    a, b, c = (dr.select(axis == 0, p, dr.select(axis == 1, q, r)) for p, q, r in ((y, z, x), (z, x, y), (x, y, z)))
    return a, b, dr.select((face & 1) == 0, c, -c)


def face_coordinates(frame, face, vector):
    """Return (a, b, c) of a vector a across + b up + c axis of a face."""
    a, b, c = face_products(frame, face, vector)
    if frame:
        inverse = dr.rcp(dr.squared_norm(frame[0]))
        return a * inverse, b * inverse, c
    return a, b, c


def parallel_coordinates(frame, vector):
    """Return (u, v, c) of a vector u across + v up + c axis of the face of a directional light."""
    a, b, c = face_products(frame, None, vector)
    return a * dr.rcp(dr.squared_norm(frame[0])), b * dr.rcp(dr.squared_norm(frame[1])), c


def _frame(light: Light):
    """Return two vectors across a light's axis and the axis, in float64; of a spot they have the length tan(cutoff)."""
    axis = mi.Vector3d(light.axis) + mi.Vector3d(light.axis_low)
    if light.kind == "directional":
        return mi.Vector3d(light.face.across), mi.Vector3d(light.face.up), axis
    # Any vector that is not parallel to the axis will do to start from.
    helper = dr.select(dr.abs(axis.x) < 0.5, type(axis)(1, 0, 0), type(axis)(0, 1, 0))
    across = dr.normalize(dr.cross(helper, axis))
    square = mi.Float64(light.cone.square_sin) + mi.Float64(light.cone.square_sin_low)
    scale = dr.sqrt(square / (1 - square))
    return across * scale, dr.cross(axis, across) * scale, axis


def cube_direction(Vector, face, u, v):
    """Return the direction through (u, v) of a face of a cube, not of unit length.

    Face 2k looks along +axis k, face 2k + 1 along -axis k; u and v go along the next two axes.
    """
    sign = dr.select((face & 1) == 0, type(u)(1), type(u)(-1))
    axis = face >> 1
    return dr.select(axis == 0, Vector(sign, u, v), dr.select(axis == 1, Vector(v, sign, u), Vector(u, v, sign)))


def cube_coordinates(d):
    """Return the face of a cube that a direction goes through, and u and v there."""
    size = dr.abs(d)
    x_major = (size.x >= size.y) & (size.x >= size.z)
    y_major = ~x_major & (size.y >= size.z)
    major = dr.select(x_major, d.x, dr.select(y_major, d.y, d.z))
    inverse = dr.rcp(dr.abs(major))
    u = dr.select(x_major, d.y, dr.select(y_major, d.z, d.x)) * inverse
    v = dr.select(x_major, d.z, dr.select(y_major, d.x, d.y)) * inverse
    axis = dr.select(x_major, mi.UInt32(0), dr.select(y_major, mi.UInt32(1), mi.UInt32(2)))
    return 2 * axis + dr.select(major < 0, mi.UInt32(1), mi.UInt32(0)), u, v
