# SPDX-License-Identifier: BSD-3-Clause
"""Media in convex bounds along rays, in float64: segments, optical depths, and where
shadow segments have kinks.

The bodies are disjoint, so the optical depth between two points of a ray is

    tau = sigma_0 l + sum_j (sigma_j - sigma_0) l_j,

l the distance, l_j what lies in body j, sigma_0 the extinction of what surrounds the bodies. A body
holds one interval [enter, leave] of a straight line; l_j is the part of it between the points.

In the plane of a ray and a light (`reference.visibility.planes`) a body is a convex polygon or a
disk, and as x moves along the ray, the part of the shadow segment in it is an analytic function of
x until the segment passes a corner of the polygon, or becomes a tangent of the disk. Such a point
(z, y) matters only between ray and light, and the segment passes it at the x to which the map of
the plane takes it.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.convex_bounds import Bounds, Polyhedron, Sphere
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.visibility.distances import crossings, half_chord
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]

AMBIENT = -1  #: number of the medium without bounds among the media of a scene


@dataclass(frozen=True)
class Segments:
    """The parts of rays and their media; arrays of shape (slots, rays), empty
    parts have start >= end.
    """

    start: Array  #: distance from the origin [m]
    end: Array  #: may be infinite [m]
    medium: Index  #: number in `ReferenceScene.media`, or `AMBIENT`


def depth_through_media(
    reference: ReferenceScene, origin: Array, direction: Array, low: Array, high: Array
) -> Array:
    """Return the optical depth of parts of rays where all media are homogeneous.

    `reference`: the scene; `origin`: (n, 3), or (3,) for one that all share [m]; `direction`: unit
    vectors, (n, 3); `low`, `high`: distances of the ends from the origin, (n,), finite [m]. Returns
    `tau`: optical depth of each channel, (n, 3), 0 where high <= low.

    Valid for any points, inside or outside of the media.
    """
    # tau of the derivation: the medium around over all of the part, then what each body differs
    # from it over what lies in the body.
    total = np.maximum(high - low, 0.0)[:, None] * reference.medium.sigma_t
    for medium in reference.media:
        enter, leave = crossings(medium.bounds, origin, direction)
        inside = np.maximum(np.minimum(leave, high) - np.maximum(enter, low), 0.0)
        total += inside[:, None] * (medium.sigma_t - reference.medium.sigma_t)
    # A body thinner than the medium around it leaves a difference, which rounding may turn
    # negative.
    return np.maximum(total, 0.0)


def camera_segments(reference: ReferenceScene, distance: Array) -> Segments:
    """Return the parts of the camera rays before `distance`, (pixels,) [m], that
    lie in media that scatter.

    The slots of a ray hold the bodies in the order in which it passes them, and what lies
    before, between and behind.
    """
    spans = [
        crossings(medium.bounds, reference.origin, reference.direction)
        for medium in reference.media
    ]
    enter, leave = np.array(spans).reshape(len(spans), 2, len(distance)).swapaxes(0, 1)
    enter, leave = np.maximum(enter, 0.0), np.minimum(leave, distance)
    # Bodies that a ray misses come last, as nothing at the end of the ray.
    enter, leave = (
        np.where(enter < leave, enter, distance),
        np.where(enter < leave, leave, distance),
    )
    order = np.argsort(enter, axis=0, kind="stable")
    enter, leave = (
        np.take_along_axis(enter, order, axis=0),
        np.take_along_axis(leave, order, axis=0),
    )
    # In vacuum, or in a medium that only absorbs, nothing between the bodies scatters.
    if not np.any(reference.medium.sigma_t * reference.medium.albedo > 0):
        return Segments(enter, leave, order)
    # The medium around fills the gaps: from the camera to the first body, and from where each body
    # is left to where the next is entered, or to the end of the ray.
    start = np.concatenate([np.zeros((1, len(distance))), leave, enter])
    end = np.concatenate([enter, distance[None], leave])
    between = np.full((len(order) + 1, len(distance)), AMBIENT)
    return Segments(start, end, np.concatenate([between, order]))


def scattering_range(segments: Segments) -> tuple[Array, Array]:
    """Return the first and the last distance of each ray at which a medium scatters,
    (rays,) [m]; low >= high: none.
    """
    empty = segments.start >= segments.end
    low = np.min(np.where(empty, np.inf, segments.start), axis=0)
    high = np.max(np.where(empty, -np.inf, segments.end), axis=0)
    return low, high


def shadow_kinks(bounds: Bounds, rays: Rays) -> tuple[Index, Array]:
    """Return where on rays the shadow segment has kinks: where it passes a corner
    of a body or touches it.

    `bounds`: the body; `rays`: the rays in their planes with lights. Returns `ray`, `x`: number of
    the ray and distance of each kink [m], in no particular order.
    """
    block = 1 << 21  # numbers at once: of rays, or of rays times edges
    if isinstance(bounds, Sphere):
        find, step = partial(_tangents, bounds), block
    else:
        find, step = partial(_corners, bounds), max(1, block // max(1, len(bounds.edge)))
    numbers, distances = [np.empty(0, np.int64)], [np.empty(0)]
    for first in range(0, len(rays.foot), step):
        part = rays[first : first + step]
        ray, z, y = find(part)
        foot, height = part.foot[ray], part.height[ray]
        # The map of the plane takes the point (z, y) to the x whose shadow segment passes it. The
        # point counts only between ray and light, 0 < y < height; a directional light is above all.
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            x = (z * height - y * foot) / (height - part.w * y)
        between = (y > 0) & (part.w * y < height) & np.isfinite(x)
        numbers.append(ray[between] + first)
        distances.append(x[between])
    return np.concatenate(numbers), np.concatenate(distances)


def _corners(body: Polyhedron, rays: Rays) -> tuple[Index, Array, Array]:
    """Return where the edges of a polyhedron meet the planes of rays and lights:
    numbers of the rays, z and y.
    """
    ends = body.edge - rays.origin
    across = -rays.normal
    normal = np.cross(rays.direction, across)
    # Which side of the plane of ray and light the ends of each edge lie on; an edge in the plane,
    # with both at 0, is left to the edges that meet it at its ends.
    at_start, at_end = normal @ ends[:, 0].T, normal @ ends[:, 1].T
    ray, edge = np.nonzero((at_start * at_end <= 0) & (at_start != at_end))
    # Where the edge meets the plane, in the coordinates of the plane: z along the ray, y across it
    # towards the light.
    fraction = (at_start[ray, edge] / (at_start[ray, edge] - at_end[ray, edge]))[:, None]
    point = ends[edge, 0] + fraction * (ends[edge, 1] - ends[edge, 0])
    return ray, np.sum(point * rays.direction[ray], axis=1), np.sum(point * across[ray], axis=1)


def _tangents(sphere: Sphere, rays: Rays) -> tuple[Index, Array, Array]:
    """Return where tangents from the lights touch the disks of a sphere
    (`reference.visibility.shadows`).
    """
    centre, across = sphere.centre - rays.origin, -rays.normal
    beside = np.cross(rays.direction, across) @ centre
    c_z, c_y = rays.direction @ centre, across @ centre
    # The plane cuts the sphere in a disk of this radius about (c_z, c_y), `beside` being the
    # distance of the centre from the plane.
    disk = half_chord(sphere.radius, np.abs(beside))
    # The way from the light to the centre of the disk, or the direction of the light if it is
    # directional. A tangent exists only if the light is outside of the disk.
    e_z, e_y = rays.w * c_z - rays.foot, rays.w * c_y - rays.height
    far = np.maximum(np.hypot(e_z, e_y), 1e-290)
    ray = np.flatnonzero((np.abs(beside) < sphere.radius) & ((disk < far) | (rays.w == 0)))
    e_z, e_y, c_z, c_y, disk = (e_z / far)[ray], (e_y / far)[ray], c_z[ray], c_y[ray], disk[ray]
    # Half the angle under which the light sees the disk: its tangents touch at disk * (-sine e -+
    # level e_across) from the centre. Under a directional light the sine is 0, and the points are
    # across the direction.
    sine = rays.w * disk / far[ray]
    level = np.sqrt((1 - sine) * (1 + sine))
    z = [c_z + disk * (-sine * e_z - sign * level * e_y) for sign in (-1, 1)]
    y = [c_y + disk * (-sine * e_y + sign * level * e_z) for sign in (-1, 1)]
    return np.tile(ray, 2), np.concatenate(z), np.concatenate(y)
