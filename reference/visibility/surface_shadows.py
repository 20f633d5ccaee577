# SPDX-License-Identifier: BSD-3-Clause
"""Which surfaces a light reaches from where Mitsuba's shadow rays start.

A shadow ray must not hit the surface that it leaves, so `SurfaceInteraction.spawn_ray_to` starts it some way off the
surface, along its normal: in single precision 1e-4 (1 + the largest coordinate) (Mitsuba 3.9, `offset_p` in
`include/mitsuba/render/interaction.h`). A point whose own shadow ray just clears an edge may then lie in the shadow,
and the other way round: shadow edges move by about that length. A renderer that starts its rays so converges to the
moved edges, as it does to the shortened leg of `reference.scene.shadow_epsilon`; one bright pixel beside an edge is
enough to be seen in the sum over an image.

Where Mitsuba's ray and the exact lit intervals differ, the ray is tested again: in float64, against every triangle and
sphere, from where Mitsuba starts it. What that says holds. So a fault of the lit intervals is still found by the
comparison, for the exact test from the moved start contradicts it then.
"""

from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.scene.shapes import Shapes

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.int64]

_CHUNK = 1 << 18  # pairs of rays and triangles tested at once
_GROUP = 32  # rays that start close together, for which the triangles are looked through once
_SLACK = 1e-9  # of how far away a triangle is: float64 rounding is 1e-15


def reached_by_shadow_rays(interaction: Any, light: Array, reached: Bools, *, scene: Any, shapes: Shapes) -> Bools:
    """Return which surfaces the light reaches from where Mitsuba starts its shadow rays.

    Parameters
    ----------
    interaction
        Mitsuba's surface interactions, one for each ray.
    light
        Position of the light (3,) [m].
    reached
        Whether it reaches the surface points themselves, by exact geometry, (rays,).
    scene
        The `mi.Scene` of the occluders.
    shapes
        The same as numbers, from `reference.scene.shapes.read_shapes`.
    """
    ray = interaction.spawn_ray_to(mi.Point3f(*(float(c) for c in light)))
    valid = np.array(interaction.is_valid(), dtype=bool)
    cast = ~np.array(scene.ray_test(ray, interaction.is_valid()), dtype=bool)
    differs = np.flatnonzero(valid & (cast != reached))
    if not len(differs):
        return reached
    start = np.array(ray.o, dtype=np.float64).T[differs]
    blocked = segments_blocked(start, start + (light - start) * _share(ray, start, light, differs), shapes)
    if shapes.others is not None:
        blocked |= np.array(shapes.others.ray_test(ray, interaction.is_valid()), dtype=bool)[differs]
    found = reached.copy()
    found[differs] = ~blocked
    return found


def _share(ray: Any, start: Array, light: Array, chosen: NDArray[np.int64]) -> Array:
    """Return how much of the way to the light the rays go, (rays, 1)."""
    length = np.array(ray.maxt, dtype=np.float64)[chosen]
    return np.minimum(length / np.linalg.norm(light - start, axis=1), 1.0)[:, None]


def segments_blocked(start: Array, end: Array, shapes: Shapes) -> Bools:
    """Return which segments meet a triangle or the surface of a sphere.

    Segments are tested one by one, against the triangles that come close to those that start beside them.

    Parameters
    ----------
    start, end
        The ends of the segments, (segments, 3) [m].
    shapes
        The triangles and spheres.

    References
    ----------
    Moeller, Trumbore 1997, *Fast, minimum storage ray-triangle intersection*, for the triangles.
    """
    way = end - start
    blocked = np.zeros(len(start), dtype=bool)
    corner = shapes.triangles[:, 0]
    edges = shapes.triangles[:, 1] - corner, shapes.triangles[:, 2] - corner
    # Spheres about the first corners; nothing of this is shared with the search for lit intervals, which it judges.
    longest = np.sqrt(np.maximum(*(np.sum(edge * edge, axis=1) for edge in edges)))
    for group in _groups(start):
        near = _near_triangles(start[group], end[group], corner, longest)
        step = max(1, _CHUNK // max(1, len(near)))
        for first in range(0, len(group), step):
            part = group[first : first + step]
            chosen = corner[near], (edges[0][near], edges[1][near])
            blocked[part] = _meets_triangle(start[part, None], way[part, None], *chosen).any(axis=1)
    for centre, radius in zip(shapes.centre, shapes.radius, strict=True):
        blocked |= _meets_sphere(start - centre, way, radius)
    return blocked


def _groups(point: Array) -> Iterator[Index]:
    """Yield the numbers of points that lie together, `_GROUP` at most: halved again and again where widest."""
    waiting = [np.arange(len(point))] if len(point) else []
    while waiting:
        part = waiting.pop()
        if len(part) <= _GROUP:
            yield part
            continue
        axis = np.argmax(np.ptp(point[part], axis=0))
        part = part[np.argsort(point[part, axis])]
        waiting += [part[: len(part) // 2], part[len(part) // 2 :]]


def _near_triangles(start: Array, end: Array, centre: Array, radius: Array) -> Index:
    """Return the triangles that some of the segments may meet, given spheres that hold the triangles.

    The distance from a line is convex along a segment, so the tube about any line that holds all ends holds all
    segments.
    """
    middle = start.mean(axis=0)
    way = end.mean(axis=0) - middle
    with np.errstate(divide="ignore", invalid="ignore"):
        line = middle, way / np.linalg.norm(way)
        tube = _from_line(np.concatenate([start, end]), *line).max()
        reach = radius + tube + _SLACK * np.linalg.norm(centre - middle, axis=1)
        beyond = _from_line(centre, *line) > reach
    return np.flatnonzero(~beyond)  # all of them where the line has no direction


def _from_line(point: Array, place: Array, direction: Array) -> Array:
    return np.linalg.norm(np.cross(point - place, direction), axis=1)


def _meets_triangle(start: Array, way: Array, corner: Array, edges: tuple[Array, Array]) -> Bools:
    """Solve start + s way = corner + u e1 + v e2 for every pair; the scalar products share the determinant."""
    one, other = edges
    across = np.cross(way, other)
    determinant = np.sum(one * across, axis=-1)
    from_corner = start - corner
    beside = np.cross(from_corner, one)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum(from_corner * across, axis=-1) / determinant
        v = np.sum(way * beside, axis=-1) / determinant
        s = np.sum(other * beside, axis=-1) / determinant
        return (u >= 0) & (v >= 0) & (u + v <= 1) & (s > 0) & (s < 1)


def _meets_sphere(from_centre: Array, way: Array, radius: float) -> Bools:
    """Return which segments cross the surface of a sphere, from outside or from within."""
    square = np.sum(way * way, axis=1)
    half = np.sum(from_centre * way, axis=1)
    outside = np.sum(from_centre * from_centre, axis=1) - radius**2
    discriminant = half**2 - square * outside
    root = np.sqrt(np.maximum(discriminant, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        near, far = (-half - root) / square, (-half + root) / square
        return (discriminant > 0) & (((near > 0) & (near < 1)) | ((far > 0) & (far < 1)))
