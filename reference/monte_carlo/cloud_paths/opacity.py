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
    depth, distance = np.zeros((count, 3)), np.full(count, np.inf)
    passed, cast, meets = np.zeros(count), np.zeros(count), np.zeros(count, dtype=bool)
    inside = np.full(count, clouds.camera_cloud)
    left = np.arange(count)
    extinction = np.stack([cloud.sigma_t for cloud in clouds.clouds])
    corners = [
        triangles_of(cloud.shape) if cloud.shape.is_mesh() else None for cloud in clouds.clouds
    ]
    reach = float(np.abs(np.array([clouds.scene.bbox().min, clouds.scene.bbox().max])).max())
    step = 4e-7 * max(reach, float(np.abs(clouds.origin).max()))
    while left.size:
        way = clouds.direction[left]
        start = cast[left]
        ray = mi.Ray3f(mi.Point3f((clouds.origin + start[:, None] * way).T), mi.Vector3f(way.T))
        si = clouds.scene.ray_intersect(ray)
        dr.eval(si)
        shape = np.array(dr.reinterpret_array(mi.UInt32, si.shape))
        hit = np.array(si.is_valid(), dtype=bool)
        left, way, start = left[hit], way[hit], start[hit]
        meets[left] = True
        length = start + np.array(si.t, dtype=np.float64)[hit]
        cast[left] = length + step
        face = np.array(si.prim_index, dtype=np.int64)[hit]
        leaves = (np.array(si.n, dtype=np.float64).T[hit] * way).sum(axis=1) > 0
        opaque = np.ones(len(left), dtype=bool)
        within = inside[left]
        for number, cloud in enumerate(clouds.clouds):
            on = (shape == np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(cloud.shape))))[hit]
            opaque &= ~on
            triangles = corners[number]
            if triangles is not None:
                length[on] = to_plane(triangles[face[on]] - clouds.origin, way[on], length[on])
            within = np.where(on, np.where(leaves, number, -1), within)
            inside[left[on]] = np.where(leaves[on], -1, number)
        stretch = np.maximum(length - passed[left], 0.0)
        for number, cloud in enumerate(clouds.clouds):
            own = within == number
            if cloud.density is not None:
                stretch[own] = cloud.density.along(
                    clouds.origin, way[own], passed[left][own], stretch[own]
                )
        depth[left] += np.where(within[:, None] >= 0, extinction[within] * stretch[:, None], 0.0)
        passed[left] = np.maximum(length, passed[left])
        distance[left[opaque]] = length[opaque]
        left = left[~opaque]
    return SeenClouds(np.exp(-depth), distance, meets)
