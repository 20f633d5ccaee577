# SPDX-License-Identifier: BSD-3-Clause
"""Distances along straight lines in float64: to convex bounds without cancellation,
and to the visible surface.

The visible surface is the triangle or sphere that a ray cast in float32 has met.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.convex_bounds import Bounds, Polyhedron, Sphere
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.scene.shapes import Disks, Shapes, is_rectangle, read_shapes

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def crossings(bounds: Bounds, origin: Array, direction: Array) -> tuple[Array, Array]:
    """Return where rays enter and leave a body.

    `bounds`: the body; `origin`: (n, 3), or (3,) for one that all share [m]; `direction`: unit
    vectors, (n, 3). Returns `enter`, `leave`: distances along the whole straight line, (n,) [m];
    leave <= enter where it misses the body.
    """
    if isinstance(bounds, Sphere):
        return sphere_crossings(
            np.sum((bounds.centre - origin) * direction, axis=-1), _power(bounds, origin)
        )
    return crossed_facets(bounds, origin, direction)[2:]


def crossed_facets(
    bounds: Polyhedron, origin: Array, direction: Array
) -> tuple[Index, Index, Array, Array]:
    """Return the facets at which rays enter and leave a polyhedron, and the
    distances, as `crossings` does.

    `bounds`: the polyhedron; `origin`, `direction`: as in `crossings`. Returns the numbers of the
    facets at which lines enter and leave, (n,) each, and the distances along the whole straight
    line, (n,) each [m]; leave <= enter where it misses the polyhedron.
    """
    origin = np.atleast_2d(origin)
    enter, leave = np.empty(len(direction), np.int64), np.empty(len(direction), np.int64)
    low, high = np.empty(len(direction)), np.empty(len(direction))
    step = max(1, (1 << 21) // len(bounds.offset))  # rays: 2^21 numbers of rays and facets at once
    for first in range(0, len(direction), step):
        block = slice(first, first + step)
        rate = direction[block] @ bounds.normal.T
        room = bounds.offset - (origin if len(origin) == 1 else origin[block]) @ bounds.normal.T
        with np.errstate(divide="ignore", invalid="ignore"):
            times = room / rate
        # A convex body is entered at the last facet that faces the ray, and left at the first facet
        # that faces away.
        entering, leaving = np.where(rate < 0, times, -np.inf), np.where(rate > 0, times, np.inf)
        enter[block], leave[block] = np.argmax(entering, axis=1), np.argmin(leaving, axis=1)
        missed = np.any((rate == 0) & (room < 0), axis=1)  # outside along one of the planes
        low[block] = np.where(missed, np.inf, np.max(entering, axis=1))
        high[block] = np.where(missed, -np.inf, np.min(leaving, axis=1))
    return enter, leave, low, high


def sphere_crossings(along: Array, power: Array | float) -> tuple[Array, Array]:
    """Return where lines enter and leave a sphere, the roots of t^2 - 2 along t + power,
    +-inf where they miss it [m].

    The product of both roots is the power: the root of smaller size is the power over the other
    root, without cancellation.

    `along`: direction . (centre - origin), (n,) [m], for a unit direction. `power`: |centre -
    origin|^2 - radius^2, the power of the origin, (n,) or a scalar [m^2]. Returns `low`, `high`:
    (n,) each [m].
    """
    inner = along * along - power
    root = np.sqrt(np.maximum(inner, 0.0))
    # The root of larger size has no cancellation; the other one is the power divided by it.
    far = np.where(along >= 0, along + root, along - root)
    with np.errstate(divide="ignore", invalid="ignore"):
        near = np.where(far != 0, power / far, 0.0)
    low, high = np.where(along >= 0, near, far), np.where(along >= 0, far, near)
    return np.where(inner > 0, low, np.inf), np.where(inner > 0, high, -np.inf)


def _power(sphere: Sphere, origin: Array) -> Array:
    return np.sum((sphere.centre - origin) ** 2, axis=-1) - sphere.radius**2


def half_chord(radius: Array | float, distance: Array) -> Array:
    """Return half of the chord at a distance from a disk's centre, sqrt(radius^2 -
    distance^2); 0 beyond the radius.

    `radius`: of the disk, (n,) or a scalar [m]; `distance`: of the chord from the centre, (n,) [m],
    at least 0. Returns (n,) [m], without cancellation where both are alike.
    """
    return np.sqrt(np.maximum(radius - distance, 0) * (radius + distance))


def exact_distance(
    reference: ReferenceScene,
    interaction: "mi.SurfaceInteraction3f",
    distance: Array,
    shapes: Shapes | None = None,
) -> Array:
    """Return the distances to visible surfaces that are flat or spheres again, in float64.

    `reference`: the scene, whose rays were cast; `interaction`: where they meet surfaces, with the
    triangle that each ray met; `distance`: the distances that were cast, (rays,), infinite where
    nothing is hit [m]; `shapes`: the result of `read_shapes`, by default read here.

    Valid where a ray meets its triangle or disk in float64 too, or the plane of it within 1e-4 of
    the distance; elsewhere, beside edges seen edge-on, the distance stays what it was. It also
    stays on spheres that a ray misses in float64, which happens at tangents.
    """
    hit = np.isfinite(distance)
    shape_of_hit = np.array(dr.reinterpret_array(mi.UInt32, interaction.shape))
    primitive = np.array(interaction.prim_index, dtype=np.int64)
    refined = distance.copy()
    for shape, part in (shapes or read_shapes(reference.occluders)).single:
        # Mitsuba tells the shape of a hit by a pointer, whose bits are its number.
        number = np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))).item()
        # The rays that have met this shape.
        ray = np.flatnonzero(hit & (shape_of_hit == number))
        if not len(ray):
            continue
        direction, cast = reference.direction[ray], distance[ray]
        if isinstance(part, Sphere):
            refined[ray] = _to_sphere(part, reference.origin, direction, cast)
        elif isinstance(part, Disks):
            refined[ray] = _to_disk(part, reference.origin, direction, cast)
        else:
            # A rectangle counts as one primitive, of four corners.
            corners = np.append(part[0], part[1, 2:], axis=0)[None] if is_rectangle(shape) else part
            own = corners[0 * ray if is_rectangle(shape) else primitive[ray]]
            refined[ray] = to_plane(own - reference.origin, direction, cast)
    return refined


def to_plane(corner: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to the planes of polygons, (rays,) [m]; for rays that graze the plane
    beside the polygon the given distance.

    `corner`: of convex polygons, from the origin of the rays, (rays, corners, 3) [m]; `direction`:
    unit vectors, (rays, 3); `distance`: as it was cast, (rays,) [m].
    """
    # A line that has all sides on the same hand meets the polygon.
    side = np.cross(corner, np.roll(corner, -1, axis=1))
    hand = np.sum(side * direction[:, None], axis=2)
    meets = np.all(hand > 0, axis=1) | np.all(hand < 0, axis=1)
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return _chosen(_along(corner[:, 0], normal, direction), meets, distance)


def _to_disk(disk: Disks, origin: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to a disk, as `to_plane` does."""
    centre = disk.centre - origin
    exact = _along(centre, disk.normal, direction)
    with np.errstate(invalid="ignore"):  # infinite on a ray parallel to the disk
        beside = np.linalg.norm(exact[:, None] * direction - centre, axis=1)
    return _chosen(exact, beside < disk.radius, distance)


def _along(place: Array, normal: Array, direction: Array) -> Array:
    """Return how far rays go to planes through places."""
    with np.errstate(divide="ignore", invalid="ignore"):
        exact: Array = np.sum(normal * place, axis=1) / np.sum(normal * direction, axis=1)
    return exact


def _chosen(exact: Array, meets: NDArray[np.bool_], distance: Array) -> Array:
    """Return the exact distances of rays that meet their shape, and where these are within 1e-4 of
    the cast ones; else the cast ones.
    """
    # For a grazing ray beside the shape the exact one is the quotient of two small numbers.
    near = np.abs(exact - distance) < 1e-4 * distance
    return np.where(near | (meets & (exact > 0)), exact, distance)


def _to_sphere(sphere: Sphere, origin: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to where they enter a sphere, or leave it if they start inside."""
    centre = sphere.centre - origin
    middle = direction @ centre
    miss = np.linalg.norm(centre - middle[:, None] * direction, axis=1)
    half = half_chord(sphere.radius, miss)
    inside = np.linalg.norm(centre) < sphere.radius
    return np.where(miss < sphere.radius, middle + half if inside else middle - half, distance)
