# SPDX-License-Identifier: BSD-3-Clause
r"""What surfaces reflect of lights with extent: lit intervals along scan lines of the light.

    L = exp(-tau_camera)  int_A Le V f cos_s cos_l exp(-s tau_leg) / r^2 dA,

f cos_s by Mitsuba's `BSDF.eval`. In the plane of a surface point and a scan line, with the angle theta at the point and
the distance h between point and line, dU/r^2 = dtheta/h and cos_l = D cos(theta)/h, D the distance between the point
and the plane of the lines: what is left is a smooth function of theta without a pole, however close the light is. For a
sphere the same expression is the solid angle of its disk (`reference.visibility.light_lines`), and the distance to the
sphere has a square root at both ends of the line, which theta = m + w sin(phi) takes out.

The place and the direction of a line are a point of the unit square, one of the scrambled nets of
`reference.quadrature.light_points`, shifted at random in its binary digits for every surface point: what a line sees is
continuous in both, and sums over such nets become normal, as Student's intervals of eight replicates take for granted.
One direction for all lines of a replicate needs fewer of them for the same error, but its sums are skewed (-1.5 with a
shifted lattice of places) or have long tails (kurtosis 4 to 15 with places in pairs): 88 or 99 % of the intervals hold.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.quadrature.ahead import done_ahead
from reference.quadrature.area_airlight import Keep, Kept, Share
from reference.quadrature.light_points import REPLICATES, PointPlan, square_points
from reference.quadrature.replicates import replicate_means
from reference.quadrature.segments import optical_depth
from reference.quadrature.surface import SurfaceHits
from reference.quadrature.unbounded import sums_of
from reference.scene.area_light import TruthAreaLight
from reference.scene.read import TruthScene
from reference.scene.shapes import Shapes
from reference.visibility.before_light import before_light
from reference.visibility.light_lines import (
    Facing,
    Points,
    ScanLines,
    distance_on_line,
    facing,
    scan_lines,
    seen_intervals,
)

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Intervals = tuple[Index, Array, Array]  # of lines: their numbers, and where they begin and end

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(6)
_PANEL = 0.7  # rad: widest panel in theta or phi
_BODIES = 0.1  # rad: the same where bounded media dim the leg, whose depth has kinks
_LINES = 1 << 17  # at once
_NODES_AT_ONCE = 1 << 20
_DIGITS = 30  # of the places and directions of lines


@dataclass(frozen=True)
class Beam:
    """A light, and what can stand in it."""

    light: TruthAreaLight
    scene: TruthScene  #: without the light's own shape
    shapes: Shapes


def area_surface(
    truth: TruthScene,
    hits: SurfaceHits,
    known: Array,
    *,
    plan: PointPlan,
    shadow_scale: float,
    tell: Share,
    keep: Keep = lambda name, work: work(),
) -> Array:
    """Return the radiance of surfaces lit by lights with extent, by replicate, (rays, 3, replicates) [W/(m^2 sr)].

    Parameters
    ----------
    truth, hits
        The scene and what its rays hit.
    known
        The radiance that all other lights give, to which errors are relative too, (rays, 3) [W/(m^2 sr)].
    plan
        The standard error that is asked for, the most lines of a replicate, and the seed.
    shadow_scale
        See `reference.quadrature.image.quadrature_image`.
    tell, keep
        As in `reference.quadrature.area_airlight.area_airlight`.

    Notes
    -----
    Valid for shadows of triangles and spheres; other shapes are asked by one shadow ray for each node, so that their
    edges are as sharp as the nodes are dense, and their errors in the spread of the replicates.
    """
    count = len(hits.distance)
    result = np.zeros((count, 3, REPLICATES))
    rows = surface_rows(hits)
    if not len(rows):
        return result
    points, bsdf = surface_points(truth, hits, rows)
    beams = [Beam(light, *before_light(truth, light)) for light in truth.area]
    faced = [facing(beam.light, points) for beam in beams]
    to_camera = np.exp(-optical_depth(truth, truth.origin, truth.direction[rows], 0 * points.normal[:, 0], _far(hits)))
    rounds = 2 * plan.rounds * len(beams)
    done = 0

    def sums(part: str, chosen: PointPlan, active: Index, numbers: tuple[int, int]) -> Array:
        nonlocal done
        total = np.zeros((len(active), 3, REPLICATES))
        for number, beam in enumerate(beams):
            share = partial(_share_of, tell, done / rounds, 1 / rounds)
            draws = _draws(chosen, number, len(rows), numbers)
            work = partial(_sums_over, beam, faced[number], points, bsdf, shadow_scale, draws, active, share)
            total += keep(f"surface-{part}{number}-{numbers[1]}", work)["radiance"]
            done += 1
        return total * to_camera[active, :, None]

    result[rows], _ = replicate_means(len(rows), known[rows], plan, sums)
    return result


def _share_of(tell: Share, done: float, part: float, share: float) -> None:
    tell(done + part * share)


def _sums_over(
    beam: Beam,
    seen: Facing,
    points: Points,
    bsdf: "Reflection",
    shadow_scale: float,
    draws: "Draws",
    active: Index,
    tell: Share,
) -> Kept:
    """Return what lines stand for at some points, before the leg to the camera, added up."""
    total = np.zeros((len(points.place), 3, REPLICATES))
    looking = active[seen.seen[active]]
    step = max(1, _LINES // draws.net[..., 0].size)

    def look(first: int) -> tuple[Index, Index, ScanLines, Intervals]:
        some = looking[first : first + step]
        line = _lines(draws, some)
        lines = scan_lines(beam.light.kind, seen, points, line[:3])
        place = np.searchsorted(some, lines.point) * REPLICATES + line[3]
        return some, place, lines, seen_intervals(beam.light, seen, lines, points, beam.shapes)

    done = 0
    for some, place, lines, intervals in done_ahead(look, range(0, len(looking), step), workers=dr.thread_count()):
        got = _line_values(beam, seen, lines, intervals, points, bsdf, shadow_scale)
        sums = sums_of(place, got, len(some) * REPLICATES).reshape(len(some), REPLICATES, 3)
        total[some] += np.swapaxes(sums, 1, 2)
        done += len(some)
        tell(done / len(looking))
    return {"radiance": total[active]}


def surface_rows(hits: SurfaceHits) -> Index:
    """Return the numbers of the rays that hit a surface."""
    return np.flatnonzero(np.isfinite(hits.distance))


def _far(hits: SurfaceHits) -> Array:
    return hits.distance[surface_rows(hits)]


def surface_points(truth: TruthScene, hits: SurfaceHits, rows: Index) -> tuple[Points, "Reflection"]:
    """Return the points where rays hit surfaces, and how these reflect.

    Parameters
    ----------
    truth, hits
        The scene and what its rays hit.
    rows
        Numbers of the rays.
    """
    direction = truth.direction[rows]
    place = truth.origin + hits.distance[rows, None] * direction
    index = mi.UInt32(rows.astype(np.uint32))
    interaction = dr.gather(mi.SurfaceInteraction3f, hits.interaction, index)
    normal = np.array(interaction.n, dtype=np.float64).T
    normal /= np.linalg.norm(normal, axis=1, keepdims=True)
    normal *= -np.sign(np.sum(normal * direction, axis=1))[:, None]
    return Points(place, normal), Reflection(interaction)


@dataclass(frozen=True)
class Reflection:
    """Mitsuba's materials at some points."""

    interaction: Any  #: Mitsuba's surface interactions

    def __call__(self, point: Index, towards: Array) -> Array:
        """Return f cos_s at points of these numbers, (n,), for light from unit directions, (n, 3): (n, 3) [1/sr]."""
        at = dr.gather(mi.SurfaceInteraction3f, self.interaction, mi.UInt32(point.astype(np.uint32)))
        local = at.to_local(dr.normalize(mi.Vector3f(towards.T)))
        return np.array(at.bsdf().eval(mi.BSDFContext(), at, local), dtype=np.float64).reshape(3, -1).T


@dataclass(frozen=True)
class Draws:
    """Lines of a light, as points of the unit square in binary digits: place and direction."""

    net: Index  #: of every replicate, (replicates, lines, 2)
    shift: Index  #: of every surface point and replicate, (points or 1, replicates, 2)


def _draws(plan: PointPlan, light: int, count: int, numbers: tuple[int, int]) -> Draws:
    """Return the lines of these numbers for every surface point, `count` of them."""
    net = np.stack([square_points(plan, light, replicate, "rectangle") for replicate in range(REPLICATES)])
    drawn = 1 if plan.shared else count
    shift = np.random.default_rng((plan.seed, light, drawn)).integers(0, 1 << _DIGITS, (drawn, REPLICATES, 2))
    return Draws((net[:, slice(*numbers)] * (1 << _DIGITS)).astype(np.int64), shift)


def _lines(draws: Draws, points: Index) -> tuple[Index, Array, Array, Index]:
    """Return points, directions [rad], places [1] and replicates of the lines of some points, sorted by point."""
    shift = np.broadcast_to(draws.shift, (max(len(draws.shift), points.max(initial=0) + 1), REPLICATES, 2))[points]
    square = ((draws.net ^ shift[:, :, None]) + 0.5) / (1 << _DIGITS)
    count = draws.net.shape[1]
    replicate = np.tile(np.repeat(np.arange(REPLICATES), count), len(points))
    return np.repeat(points, REPLICATES * count), np.pi * square[..., 1].ravel(), square[..., 0].ravel(), replicate


def _line_values(
    beam: Beam,
    seen: Facing,
    lines: ScanLines,
    intervals: Intervals,
    points: Points,
    bsdf: Reflection,
    shadow_scale: float,
) -> Array:
    """Return what every line stands for of the reflected radiance, before the leg to the camera, (lines, 3)."""
    line, low, high = intervals
    start, width = low, high - low
    if beam.light.kind == "sphere":
        middle, half = 0.5 * (lines.ends[0] + lines.ends[1]), 0.5 * (lines.ends[1] - lines.ends[0])
        ends = (np.arcsin(np.clip((end - middle[line]) / half[line], -1.0, 1.0)) for end in (low, high))
        start, finish = ends
        width = finish - start
    widest = _BODIES if beam.scene.media else _PANEL
    count = np.maximum(np.ceil(width / widest), 1).astype(np.int64)
    panel = np.repeat(np.arange(len(line)), count)
    part = (width / count)[panel]
    begin = start[panel] + (np.arange(len(panel)) - np.repeat(np.cumsum(count) - count, count)) * part
    total = np.zeros((len(lines.point), 3))
    step = max(1, _NODES_AT_ONCE // len(_NODES))
    for first in range(0, len(panel), step):
        block = slice(first, first + step)
        of = line[panel[block]]
        theta = begin[block, None] + 0.5 * part[block, None] * (1 + _NODES)
        weight = 0.5 * part[block, None] * _WEIGHTS
        if beam.light.kind == "sphere":
            weight = weight * half[of, None] * np.cos(theta)
            theta = middle[of, None] + half[of, None] * np.sin(theta)
        value = _at_nodes(beam, seen, lines, of, theta, points, bsdf, shadow_scale)
        total += sums_of(of, np.sum(weight[..., None] * value, axis=1), len(total))
    return total


def _at_nodes(
    beam: Beam,
    seen: Facing,
    lines: ScanLines,
    of: Index,
    theta: Array,
    points: Points,
    bsdf: Reflection,
    shadow_scale: float,
) -> Array:
    """Return the integrand of lines of these numbers at angles, (n, nodes): (n, nodes, 3)."""
    point = np.repeat(lines.point[of], theta.shape[1])
    sine, cosine = np.sin(theta), np.cos(theta)
    towards = (sine[..., None] * lines.along[of, None] + cosine[..., None] * lines.normal[of, None]).reshape(-1, 3)
    r = distance_on_line(beam.light, lines, of, theta, points).ravel()
    if beam.scene.media:
        target = points.place[point] + r[:, None] * towards
        depth = optical_depth(beam.scene, target, -towards, (1 - shadow_scale) * r, r)
    else:
        depth = (shadow_scale * r)[:, None] * beam.scene.medium.sigma_t
    value = bsdf(point, towards) * np.exp(-depth)
    if beam.shapes.others is not None:
        value *= _clear(beam, bsdf, point, points.place[point] + r[:, None] * towards)[:, None]
    row = lines.point[of]
    with np.errstate(divide="ignore", invalid="ignore"):
        factor = np.where(lines.chord[of] > 0, seen.area[row] / lines.chord[of], 0.0)
    factor = (factor * seen.depth[row] / lines.height[of] ** 2)[:, None] * cosine
    return value.reshape(*theta.shape, 3) * factor[..., None] * beam.light.radiance


def _clear(beam: Beam, bsdf: Reflection, point: Index, target: Array) -> NDArray[np.bool_]:
    """Return from which points nothing but triangles and spheres hides points of the light."""
    at = dr.gather(mi.SurfaceInteraction3f, bsdf.interaction, mi.UInt32(point.astype(np.uint32)))
    hidden = beam.shapes.others.ray_test(at.spawn_ray_to(mi.Point3f(target.T)))
    return ~np.array(hidden, dtype=bool)


def visible_share(truth: TruthScene, number: int, points: Points, lines: int) -> Array:
    """Return the share of a flat light that points see, by lines of eight directions, (points, 8) [1].

    Each direction alone gives the share, to the error of a midpoint rule of so many lines: a close check of geometry.
    Valid for shadows of triangles and spheres; points on the dark side see nothing.
    """
    light = truth.area[number]
    _, shapes = before_light(truth, light)
    seen = facing(light, points)
    rows = np.flatnonzero(seen.seen)
    result = np.zeros((len(points.place), REPLICATES))
    place, turn = (np.arange(count) + 0.5 for count in (lines, REPLICATES))
    square = np.stack(np.broadcast_arrays(place / lines, turn[:, None] / REPLICATES), axis=2)
    net = (square * (1 << _DIGITS)).astype(np.int64)
    drawn = _lines(Draws(net, np.zeros((1, REPLICATES, 2), np.int64)), rows)
    known = scan_lines(light.kind, seen, points, drawn[:3])
    line, low, high = seen_intervals(light, seen, known, points, shapes)
    length = known.height[line] * (np.tan(high) - np.tan(low))
    share = np.bincount(line, length / known.chord[line], len(known.point))
    np.add.at(result, (known.point, drawn[3]), share / lines)
    return result
