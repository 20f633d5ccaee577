# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps by ray casting into plain arrays: one face for a spot, six for a point light.

A map stores for each texel the distance *along the ray* from the light to the first surface [m], infinite where there
is none. A face looks along one axis with two others across; (u, v) in [-1, 1] on the plane at distance `extent` from
the light, 1 for a cube face, 1/tan(cutoff) for a spot whose cone just fits.
"""

from dataclasses import dataclass
from typing import Any

from realtime.errors import InputError
from realtime.lights import Light


@dataclass(frozen=True)
class ShadowMap:
    """Distances from a light to the nearest surface, face by face, row by row."""

    size: int  #: texels on a side
    distance: Any  #: faces size^2 values along the rays [m]
    frame: tuple[
        Any, Any, Any
    ]  #: spot: across, up and axis, scaled so that the cone spans [-1, 1]; a cube: unit vectors


def cast_shadow_map(scene, light: Light, size: int) -> ShadowMap:
    """Cast the shadow map of one light.

    Parameters
    ----------
    scene
        The Mitsuba scene that holds the occluders.
    light
        A point or spot light.
    size
        Texels on a side, a power of two.

    Raises
    ------
    InputError
        If `size` is not a power of two from 4 to 8192.
    """
    import drjit as dr
    import mitsuba as mi

    if not isinstance(size, int) or size < 4 or size > 8192 or size & (size - 1):
        raise InputError(f"map: got {size!r}, wanted a power of two from 4 to 8192")
    Float = type(light.position.x)
    faces = 6 if light.kind == "point" else 1
    index = dr.arange(mi.UInt32, faces * size * size)
    face, texel = index // (size * size), index % (size * size)
    u = dr.fma(Float(texel % size), 2.0 / size, 1.0 / size - 1.0)
    v = dr.fma(Float(texel // size), 2.0 / size, 1.0 / size - 1.0)
    frame = _frame(light)
    if light.kind == "point":
        direction = _cube_direction(type(light.position), face, u, v)
    else:
        direction = frame[0] * u + frame[1] * v + frame[2]
    ray = mi.Ray3f(mi.Point3f(light.position), mi.Vector3f(dr.normalize(direction)))
    hit = scene.ray_intersect_preliminary(ray, coherent=True)
    return ShadowMap(size, dr.select(hit.is_valid(), Float(hit.t), dr.inf), frame)


def lit_in_map(shadow_map: ShadowMap, light: Light, point):
    """Return whether the light reaches a point by the nearest texel of its shadow map."""
    import drjit as dr
    import mitsuba as mi

    Float = type(point.x)
    d = point - light.position
    if light.kind == "point":
        face, u, v = _cube_coordinates(d)
    else:
        across, up, axis = shadow_map.frame
        depth = dr.rcp(dr.dot(d, axis))
        u, v = dr.dot(d, across) * depth / dr.squared_norm(across), dr.dot(d, up) * depth / dr.squared_norm(up)
        face = mi.UInt32(0)
    size = shadow_map.size
    column = mi.UInt32(dr.clip((u + 1) * (0.5 * size), 0, size - 1))
    row = mi.UInt32(dr.clip((v + 1) * (0.5 * size), 0, size - 1))
    stored = dr.gather(Float, shadow_map.distance, (face * size + row) * size + column)
    return dr.squared_norm(d) <= dr.square(stored)


def _frame(light: Light):
    """Return two vectors across and one along a spot's axis; the two are scaled by tan(cutoff)."""
    import drjit as dr

    if light.kind == "point":
        Vector = type(light.position)
        return Vector(1, 0, 0), Vector(0, 1, 0), Vector(0, 0, 1)
    axis = light.axis
    # Any vector that is not parallel to the axis will do to start from.
    helper = dr.select(dr.abs(axis.x) < 0.5, type(axis)(1, 0, 0), type(axis)(0, 1, 0))
    across = dr.normalize(dr.cross(helper, axis))
    scale = dr.tan(light.cutoff)
    return across * scale, dr.cross(axis, across) * scale, axis


def _cube_direction(Vector, face, u, v):
    """Face 2k looks along +axis k, face 2k + 1 along -axis k; u and v go along the next two axes."""
    import drjit as dr

    sign = dr.select((face & 1) == 0, type(u)(1), type(u)(-1))
    axis = face >> 1
    return dr.select(axis == 0, Vector(sign, u, v), dr.select(axis == 1, Vector(v, sign, u), Vector(u, v, sign)))


def _cube_coordinates(d):
    import drjit as dr
    import mitsuba as mi

    size = dr.abs(d)
    x_major = (size.x >= size.y) & (size.x >= size.z)
    y_major = ~x_major & (size.y >= size.z)
    major = dr.select(x_major, d.x, dr.select(y_major, d.y, d.z))
    inverse = dr.rcp(dr.abs(major))
    u = dr.select(x_major, d.y, dr.select(y_major, d.z, d.x)) * inverse
    v = dr.select(x_major, d.z, dr.select(y_major, d.x, d.y)) * inverse
    axis = dr.select(x_major, mi.UInt32(0), dr.select(y_major, mi.UInt32(1), mi.UInt32(2)))
    return 2 * axis + dr.select(major < 0, mi.UInt32(1), mi.UInt32(0)), u, v
