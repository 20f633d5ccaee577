# SPDX-License-Identifier: BSD-3-Clause
"""The first and the last surface of a cloud along parallel light, and the normal of the first, in plain arrays.

The rectangle of a directional light is cut into size^2 texels, and a ray goes through the middle of each: from before
the rectangle's shapes to the first surface, and from behind back to the last. Heights are those of
`realtime.shadow_maps.projection`: above the rectangle where the media end, so that the lit side is the higher one and
height falls along the light.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.scene.lights import Light
from realtime.shadow_maps.shadow_map import check_size, texel_rays


@dataclass(frozen=True)
class LitSurfaces:
    """What rays along the light meet of a cloud, in squares of 4 x 4 texels."""

    size: int  #: texels on a side
    place: Any  #: number of the texel of each ray, row by row
    there: Any  #: whether the ray meets the cloud
    front: Any  #: height of the first surface, 0 where there is none [m]
    back: Any  #: height of the last surface, 0 where there is none [m]
    normal: Any  #: outward unit normal of the first surface, towards the light; 0 where there is none


def cast_surfaces(cloud, light: Light, size: int) -> LitSurfaces:
    """Cast both rays of every texel; nothing is evaluated, so that what reads it is computed with it.

    `cloud`: a Mitsuba scene of the cloud's boundary alone; `light`: a directional light, with an extent that holds the
    cloud; `size`: texels on a side, a power of two. Raises InputError if `size` is not a power of two from 4 to 8192.
    """
    check_size(size)
    Float, Vector = type(light.position.x), type(light.position)
    start, axis, texel = texel_rays(light, size)
    depth = mi.Float64(light.extent.depth)
    first = mi.Ray3f(mi.Point3f(start), mi.Vector3f(axis))
    last = mi.Ray3f(mi.Point3f(start + axis * depth), mi.Vector3f(-axis))
    hit = cloud.ray_intersect(first, mi.RayFlags.Minimal, True)
    behind = cloud.ray_intersect_preliminary(last, coherent=True, active=hit.is_valid())
    # At a silhouette one of both rays may slip past: there is no cloud of any thickness.
    there = hit.is_valid() & behind.is_valid()
    front, back = dr.select(there, Float(depth) - Float(hit.t), 0), dr.select(there, Float(behind.t), 0)
    along = dr.dot(hit.n, mi.Vector3f(axis))
    normal = Vector(dr.select(there, dr.select(along > 0, -hit.n, hit.n), 0))
    return LitSurfaces(size, texel, there, front, back, normal)
