# SPDX-License-Identifier: BSD-3-Clause
"""Intervals of rays: what is lit, times the media along the ray, times the corners of the integrand.

Three cuts lead from the parts of a ray that a light reaches to pieces on which the integrand is
analytic:

1. `lit_stretches`: a soft spot has kinks at the cone of full intensity;
2. `camera_segments` and `parts_in_media`: a part lies in one medium;
3. `cut`: a piece ends at every corner of the medium, such as where the path to the light passes an
   edge of a body (`shadow_kinks`), at a kink of a tabulated phase function, or at the face of a
   cell of a grid.

**Corners of bodies.** In the plane of a ray and a light (`reference.visibility.planes`) a body is a
convex polygon or a disk. As x moves along the ray, the part of the shadow segment in the body is an
analytic function of x until the segment passes a corner of the polygon, or becomes a tangent of the
disk. Such a point (z, y) matters only between ray and light, and the segment passes it at the x to
which the map of the plane takes it.
"""

from dataclasses import dataclass, fields
from functools import partial

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.convex_bounds import Bounds, Polyhedron, Sphere
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import ReferenceScene
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.distances import crossings, half_chord
from airlight.reference.visibility.planes import Rays, cone_interval

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Stretches = tuple[Index, Array, Array]  # rays, and distances of both ends [m]
Kinks = tuple[Index, Array]  # rays, and distances along them [m]

AMBIENT = -1  #: number of the medium without bounds among the media of a scene


def lit_stretches(light: ReferenceLight, rays: Rays, lit: LitIntervals) -> Stretches:
    """Return lit intervals, cut at the cone of full intensity, where the profile of a
    soft spot has its kinks.

    `light`, `rays`, `lit`: a point or spot light, the rays in their planes with it,
    and their lit intervals.
    """
    ray, low, high = lit.ray, np.maximum(lit.low, 0.0), lit.high
    if not light.is_soft or light.cosine:
        return ray, low, high
    inner0, inner1 = cone_interval(rays[ray], light, light.beam)
    # Where the ray misses the beam the profile is smooth except for the middle of the cone,
    # where it peaks: cut there.
    middle = 0.5 * (inner0 + inner1)
    misses = inner1 < inner0
    ends = np.where(misses, middle, inner0), np.where(misses, middle, inner1)
    # Each interval falls into three parts: before, in and behind the beam; most have one.
    return cut_stretches((ray, low, high), *(rays.distance(end, ray) for end in ends))


def cut_stretches(stretches: Stretches, *places: Array) -> Stretches:
    """Return stretches cut at increasing distances along their rays, (stretches,) each [m]."""
    ray, low, high = stretches
    cuts = [np.clip(place, low, high) for place in places]
    low, high = np.concatenate([low, *cuts]), np.concatenate([*cuts, high])
    keep = high > low
    return np.tile(ray, len(cuts) + 1)[keep], low[keep], high[keep]


def cut_at(rays: Rays, stretches: Stretches, radius: float) -> Stretches:
    """Return stretches cut where their rays are at a distance from the light [m]."""
    ray, half = stretches[0], half_chord(radius, rays.height)
    return cut_stretches(stretches, (rays.foot - half)[ray], (rays.foot + half)[ray])


def clipped(
    stretches: Stretches, low: Array | float = -np.inf, high: Array | float = np.inf
) -> Stretches:
    """Return the parts of stretches that have a length between two distances, numbers or by ray
    [m].
    """
    ray, x0, x1 = stretches
    x0 = np.maximum(x0, low[ray] if isinstance(low, np.ndarray) else low)
    x1 = np.minimum(x1, high[ray] if isinstance(high, np.ndarray) else high)
    keep = x1 > x0
    return ray[keep], x0[keep], x1[keep]


@dataclass(frozen=True)
class Segments:
    """The parts of rays and their media; arrays of shape (slots, rays), empty
    parts have start >= end.
    """

    start: Array  #: distance from the origin [m]
    end: Array  #: may be infinite [m]
    medium: Index  #: number in `ReferenceScene.media`, or `AMBIENT`


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


@dataclass(frozen=True)
class Pieces:
    """Smooth pieces of rays, each in one medium."""

    ray: Index  #: number of the ray, (n,)
    medium: Index  #: number in `ReferenceScene.media`, or `AMBIENT`, (n,)
    x0: Array  #: distance from the camera where the piece begins, (n,) [m]
    x1: Array  #: where it ends, (n,) [m]
    first: NDArray[np.bool_]  #: whether it begins where a lit interval does, (n,)
    last: NDArray[np.bool_]  #: whether it ends where a lit interval does, (n,)
    #: number of the part of a lit interval in one medium that the piece was cut from, (n,)
    part: Index

    def __getitem__(self, rows) -> "Pieces":
        return Pieces(*(getattr(self, f.name)[rows] for f in fields(self)))


def whole(lit: Stretches) -> Pieces:
    """Return lit stretches as pieces of one medium, by ray and distance, for `cut`."""
    order = np.lexsort((lit[1], lit[0]))
    ray, x0, x1 = lit[0][order], lit[1][order], lit[2][order]
    medium, every = np.full(len(ray), AMBIENT), np.ones(len(ray), bool)
    return Pieces(ray, medium, x0, x1, every, np.isfinite(x1), np.arange(len(ray)))


def parts_in_media(
    reference: ReferenceScene,
    rays: Rays,
    segments: Segments,
    lit: Stretches,
    fall: float | Array = 1.0,
) -> Pieces:
    """Return the parts of lit stretches in each medium, by ray and distance, for `cut`.

    `reference`, `rays`, `segments`: the scene, the rays, and the media along them from
    `camera_segments`; `lit`: the lit stretches; `fall`: the fraction of the extinction that
    attenuates along a ray without end, a number or by ray [1].
    """
    ray, x0, x1 = lit
    parts = []
    for start, end, medium in zip(segments.start, segments.end, segments.medium):
        low, high = np.maximum(x0, start[ray]), np.minimum(x1, end[ray])
        # One slot of all rays at a time: the part of each stretch that lies in this slot's medium.
        keep = high > low
        rows, low, high = ray[keep], low[keep], high[keep]
        parts.append(
            (rows, medium[rows], low, high, low == x0[keep], (high == x1[keep]) & np.isfinite(high))
        )
    ray, number, low, high, first, last = (np.concatenate(column) for column in zip(*parts))
    if np.any(np.isinf(high)):
        # Only the medium around the bodies is unbounded, and it has a piece only where it scatters.
        # It is cut where exp underflows: an optical depth of 745 behind its beginning or the
        # light's foot.
        sigma_t = reference.medium.sigma_t
        own = fall[ray] if isinstance(fall, np.ndarray) else np.float64(fall)
        with np.errstate(divide="ignore"):
            reach = 745.0 / (sigma_t[sigma_t > 0].min() * own)
        # Where nothing attenuates, light that falls as 1/r^2 has 1e-20 of it behind 1e20 times the
        # distance of the light.
        reach = np.minimum(reach, 1e20 * np.maximum(np.hypot(rays.foot, rays.height)[ray], 1.0))
        reach = np.maximum(low, rays.foot[ray]) + reach
        high = np.where(np.isinf(high), reach, high)
    order = np.lexsort((low, ray))
    return Pieces(ray, number, low, high, first, last, np.arange(len(ray)))[order]


def cut(parts: Pieces, kinks: Kinks) -> Pieces:
    """Cut parts of rays at kinks.

    `parts`: by ray and distance; `kinks`: rays and distances, (kinks,) each [m], in any order.
    Returns the pieces, each with the number of its part.
    """
    ray, x = kinks
    # The part in which each kink lies is the last one that begins before it.
    everything = np.lexsort((np.concatenate([parts.x0, x]), np.concatenate([parts.ray, ray])))
    begins = everything < len(parts.ray)
    part = np.cumsum(begins)[~begins] - 1
    kink = everything[~begins] - len(parts.ray)
    inside = (
        (part >= 0)
        & (parts.ray[part] == ray[kink])
        & (parts.x0[part] < x[kink])
        & (x[kink] < parts.x1[part])
    )
    part, x = part[inside], x[kink[inside]]
    # A part without kinks is one piece; each kink begins a further piece, which ends where the next
    # piece of the same part begins, or with the part.
    owner = np.concatenate([np.arange(len(parts.ray)), part])
    start = np.concatenate([parts.x0, x])
    order = np.lexsort((start, owner))
    owner, start = owner[order], start[order]
    ends = np.append(owner[1:] != owner[:-1], True)[: len(owner)]
    end = np.where(ends, parts.x1[owner], np.append(start[1:], 0.0)[: len(owner)])
    # Only the outer ends of a part can be edges between light and shadow.
    begin = np.append(True, ends[:-1])[: len(owner)]
    first, last = parts.first[owner] & begin, parts.last[owner] & ends
    pieces = Pieces(parts.ray[owner], parts.medium[owner], start, end, first, last, owner)
    # Two kinks at one place leave a piece without length.
    return pieces[end > start]
