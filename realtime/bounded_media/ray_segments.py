# SPDX-License-Identifier: BSD-3-Clause
"""Rays through bounded media: the pieces of the camera rays, what of the legs from the light lies in each medium.

Lines are followed over the facets of media (`realtime.bounded_media.facet_walk`), in packets in which any comes near.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.convex_clip import Seen, inverse_crossings, near_line, share_inside
from realtime.bounded_media.directional_legs import parallel_legs, seen_along
from realtime.bounded_media.envelopes import Envelopes, Lines, envelopes_at
from realtime.bounded_media.facet_walk import EntryPlanes, clear_of, line_crossings
from realtime.bounded_media.views import MediumView, medium_view
from realtime.numerics.array_types import chosen_value
from realtime.rays.ray_light import RayGeometry, distance_to_light
from realtime.scene.lights import Light
from realtime.scene.medium import Medium


@dataclass(frozen=True)
class Piece:
    """A part of every ray that lies in one medium."""

    medium: Medium
    number: int | None  #: of the bounded medium; None between them
    begin: Any  #: distance from the camera [m], infinite or equal to `end` where the ray misses it
    end: Any  #: [m]
    before: tuple[Any, ...]  #: optical depth from the camera to `begin`, by channel [1]


@dataclass(frozen=True)
class MediaRay:
    """Camera rays in bounded media, and one light that has a place."""

    medium: Medium
    light: Light
    geometry: RayGeometry
    start: Any  #: from the light to the camera [m]
    direction: Any  #: unit directions
    pieces: tuple[Piece, ...]
    seen: tuple[Seen, ...]  #: the bounded media as the light sees them
    entries: tuple[EntryPlanes | None, ...]  #: by medium, the planes where legs to points within it enter
    exits: tuple[EntryPlanes | None, ...]  #: by medium, the planes where legs leave it; only where there are several
    form: str  #: of `realtime.bounded_media.airlight.FORMS`
    polynomial: Any = None  #: of a kernel, for the published forms; None: nodes


def sum_over_pieces(pieces: tuple[Piece, ...], segments, integral, zero):
    """Add up an integral over the parts of segments that lie in the pieces.

    Parameters
    ----------
    pieces
        Of the rays.
    segments
        Pairs of distances (x0, x1), `x1` may be infinite [m].
    integral
        Function (piece, x0, x1) -> colour; only lanes with x0 < x1 count.
    zero
        The colour of no segment, of the rays' width.
    """
    Color = type(zero)

    def added(total, piece, ends):
        x0, x1 = ends
        begin, end = dr.maximum(x0, piece.begin), dr.minimum(x1, piece.end)
        return total + dr.if_stmt(
            args=(begin, end),
            cond=end > begin,
            true_fn=lambda begin, end: integral(piece, begin, end),
            false_fn=lambda begin, end: Color(0),
        )

    total = zero
    for piece in pieces:
        if len(segments) == 1:
            total = added(total, piece, segments[0])
            continue
        # A loop: the integral is long, and its code need not be there for each segment.
        _, total = dr.while_loop(
            state=(mi.UInt32(0), total),
            cond=lambda number, total: number < len(segments),
            body=lambda number, total, piece=piece: (
                number + 1,
                added(total, piece, [chosen_value(ends, number) for ends in zip(*segments, strict=True)]),
            ),
            labels=("number", "total"),
        )
    return total


def camera_pieces(medium: Medium, origin, direction, views: tuple[MediumView, ...] | None = None) -> tuple[Piece, ...]:
    """Return the pieces of the camera rays in which something scatters.

    Parameters
    ----------
    medium
        The medium, with bounded media in it.
    origin, direction
        The camera, one for all lanes [m], and unit directions.
    views
        The bounded media as the camera sees them, if they are known.
    """
    Float = type(direction.x)
    views = views or tuple(medium_view(bounded_medium, origin) for bounded_medium in medium.bounded_media)
    passages = [_passage(view, direction) for view in views]

    def piece(own: Medium, number, begin, end):
        before = []
        for channel, around in enumerate(medium.sigma_t):
            depth = Float(0) if medium.clear else around * begin
            for bounded_medium, (enter, leave) in zip(medium.bounded_media, passages):
                excess = bounded_medium.medium.sigma_t[channel] - around
                depth += dr.select(leave <= begin, excess * (leave - enter), 0)
            before.append(depth)
        return Piece(own, number, begin, end, tuple(before))

    pieces = [
        piece(bounded_medium.medium, number, *ends)
        for number, (bounded_medium, ends) in enumerate(zip(medium.bounded_media, passages, strict=True))
    ]
    if not medium.clear:
        starts = [dr.zeros(Float, dr.width(direction)), *(leave for _, leave in passages)]
        for begin in starts:
            end = Float(dr.inf)
            for enter, _ in passages:
                end = dr.minimum(end, dr.select(enter >= begin, enter, dr.inf))
            # A camera within a bounded medium has no gap before it.
            inside = [(enter <= begin) & (begin < leave) for enter, leave in passages]
            pieces.append(piece(medium, None, begin, dr.select(_any(inside), begin, end)))
    return tuple(pieces)


def _passage(view: MediumView, direction):
    """Return where camera rays enter and leave a medium [m], both infinite where they miss it."""
    seen, planes = view.seen, (view.entering, view.leaving)
    nothing = type(direction.x)(dr.inf)

    def ends(direction):
        enter, leave = line_ends(seen, planes, direction)
        begin, end = dr.rcp(enter), dr.select(leave > 0, dr.rcp(leave), dr.inf)
        hit = (enter > 0) & (begin < end)
        return dr.select(hit, begin, dr.inf), dr.select(hit, end, dr.inf)

    return dr.if_stmt(
        args=(direction,),
        cond=near_line(seen, direction, dr.inf),
        true_fn=ends,
        false_fn=lambda direction: (nothing, nothing),
    )


def camera_insides(medium: Medium, origin, direction, distance) -> tuple[Any, ...]:
    """Return what of camera rays up to a distance lies in each bounded medium [m]; arguments as in `camera_pieces`.

    `origin` is the camera [m], `direction` unit vectors; `distance` [m] may be infinite.
    """
    insides = []
    for bounded_medium in medium.bounded_media:
        ends = _passage(medium_view(bounded_medium, origin), direction)
        enter, leave = (dr.minimum(end, distance) for end in ends)
        insides.append(dr.select(leave > enter, leave - enter, 0))
    return tuple(insides)


def optical_depths(medium: Medium, distance, insides) -> tuple[Any, ...]:
    """Return the optical depth up to a distance, by channel; `insides` is what lies in each bounded medium [m]."""
    depths = [type(distance)(0) if medium.clear else sigma * distance for sigma in medium.sigma_t]
    for bounded_medium, inside in zip(medium.bounded_media, insides, strict=True):
        excess = [own - sigma for own, sigma in zip(bounded_medium.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    return tuple(depths)


def path_transmittance(medium: Medium, light: Light, *, depths, point, active):
    """Return the transmittance from the light to points and on to the camera, a colour [1].

    Parameters
    ----------
    medium, light
        What the light crosses and where it comes from.
    depths
        Of the camera rays, from `optical_depths`.
    point
        The points.
    active
        Lanes to compute.
    """
    if not light.w:
        still = dr.zeros(type(point))
        for bounded_medium in medium.bounded_media:
            (inside,) = parallel_legs(seen_along(bounded_medium, light.axis), point, still, [type(point.x)(0)], active)
            depths = [dr.fma(own, inside, depth) for own, depth in zip(bounded_medium.medium.sigma_t, depths)]
        return type(medium.albedo)(*(dr.exp(-depth) for depth in depths))
    vector = point - light.position
    length = dr.norm(vector)
    depths = [dr.fma(sigma, length, depth) for depth, sigma in zip(depths, medium.sigma_t)]
    for bounded_medium in medium.bounded_media:
        view = medium_view(bounded_medium, light.position)
        seen, planes = view.seen, (view.entering, view.leaving)
        near = active & near_line(seen, vector / length, length)
        inside = dr.if_stmt(
            args=(vector,),
            cond=near,
            true_fn=lambda vector, seen=seen, planes=planes: (
                share_inside(*line_ends(seen, planes, vector)) * dr.norm(vector)
            ),
            false_fn=lambda vector: type(vector.x)(0),
        )
        excess = [own - sigma for own, sigma in zip(bounded_medium.medium.sigma_t, medium.sigma_t)]
        depths = [dr.fma(more, inside, depth) for more, depth in zip(excess, depths)]
    return type(medium.albedo)(*(dr.exp(-depth) for depth in depths))


def line_ends(seen: Seen, planes, v):
    """Return 1/f_in and 1/f_out of lines along v, as of `realtime.bounded_media.convex_clip.inverse_crossings`."""
    if seen.bounded_medium.planes is None:
        (enter,), (leave,) = inverse_crossings(seen, v, dr.zeros(type(v)), [type(v.x)(0)], True)
        return enter, leave
    return line_crossings(planes, v)


def light_leg(ray: MediaRay, piece: Piece, xs, rs, envelopes: Mapping[int, Envelopes] | None = None) -> list[list[Any]]:
    """Return by medium and node what of the leg from the light lies in it [m].

    Parameters
    ----------
    ray, piece
        Where the nodes lie.
    xs, rs
        Distances of the nodes along the rays, and from the light [m].
    envelopes
        By number of a medium, the planes where all of these legs enter and leave it, from `ray_envelopes`, if they are
        known.
    """
    known = envelopes or {}
    insides = []
    for number, seen in enumerate(ray.seen):
        own = number == piece.number
        if number in known:
            near: Any = True
            enter, leave = zip(*(known[number].values(x) for x in xs), strict=True)
        else:
            near = dr.full(dr.mask_t(xs[0]), True, dr.width(xs[0])) if own else legs_near(ray, seen, xs, rs)
            enter, leave = inverse_crossings(seen, ray.start, ray.direction, xs, near, leaves=not own)
        ends = [None] * len(xs) if own else leave
        shares = [share_inside(inverse_in, inverse_out) for inverse_in, inverse_out in zip(enter, ends)]
        insides.append([dr.select(near, share * r, 0) for share, r in zip(shares, rs)])
    return insides


def ray_envelopes(lines: Lines, x) -> Envelopes:
    """Return where legs to the points at x [m] enter and leave a medium; in lanes that are not active they miss it.

    `lines` are those of `realtime.bounded_media.convex_clip.crossing_lines`.
    """
    missed = type(x)(-1), type(x)(0)
    return dr.select(lines.active, envelopes_at(lines, x), Envelopes(missed, missed))


def grazed_at(seen: Seen, ray: MediaRay) -> tuple[Any, Any]:
    """Return where the points of rays lie whose legs graze a sphere, two distances or infinity [m].

    Before and behind them a leg has a part in the sphere that rises like a root. With w from the light to the middle
    of the sphere, c = |w|^2 - radius^2 and v = v_0 + x d from the light to the point, |v x w| = radius |v| there, so

        (q^2 - c) x^2 + 2 (p q - c v_0 . d) x + p^2 - c |v_0|^2 = 0,     p = v_0 . w,  q = d . w,

    whose discriminant is c (radius^2 |n|^2 - (w . n)^2), n = v_0 x d: nothing cancels. One of them may belong to legs
    away from the sphere, where a cut does no harm.
    """
    w, start, direction = seen.toward, ray.start, ray.direction
    radius, away = seen.bounded_medium.radius, dr.norm(w)
    c = (away - radius) * (away + radius)
    p, q = dr.dot(start, w), dr.dot(direction, w)
    across = dr.cross(start, direction)
    square = c * (dr.square(radius) * dr.squared_norm(across) - dr.square(dr.dot(w, across)))
    half = dr.fma(p, q, -c * dr.dot(start, direction))
    t = -(half + dr.mulsign(dr.sqrt(dr.maximum(square, 0)), half))
    ends = t / dr.fma(q, q, -c), (p * p - c * dr.squared_norm(start)) / t
    return tuple(dr.select((square > 0) & dr.isfinite(x), x, dr.inf) for x in ends)


def other_media_near(ray: MediaRay, number: int, x0, x1):
    """Return whether legs from the light to points of [x0, x1] [m] in the medium `number` may meet another one."""
    xs = [x0, x1]
    rs = [distance_to_light(ray.geometry, x) for x in xs]
    meets: Any = False
    for other, seen in enumerate(ray.seen):
        if other == number:
            continue
        near = legs_near(ray, seen, xs, rs)
        if seen.planes is not None:
            near = dr.if_stmt(
                args=(x0, x1),
                cond=near,
                true_fn=lambda x0, x1, other=other: ~_clear_of(ray, other, x0, x1),
                false_fn=lambda x0, x1: dr.mask_t(x0)(False),
            )
        meets = near | meets
    return meets


def _clear_of(ray: MediaRay, other: int, x0, x1):
    entering, leaving = ray.entries[other], ray.exits[other]
    assert entering is not None
    assert leaving is not None
    return clear_of((entering, leaving), ray.start, ray.direction, x0, x1)


def legs_near(ray: MediaRay, seen: Seen, xs, rs):
    """Return whether legs from the light to points of a segment may come near a medium.

    In the plane of ray and light, with u along the ray and v to it, the legs fill a triangle with the corner at the
    light and the others at (s_0, h) and (s_1, h); q is the distance of the medium's centre from the plane. First and
    last node stand for the ends.
    """
    geometry, radius = ray.geometry, seen.bounded_medium.radius * 1.001
    foot = dr.fma(ray.direction, geometry.foot, ray.start)
    size = dr.norm(foot)
    # A ray through the light has no such plane: all legs lie in the ray.
    away = dr.select(size > 0, foot / size, 0)
    u, v = dr.dot(seen.toward, ray.direction), dr.dot(seen.toward, away)
    beside = dr.squared_norm(seen.toward - ray.direction * u - away * v) > dr.square(radius)
    h, s0, s1 = geometry.height, xs[0] - geometry.foot, xs[-1] - geometry.foot
    before = s0 * v - h * u > radius * rs[0]
    behind = h * u - s1 * v > radius * rs[-1]
    return ~(beside | before | behind | (v > h + radius))


def _any(conditions: list[Any]):
    result: Any = False
    for condition in conditions:
        result = condition | result
    return result
