# SPDX-License-Identifier: BSD-3-Clause
"""How much clouds let through along the pixel-centre rays, up to the visible surface or to
infinity, without samples.

Mitsuba's ray casts find the triangles that a ray crosses; where it crosses their planes is computed
in float64. A stretch lies in a cloud if it ends at a face of it seen from inside, as in the walk.
Densities are summed up by small steps.
"""

from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.clouds import CloudScene
from airlight.reference.scene.shapes import triangles_of
from airlight.reference.visibility.distances import to_plane

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SeenClouds:
    """The clouds and surfaces on the pixel-centre rays."""

    transmittance: Array  #: of all clouds up to the visible surface, or to infinity, (pixels, 3)
    distance: Array  #: to the visible surface, infinite where there is none, (pixels,) [m]
    meets: NDArray[np.bool_]  #: whether there is a cloud or a surface, (pixels,)


def seen_clouds(clouds: CloudScene) -> SeenClouds:
    """Follow the pixel-centre rays of a scene."""
    count = len(clouds.direction)
    # `passed` is the distance up to which the depth of each ray is summed; `cast` is where its next
    # ray cast starts, a little behind the last crossing.
    depth, distance = np.zeros((count, 3)), np.full(count, np.inf)
    passed, cast, meets = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
    inside = np.full(count, clouds.camera_cloud)
    active = np.arange(count)
    extinction = np.stack([cloud.sigma_t for cloud in clouds.clouds])
    corners = [
        triangles_of(cloud.shape) if cloud.shape.is_mesh() else None for cloud in clouds.clouds
    ]
    reach = float(np.abs(np.array([clouds.bodies.bbox().min, clouds.bodies.bbox().max])).max())
    step = 4e-7 * max(reach, float(np.abs(clouds.origin).max()))
    while active.size:
        # The next crossing of the rays that have not met an opaque surface yet.
        way = clouds.direction[active]
        start = cast[active]
        ray = mi.Ray3f(mi.Point3f((clouds.origin + start[:, None] * way).T), mi.Vector3f(way.T))
        si = clouds.bodies.ray_intersect(ray)
        dr.eval(si)
        shape = np.array(dr.reinterpret_array(mi.UInt32, si.shape))
        hit = np.array(si.is_valid(), dtype=bool)
        active, way, start = active[hit], way[hit], start[hit]
        meets[active] = True
        # The distance of the crossing from the camera: first as float32 says, then again in float64
        # where the shape is a mesh.
        length = start + np.array(si.t, dtype=np.float64)[hit]
        cast[active] = length + step
        face = np.array(si.prim_index, dtype=np.int64)[hit]
        leaves = (np.array(si.n, dtype=np.float64).T[hit] * way).sum(axis=1) > 0
        opaque = np.ones(len(active), dtype=bool)
        # A face seen from inside ends a stretch in its cloud, one seen from outside a stretch in
        # vacuum. A stretch that ends at an opaque surface is in the medium that the last crossing
        # named.
        within = inside[active]
        for number, cloud in enumerate(clouds.clouds):
            on = (shape == np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(cloud.shape))))[hit]
            opaque &= ~on
            triangles = corners[number]
            if triangles is not None:
                length[on] = to_plane(triangles[face[on]] - clouds.origin, way[on], length[on])
            within = np.where(on, np.where(leaves, number, -1), within)
            inside[active[on]] = np.where(leaves[on], -1, number)
        # Two crossings that rounding swaps leave a stretch of length 0.
        stretch = np.maximum(length - passed[active], 0.0)
        for number, cloud in enumerate(clouds.clouds):
            # In a cloud with a density the length is weighted by the extinction over the largest
            # one.
            in_cloud = within == number
            if cloud.density is not None:
                stretch[in_cloud] = cloud.density.along(
                    clouds.origin, way[in_cloud], passed[active][in_cloud], stretch[in_cloud]
                )
        depth[active] += np.where(within[:, None] >= 0, extinction[within] * stretch[:, None], 0.0)
        passed[active] = np.maximum(length, passed[active])
        distance[active[opaque]] = length[opaque]
        active = active[~opaque]
    return SeenClouds(np.exp(-depth), distance, meets)
