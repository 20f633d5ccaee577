# SPDX-License-Identifier: BSD-3-Clause
"""Where rays cross the boundaries of clouds of any shape.

**The boundaries of all clouds of a scene:** a Mitsuba scene to cast rays at, and a table of normals.

**Crossings of rays with the boundaries of clouds, one after the other, and what follows from them.**

A stretch of a ray between two crossings lies in a cloud if and only if the ray leaves one at its end. The start of
the ray need not be known, and a crossing that rounding hides, or shows twice, costs a stretch of its own length: the
sum over the stretches is right to the rounding of a distance.

Rays are cast in float32, from the last crossing on. A stretch that is shorter than the step beyond it, 4e-6 of the
distance and of the coordinates, is not seen.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.numerics.array_types import Metres, PerRay, aligned_array, four_numbers
from realtime.scene.closed_mesh import shape_number
from realtime.scene.mesh_adjacency import mesh_triangles, scene_of
from realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class CloudSurfaces:
    """The boundaries of clouds; part of the state of a method, so that recorded functions take it as it is."""

    geometry: Any  #: an `mi.Scene` of the boundaries alone
    first: Any  #: by number of the shape in Mitsuba's registry, its first row of `facets`
    cloud: Any  #: by that number, the number of the cloud in `Medium.clouds`
    facets: Any  #: four numbers each: the outward unit normal of a triangle and 0, or the centre of a sphere [m] and 1
    spheres: bool  #: whether there are any
    several: bool  #: whether there is more than one cloud


def cloud_surfaces(scene: Scene) -> CloudSurfaces:
    """Return the boundaries of the clouds of a scene; it must have `Medium.clouds`."""
    shapes = scene.boundaries
    rows = [_rows(shape) for shape in shapes]
    numbers = [shape_number(shape) for shape in shapes]
    first, cloud = np.zeros(max(numbers) + 1, dtype=np.uint32), np.zeros(max(numbers) + 1, dtype=np.uint32)
    first[numbers] = np.cumsum([0] + [len(own) for own in rows[:-1]])
    cloud[numbers] = np.arange(len(shapes))
    facets = aligned_array(mi.Float, np.concatenate(rows).ravel())
    spheres = not all(shape.is_mesh() for shape in shapes)
    firsts, clouds = (aligned_array(mi.UInt32, values) for values in (first, cloud))
    surfaces = CloudSurfaces(scene_of(shapes), firsts, clouds, facets, spheres, len(shapes) > 1)
    dr.make_opaque(surfaces.first, surfaces.cloud, surfaces.facets)
    return surfaces


def outward_normal(surfaces: CloudSurfaces, hit, point, active):
    """Return the outward unit normals where `hit`, a preliminary intersection, meets a boundary at a `point` [m]."""
    row = mi.UInt32(0)
    if surfaces.several:
        row = dr.gather(mi.UInt32, surfaces.first, dr.reinterpret_array(mi.UInt32, hit.shape), active)
    if not surfaces.spheres:
        x, y, z, _ = dr.gather(four_numbers(mi.Float), surfaces.facets, row + hit.prim_index, active)
        return mi.Vector3f(x, y, z)
    ball = dr.gather(four_numbers(mi.Float), surfaces.facets, row, active).w > 0
    x, y, z, _ = dr.gather(four_numbers(mi.Float), surfaces.facets, row + dr.select(ball, 0, hit.prim_index), active)
    normal = mi.Vector3f(x, y, z)
    return dr.select(ball, dr.normalize(point - normal), normal)


def _rows(shape):
    """Return the rows of a shape, (rows, 4)."""
    if not shape.is_mesh():  # a sphere
        box = shape.bbox()
        centre = 0.5 * (np.array(box.min, dtype=np.float64).ravel() + np.array(box.max, dtype=np.float64).ravel())
        return np.array([[*centre, 1.0]])
    vertices, faces = mesh_triangles(shape)
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    area *= -1.0 if shape.has_flipped_normals() else 1.0
    length = np.linalg.norm(area, axis=1, keepdims=True)
    normals = np.divide(area, length, out=np.zeros_like(area), where=length > 0)
    return np.column_stack([normals, np.zeros(len(normals))])


_STEP = 4e-6  # beyond a crossing, of the distance and of the largest coordinate


@dataclass(frozen=True)
class Crossing:
    """Where rays next meet a boundary."""

    distance: Metres  #: from the origin, infinite where there is no boundary any more [m]
    leaves: PerRay  #: whether the stretch before it lies in a cloud
    cloud: PerRay  #: the number of the cloud that is left or entered; 0 where there is none
    normal: PerRay  #: outward unit normal of the boundary


def next_crossing(surfaces: CloudSurfaces, origin, direction, x, active=True) -> Crossing:
    """Return the first crossing beyond a distance.

    `surfaces`: the boundaries of clouds; `origin`, `direction`: rays in any precision [m] and their unit directions;
    `x`: distance of the last crossing, or 0 [m]; `active`: lanes to compute. Returns `crossing`: its distance is larger
    than `x`.
    """
    Float = type(x)
    size = dr.maximum(dr.maximum(dr.abs(origin.x), dr.abs(origin.y)), dr.abs(origin.z))
    begin = dr.select(x > 0, x + _STEP * (x + size), 0)
    start = mi.Point3f(origin + direction * begin)
    # Camera rays and segments side by side start close together and go alike: told so, Embree takes a third of the
    # time.
    ray = mi.Ray3f(start, mi.Vector3f(direction))
    hit = surfaces.geometry.ray_intersect_preliminary(ray, coherent=True, active=active)
    valid = hit.is_valid() & active
    t = dr.select(valid, hit.t, 0)
    normal = outward_normal(surfaces, hit, start + mi.Vector3f(direction) * t, valid)
    cloud = mi.UInt32(0)
    if surfaces.several:
        cloud = dr.gather(mi.UInt32, surfaces.cloud, dr.reinterpret_array(mi.UInt32, hit.shape), valid)
    return Crossing(
        dr.select(valid, begin + Float(t), dr.inf),
        valid & (dr.dot(normal, mi.Vector3f(direction)) > 0),
        cloud,
        normal,
    )
