# SPDX-License-Identifier: BSD-3-Clause
"""Media in convex bounds along rays, in float64: segments, optical depths, and where the leg from the light has kinks.

The bodies are disjoint, so the optical depth between two points of a ray is

    tau = sigma_0 l + sum_j (sigma_j - sigma_0) l_j,

l the distance, l_j what lies in body j, sigma_0 the extinction of what surrounds the bodies. A body holds one interval
[enter, leave] of a straight line; l_j is the part of it between the points.

Seen from a light, the point x on a camera ray lies at the angle theta in the plane of ray and light (see
`analytic.geometry`). In that plane a body is a convex polygon or a disc, and as x moves, the part of the leg in it is
an analytic function of theta until the leg passes a corner of the polygon, or becomes a tangent of the disc. Such a
corner at p = (along the ray, away from the light), measured from the light, matters only between light and ray, that is
for 0 < p_2 < height, and the leg passes it on its way to

    x = foot + height p_1/p_2.
"""

from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from reference.scene.convex_bounds import Bounds, Polyhedron, Sphere
from reference.scene.read import TruthScene
from reference.visibility.line_crossings import crossings

Array = NDArray[np.float64]
Index = NDArray[np.int64]

AMBIENT = -1  #: number of the medium without bounds among the media of a scene
_BLOCK = 1 << 21  # numbers in one block of rays and edges


@dataclass(frozen=True)
class Segments:
    """What parts of rays lie in which medium; arrays of shape (slots, rays), empty parts have start >= end."""

    start: Array  #: distance from the origin [m]
    end: Array  #: may be infinite [m]
    medium: Index  #: number in `TruthScene.media`, or `AMBIENT`


def optical_depth(truth: TruthScene, origin: Array, direction: Array, low: Array, high: Array) -> Array:
    """Return the optical depth of parts of rays.

    Parameters
    ----------
    truth
        The scene.
    origin
        (n, 3), or (3,) for one that all share [m].
    direction
        Unit vectors, (n, 3).
    low, high
        Distances of the ends from the origin, (n,), finite [m].

    Returns
    -------
    tau
        Optical depth of each channel, (n, 3), 0 where high <= low.

    Notes
    -----
    Valid for any points, inside or outside of the media.
    """
    total = np.maximum(high - low, 0.0)[:, None] * truth.medium.sigma_t
    for medium in truth.media:
        enter, leave = crossings(medium.bounds, origin, direction)
        inside = np.maximum(np.minimum(leave, high) - np.maximum(enter, low), 0.0)
        total += inside[:, None] * (medium.sigma_t - truth.medium.sigma_t)
    return np.maximum(total, 0.0)


def camera_segments(truth: TruthScene, distance: Array) -> Segments:
    """Return the parts of the camera rays before `distance`, (pixels,) [m], that lie in media that scatter.

    The slots of a ray hold the bodies in the order in which it passes them, and what lies before, between and behind.
    """
    found = [crossings(medium.bounds, truth.origin, truth.direction) for medium in truth.media]
    enter = np.maximum(np.stack([low for low, _ in found]), 0.0)
    leave = np.minimum(np.stack([high for _, high in found]), distance)
    # Bodies that a ray misses come last, as nothing at the end of the ray.
    enter, leave = np.where(enter < leave, enter, distance), np.where(enter < leave, leave, distance)
    order = np.argsort(enter, axis=0, kind="stable")
    enter, leave = np.take_along_axis(enter, order, axis=0), np.take_along_axis(leave, order, axis=0)
    if not np.any(truth.medium.sigma_t * truth.medium.albedo > 0):
        return Segments(enter, leave, order)
    start = np.concatenate([np.zeros((1, len(distance))), leave, enter])
    end = np.concatenate([enter, distance[None], leave])
    between = np.full((len(order) + 1, len(distance)), AMBIENT)
    return Segments(start, end, np.concatenate([between, order]))


def scattering_range(segments: Segments) -> tuple[Array, Array]:
    """Return the first and the last distance of each ray at which a medium scatters, (rays,) [m]; low >= high: none."""
    empty = segments.start >= segments.end
    low = np.min(np.where(empty, np.inf, segments.start), axis=0)
    high = np.max(np.where(empty, -np.inf, segments.end), axis=0)
    return low, high


def leg_kinks(bounds: Bounds, light: Array, axes: tuple[Array, Array], height: Array) -> tuple[Index, Array]:
    """Return where on rays the leg from the light has kinks by passing the corners of a body.

    Parameters
    ----------
    bounds
        The body.
    light
        Position [m], (3,).
    axes
        Unit vectors along the rays and from the light to the foot points, (n, 3) each.
    height
        Distance between light and ray, (n,) [m].

    Returns
    -------
    ray, offset
        Number of the ray and x - foot of each kink [m], in no particular order.
    """
    if isinstance(bounds, Sphere):
        find, step = partial(_sphere_corners, bounds), _BLOCK
    else:
        find, step = partial(polygon_corners, bounds), max(1, _BLOCK // max(1, len(bounds.edge)))
    rays, offsets = [np.empty(0, np.int64)], [np.empty(0)]
    for first in range(0, len(height), step):
        block = slice(first, first + step)
        ray, along, away = find(light, axes[0][block], axes[1][block])
        with np.errstate(divide="ignore", over="ignore", invalid="ignore"):
            offset = height[block][ray] * (along / away)
        before = (away > 0) & (away < height[block][ray]) & np.isfinite(offset)
        rays.append(ray[before] + first)
        offsets.append(offset[before])
    return np.concatenate(rays), np.concatenate(offsets)


def polygon_corners(body: Polyhedron, light: Array, along: Array, away: Array) -> tuple[Index, Array, Array]:
    """Return where the edges of a polyhedron meet the planes of rays and light: ray, p_1, p_2."""
    ends = body.edge - light
    normal = np.cross(along, away)
    one, two = normal @ ends[:, 0].T, normal @ ends[:, 1].T
    ray, edge = np.nonzero((one * two <= 0) & (one != two))
    share = (one[ray, edge] / (one[ray, edge] - two[ray, edge]))[:, None]
    point = ends[edge, 0] + share * (ends[edge, 1] - ends[edge, 0])
    return ray, np.sum(point * along[ray], axis=1), np.sum(point * away[ray], axis=1)


def _sphere_corners(sphere: Sphere, light: Array, along: Array, away: Array) -> tuple[Index, Array, Array]:
    """Return the points at which tangents from the light touch the discs in the planes of rays and light."""
    centre = sphere.centre - light
    beside = np.cross(along, away) @ centre
    c1, c2 = along @ centre, away @ centre
    square, power = sphere.radius**2 - beside**2, c1**2 + c2**2 - (sphere.radius**2 - beside**2)
    ray = np.flatnonzero((square > 0) & (power > 0))
    c1, c2, radius, reach = c1[ray], c2[ray], np.sqrt(square[ray]), np.sqrt(power[ray])
    distance = np.hypot(c1, c2)
    # The tangent leaves the direction to the centre by the angle whose cosine is reach/distance.
    cosine, sine = reach / distance, radius / distance
    turned = [(cosine * c1 - s * sine * c2, cosine * c2 + s * sine * c1) for s in (1, -1)]
    p1, p2 = (np.concatenate([turned[0][i], turned[1][i]]) * np.tile(cosine, 2) for i in (0, 1))
    return np.tile(ray, 2), p1, p2
