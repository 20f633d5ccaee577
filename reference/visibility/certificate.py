# SPDX-License-Identifier: BSD-3-Clause
"""Evidence that lit intervals are right: fresh random shadow rays, which share no code
with them, and one judge.

Mitsuba casts the shadow rays in single precision. Within the rounding of an edge they decide
nothing. Elsewhere a third route judges a contradiction: a float64 test of that one shadow segment
against every triangle (Moeller and Trumbore 1997, Fast, minimum storage ray-triangle intersection,
J. Graphics Tools 2(1)), sphere and disk. Segments that remain undecided are in doubt, and their
largest effect goes into the error of the image.
"""

import hashlib
from dataclasses import dataclass, field, replace

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.device import on_device, vectors
from airlight.reference.scene.shapes import Shapes
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Bools = NDArray[np.bool_]
Index = NDArray[np.int64]

#: relative uncertainty of the distance of an edge from its light: rounding, a lost digit, merging
EXACT_EDGE = 1e-11


@dataclass(frozen=True)
class RandomChecks:
    """How often fresh random shadow rays contradicted lit intervals."""

    checked: int = 0  #: shadow rays cast
    #: shadow rays that contradicted the intervals further from an edge than rounding
    disagreements: int = 0
    refined: int = 0  #: disagreements that were settled by testing every shape in float64
    left: int = 0  #: disagreements that remain undecided
    missed: float = 0.0  #: fraction of the shadow rays that contradicted the intervals

    @staticmethod
    def of_all(parts: "list[RandomChecks]") -> "RandomChecks":
        """Add up the checks of several lights or chunks of rays; the largest `missed` counts."""
        return RandomChecks(
            sum(part.checked for part in parts),
            sum(part.disagreements for part in parts),
            sum(part.refined for part in parts),
            sum(part.left for part in parts),
            max((part.missed for part in parts), default=0.0),
        )


@dataclass(frozen=True)
class LitIntervals:
    """The lit parts of rays: one entry per interval, sorted by ray and distance."""

    ray: Index  #: number of the ray
    low: Array  #: distance at which the interval begins [m]
    high: Array  #: where it ends, may be infinite [m]
    transitions: int = 0  #: edges between light and shadow
    #: relative uncertainty of the distance of an edge from its light, or of coordinates
    edge: float = EXACT_EDGE
    random_checks: RandomChecks = field(default_factory=RandomChecks)
    #: undecided parts of rays: numbers of the rays, and sizes of the parts, angles at the light
    #: [rad] or lengths [m]
    doubt: tuple[Index, Array] = field(default_factory=lambda: (np.empty(0, np.int64), np.empty(0)))
    metre: float = 1.0  #: 1 m, or the size of a smaller scene [m]


def certified(
    lit: LitIntervals,
    rays: Rays,
    ends: tuple[Array, Array],
    *,
    occluders: "mi.Scene",
    shapes: Shapes,
    checks: int,
    every: int = 1,
    normal: Array | None = None,
) -> LitIntervals:
    """Check lit intervals at random places.

    `lit`, `rays`: the intervals, and the rays in their planes with the light; `ends`: distances
    between which the intervals were searched, (rays,) each [m]; `occluders`, `shapes`: the shapes
    that can stand in the light, for ray casts and as numbers; `checks`: shadow rays to each checked
    ray; `every`: each so many rays one is checked: an odd number steps through all samples of a
    light; `normal`: of the surface of the light at each position, unit, (rays, 3); None for lights
    that are points.
    """
    # The rays to check.
    ray = np.arange(0, len(rays.foot), every)
    ray = ray[ends[1][ray] > ends[0][ray]]
    if not len(ray) or not shapes.count:
        return lit
    # Random places are even in the angle at a light, or in the distance under a directional one:
    # `checks` strata, one place in each. The seed follows from the rays.
    low, high = (_measure(rays, end, slice(None)) for end in ends)
    fraction = (
        np.arange(checks) + _generator(rays.foot, rays.height).random((len(ray), checks))
    ) / checks
    ray, fraction = np.repeat(ray, checks), fraction.ravel()
    at = low[ray] + fraction * (high - low)[ray]
    x = at if rays.w == 0 else rays.distance(at, ray)
    # From a light on its line a ray has one angle at all its points, and the distance at this angle
    # is infinite: such a ray is not checked.
    finite = np.isfinite(x)
    ray, fraction, x = ray[finite], fraction[finite], x[finite]
    if not len(ray):
        return lit
    # Ends and places as fractions of the checked range. The number 2 ray + fraction orders the
    # places of all rays at once. Only the last interval that begins before a place, and the next
    # interval, can hold the place or have the edge that is nearest to it.
    width = np.where(high > low, high - low, 1.0)
    begin, end = (
        np.clip((_measure(rays, part, lit.ray) - low[lit.ray]) / width[lit.ray], 0, 1)
        for part in (lit.low, lit.high)
    )
    number = np.searchsorted(2.0 * lit.ray + begin, 2.0 * ray + fraction, side="right")
    count = len(lit.ray)
    # Whether the place is lit by the intervals, and the gap between the place and the nearest edge
    # or end of the range.
    expected, gap = np.zeros(len(ray), bool), np.minimum(fraction, 1 - fraction)
    for offset in (-1, 0):
        k = np.clip(number + offset, 0, max(count - 1, 0))
        if not count:
            break
        same = (number + offset >= 0) & (number + offset < count) & (lit.ray[k] == ray)
        expected |= same & (begin[k] <= fraction) & (fraction <= end[k])
        near = np.minimum(np.abs(fraction - begin[k]), np.abs(fraction - end[k]))
        gap = np.where(same, np.minimum(gap, near), gap)
    # Shadow rays end 2e-6 early and are rounded to 1e-7: within 1e-5 of an edge, in the angle at a
    # light or in coordinates, they decide nothing.
    rounding = 1e-5 * (1.0 if rays.w else coordinates(rays, shapes))
    start, target = _segments(rays, ray, x, shapes)
    # A shadow ray starts 1e-5 of the largest coordinate before the surface of an area light, clear
    # of float32 shapes in that surface.
    clear = (
        start
        if normal is None
        else start
        + 1e-5
        * (shapes.metre(rays.origin, start) + np.abs(start).max(axis=1))[:, None]
        * normal[ray]
    )
    unblocked = _cast(occluders, clear, target)
    wrong = np.flatnonzero(
        (unblocked != expected) & (gap * width[ray] > np.broadcast_to(rounding, len(low))[ray])
    )
    # The float64 test looks at every shape. It judges 256 contradictions: more than a few mean that
    # something is wrong, and the rest stays in doubt.
    most = 256
    judged = wrong[:most]
    lit_by_judge = ~segments_blocked(start[judged], target[judged], shapes)
    undecided = np.append(judged[lit_by_judge != expected[judged]], wrong[most:])
    report = RandomChecks(
        len(ray), len(wrong), len(wrong) - len(undecided), len(undecided), len(wrong) / len(ray)
    )
    # A place in doubt stands for its stratum, and its ray for all those of which it is checked.
    part = width[ray[undecided]] * every / checks
    return replace(lit, random_checks=report, doubt=(ray[undecided], part))


def _measure(rays: Rays, x: Array, ray: Index | slice) -> Array:
    """Return the measure in which random places are even: the angle at a light at a place, the
    distance under a directional light.
    """
    return rays.theta(x, ray) if rays.w else x


def coordinates(rays: Rays, shapes: Shapes) -> Array:
    """Return how far a relative uncertainty of 1 of coordinates moves edges of shadows along each
    ray under a directional light, (rays,) [m].

    It is the largest distance between the camera and a point of a shadow segment, over the sine of
    the angle between ray and light.
    """
    return _reach(rays, shapes) / rays.height


def _reach(rays: Rays, shapes: Shapes) -> float:
    if not shapes.count:
        return 1.0
    furthest = np.max([np.abs(corner - rays.origin) for corner in shapes.box], axis=0)
    return shapes.metre(rays.origin) + float(np.linalg.norm(furthest))


def _segments(rays: Rays, ray: Index, x: Array, shapes: Shapes) -> tuple[Array, Array]:
    """Return both ends of shadow segments: at the light, or beyond all shapes, and at points of
    rays, (segments, 3) each [m].
    """
    target = rays.point(ray, x)
    if rays.w:
        return rays.position[ray], target
    # A directional light has no place: the segment begins beyond all shapes.
    reach = 2 * _reach(rays, shapes) + x
    return target + reach[:, None] * rays.position[ray], target


def _cast(occluders: "mi.Scene", start: Array, target: Array) -> Bools:
    """Return which segments nothing blocks, by Mitsuba."""
    parts = [np.empty(0, bool)]
    step = 1 << 22  # rays cast at once
    for first in range(0, len(start), step):
        block = slice(first, first + step)
        way = target[block] - start[block]
        length = np.maximum(np.linalg.norm(way, axis=1), np.finfo(float).tiny)
        direction = vectors(mi.Vector3f, way / length[:, None])
        # The ray ends 2e-6 of its length before its point, which may lie on a surface.
        reach = on_device(mi.Float, length * (1 - 2e-6))
        ray = mi.Ray3f(vectors(mi.Point3f, start[block]), direction, reach, 0.0, [])
        parts.append(~np.array(occluders.ray_test(ray), dtype=bool))
    return np.concatenate(parts)


def _generator(*drawn_for: Array) -> np.random.Generator:
    """Return a generator whose seed is a digest of some arrays.

    Other rays are then checked at other places, and the same rays at the same places in every run.
    """
    digest = hashlib.blake2b(digest_size=16)
    for array in drawn_for:
        digest.update(np.ascontiguousarray(array).tobytes())
    return np.random.default_rng(int.from_bytes(digest.digest()))


def segments_blocked(start: Array, end: Array, shapes: Shapes) -> Bools:
    """Return which segments meet a triangle, the surface of a sphere, or a disk, in float64.

    `start`, `end`: the ends of the segments, (segments, 3) [m]; `shapes`: the shapes.
    """
    way = end - start
    blocked = np.zeros(len(start), dtype=bool)
    # Triangles, one segment after the other.
    corner = shapes.triangles[:, 0]
    edges = shapes.triangles[:, 1] - corner, shapes.triangles[:, 2] - corner
    # Spheres about the first corners: a triangle whose sphere the line misses cannot be met.
    longest = np.sqrt(np.maximum(*(np.sum(edge * edge, axis=1) for edge in edges)))
    for number, (point, towards) in enumerate(zip(start, way, strict=True)):
        away = corner - point
        length = np.linalg.norm(towards)
        off = (
            np.linalg.norm(np.cross(away, towards / length), axis=1)
            if length > 0
            else np.zeros(len(away))
        )
        # A slack of 1e-9 of how far away a triangle is; float64 rounding is 1e-15.
        near = np.flatnonzero(off <= longest + 1e-9 * (1 + np.abs(away).max(axis=1, initial=0)))
        blocked[number] = _meets_triangle(
            point, towards, corner[near], (edges[0][near], edges[1][near])
        ).any()
    for centre, radius in zip(shapes.centre, shapes.radius, strict=True):
        blocked |= _meets_sphere(start - centre, way, radius)
    disks = shapes.disks
    # Where the segment meets the plane of a disk. For a segment parallel to the plane s is infinite
    # or NaN, and the segment meets nothing.
    for centre, normal, radius in zip(disks.centre, disks.normal, disks.radius, strict=True):
        with np.errstate(divide="ignore", invalid="ignore"):
            s = ((centre - start) @ normal) / (way @ normal)
            beside = np.linalg.norm(start + s[:, None] * way - centre, axis=1)
        blocked |= (s > 0) & (s < 1) & (beside < radius)
    return blocked


def _meets_triangle(start: Array, way: Array, corner: Array, edges: tuple[Array, Array]) -> Bools:
    """Solve start + s way = corner + u e1 + v e2 for every triangle; the scalar
    products share the determinant.
    """
    first_edge, second_edge = edges
    across = np.cross(way, second_edge)
    determinant = np.sum(first_edge * across, axis=-1)
    from_corner = start - corner
    beside = np.cross(from_corner, first_edge)
    with np.errstate(divide="ignore", invalid="ignore"):
        u = np.sum(from_corner * across, axis=-1) / determinant
        v = np.sum(way * beside, axis=-1) / determinant
        s = np.sum(second_edge * beside, axis=-1) / determinant
        return (u >= 0) & (v >= 0) & (u + v <= 1) & (s > 0) & (s < 1)


def _meets_sphere(from_centre: Array, way: Array, radius: float) -> Bools:
    """Return which segments cross the surface of a sphere, from outside or from within."""
    square = np.sum(way * way, axis=1)
    half = np.sum(from_centre * way, axis=1)
    outside = np.sum(from_centre * from_centre, axis=1) - radius**2
    discriminant = half**2 - square * outside
    root = np.sqrt(np.maximum(discriminant, 0))
    with np.errstate(divide="ignore", invalid="ignore"):
        # Either crossing counts: a segment from within meets the sphere at its far side only.
        near, far = (-half - root) / square, (-half + root) / square
        return (discriminant > 0) & (((near > 0) & (near < 1)) | ((far > 0) & (far < 1)))


def reached_by_shadow_rays(
    interaction: "mi.SurfaceInteraction3f",
    light: Array,
    reached: Bools,
    *,
    scene: "mi.Scene",
    shapes: Shapes,
) -> Bools:
    """Return which surfaces a light reaches from where Mitsuba starts its shadow rays.

    A shadow ray must not hit the surface that it leaves, so `SurfaceInteraction.spawn_ray_to`
    starts it some way off the surface, along its normal: in single precision 1e-4 (1 + the largest
    coordinate) (Mitsuba 3.9, `offset_p` in `include/mitsuba/render/interaction.h`). A point that an
    edge just does not shadow may then be in the shadow, and the other way round: shadow edges move
    by about that length. A renderer that starts its rays so converges to the moved edges, as it
    does to the shortened segment of `reference.scene.shadow_epsilon`. Where Mitsuba's ray and the
    exact lit intervals differ, the float64 test decides by the segment from Mitsuba's start.
    Therefore the comparison still finds a fault of the lit intervals.

    `interaction`: where rays meet surfaces, one entry for each ray; `light`: position of the light
    (3,) [m]; `reached`: whether it reaches the surface points themselves, by exact geometry,
    (rays,); `scene`, `shapes`: the occluders, for ray casts and as numbers.
    """
    ray = interaction.spawn_ray_to(mi.Point3f(*light.tolist()))
    valid = np.array(interaction.is_valid(), dtype=bool)
    cast = ~np.array(scene.ray_test(ray, interaction.is_valid()), dtype=bool)
    differs = np.flatnonzero(valid & (cast != reached))
    start = np.array(ray.o, dtype=np.float64).T[differs]
    way = light - start
    length = np.linalg.norm(way, axis=1)
    # Mitsuba's shadow ray ends a little before the light, at `maxt`; the judge looks at the same
    # segment.
    fraction = np.minimum(
        np.array(ray.maxt, dtype=np.float64)[differs] / np.maximum(length, np.finfo(float).tiny),
        1.0,
    )
    confirmed = reached.copy()
    confirmed[differs] = ~segments_blocked(start, start + way * fraction[:, None], shapes)
    return confirmed
