# SPDX-License-Identifier: BSD-3-Clause
"""Distances to the visible surface in float64, from the triangle or sphere that a ray cast in float32 has met."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.scene.convex_bounds import Sphere
from reference.scene.read import ReferenceScene
from reference.scene.shapes import Disks, Shapes, is_rectangle, read_shapes
from reference.visibility.line_crossings import half_chord

Array = NDArray[np.float64]


def exact_distance(reference: ReferenceScene, interaction: Any, distance: Array, shapes: Shapes | None = None) -> Array:
    """Return the distances to the visible surface again in float64, where that is flat or a sphere.

    `reference`: the scene; its rays are those that were cast; `interaction`: Mitsuba's surface interactions: which
    triangle each ray met; `distance`: the distances that were found, (rays,), infinite where nothing is hit [m];
    `shapes`: what `read_shapes` returned, if known.

    Valid where the plane of the triangle is met within 1e-4 of the distance; elsewhere, on triangles seen edge-on, the
    distance stays what it was. It also stays on spheres that a ray misses in float64, which happens at tangents.
    """
    hit = np.isfinite(distance)
    shape_of_hit = np.array(dr.reinterpret_array(mi.UInt32, interaction.shape))
    primitive = np.array(interaction.prim_index, dtype=np.int64)
    refined = distance.copy()
    for shape, part in (shapes or read_shapes(reference.occluders)).single:
        number = np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))).item()
        mine = np.flatnonzero(hit & (shape_of_hit == number))
        if not len(mine):
            continue
        if isinstance(part, Sphere):
            refined[mine] = _to_sphere(part, reference.origin, reference.direction[mine], distance[mine])
            continue
        if isinstance(part, Disks):
            refined[mine] = _along(
                part.centre - reference.origin, part.normal, reference.direction[mine], distance[mine]
            )
            continue
        # A rectangle counts as one primitive; both its triangles lie in one plane.
        number_in_shape = 0 * mine if is_rectangle(shape) else primitive[mine]
        refined[mine] = to_plane(part[number_in_shape] - reference.origin, reference.direction[mine], distance[mine])
    return refined


def to_plane(corner: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays from the origin go to the planes of triangles, (rays, 3, 3) [m]; where they graze, as given.

    `corner`: from where rays start; `direction`: unit vectors, (rays, 3); `distance`: as it was cast, (rays,) [m].
    """
    return _along(corner[:, 0], np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0]), direction, distance)


def _along(place: Array, normal: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to planes through places."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.sum(normal * place, axis=1) / np.sum(normal * direction, axis=1)
    return np.where(np.abs(exact - distance) < 1e-4 * distance, exact, distance)


def _to_sphere(sphere: Sphere, origin: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to where they enter a sphere, or leave it if they start inside."""
    centre = sphere.centre - origin
    middle = direction @ centre
    miss = np.linalg.norm(centre - middle[:, None] * direction, axis=1)
    half = half_chord(sphere.radius, miss)
    inside = np.linalg.norm(centre) < sphere.radius
    return np.where(miss < sphere.radius, middle + half if inside else middle - half, distance)
