# SPDX-License-Identifier: BSD-3-Clause
"""Airlight in bounded media: homogeneous, convex and disjoint, in vacuum or in another medium.

A ray runs through *pieces*, the bounded media that it meets and, unless they are in vacuum, the gaps between them. In a
piece of the medium j, over a lit segment of it,

    J = int exp(-tau_camera(x) - tau_light(x)) p / r^2 dx,

without r^2 for a light at infinity, with the true optical depths on both paths. Camera: the depth up to the piece is
one number a ray, and sigma_j (x - x_j) is added in it. Light: the path from the light to x has the length l_k in the
medium k (`realtime.scene.media.light_paths`), and

    tau_light = sigma_0 r + sum_k (sigma_k - sigma_0) l_k,        sigma_0 = 0 in vacuum.

Between two *bends*, where a path passes from facet to facet, or an edge, or grazes a sphere, or where the intensity of
a spot begins to fall, all of this is smooth. A panel ends at a bend, and sooner where it would

* turn by more than some angle about the light, which depends on the phase function (`realtime.scene.rule_reach`),
* be optically thicker than some depth, both paths together,
* change 1 + e by more than some fraction of it: the length rises steeply where a path grazes its facet.

In a panel of n nodes the rule of Gauss and Legendre is used in t from 0 to 1 with the tangent of the angle at the light
from the panel's beginning linear in t: with the ends s_0 and s_1 from the foot, h the height and D = h^2 + s_0 s_1,

    s = ((1 - t) D s_0 + t r_0^2 s_1)/((1 - t) D + t r_0^2),      dx/r^2 = (s_1 - s_0)/D dt/(1 + t^2 T^2),

T = h (s_1 - s_0)/D. All terms are of one sign, and nothing divides by h: a segment far from the light or a ray close to
it loses nothing. The largest angle, of tangent T, ends at s_0 + T r_0^2/(h - T s_0), nowhere where that is behind.
For a light at infinity t is linear in x.
"""

from dataclasses import dataclass
from functools import reduce
from operator import or_
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import is_single
from airlight.realtime.numerics.functions import exp_bounded, unit_nodes
from airlight.realtime.scene.media.light_paths import Envelopes, LightPaths, beyond, paths_from
from airlight.realtime.scene.media.medium import Homogeneous, LitRays, Rays, optical_reach, unfinished
from airlight.realtime.scene.rule_reach import TANGENT, TURN_DEPTH, TURN_NODES, angle_scale

_NODES_DOUBLE = 6
_MOST = 1000  # panels of a segment beside those that end where a path passes from facet to facet
_DEPTH_DOUBLE = 1.6
_NEARER, _FARTHER = 0.5, 0.8


@dataclass(frozen=True)
class Piece:
    """A part of every ray that lies in one medium."""

    medium: Homogeneous
    number: Any  #: of the bounded medium; None between them
    begin: Any  #: distance from the camera [m], infinite or equal to `end` where the ray misses it
    end: Any  #: [m]
    before: tuple[Any, ...]  #: optical depth from the camera to `begin`, by channel [1]


@dataclass(frozen=True)
class BoundedRays(LitRays):
    """Rays in bounded media, and one light: integrals are sums of albedo_j sigma_j J_j, RGB [1/m^2]."""

    pieces: tuple[Piece, ...] = ()

    def airlight(self, x0, x1):
        """Return sum_j albedo_j sigma_j J_j over the lit segment [x0, x1] [m], RGB [1/m^2], from infinity [1].

        `x1` may be infinite. Times intensity / (4 pi), or irradiance / (4 pi), it is the radiance.
        """
        x0, x1 = self.geometry.lit_segment(x0, x1)
        Color = type(self.medium.albedo)
        total = dr.zeros(Color, dr.width(self.geometry.height, x0, x1))
        for piece in self.pieces:
            total += dr.if_stmt(
                args=(dr.maximum(x0, piece.begin), dr.minimum(x1, piece.end)),
                cond=dr.minimum(x1, piece.end) > dr.maximum(x0, piece.begin),
                true_fn=lambda begin, end, piece=piece: self.integral(piece, begin, end),
                false_fn=lambda begin, end: Color(0),
            )
        return total

    def integral(self, piece: Piece, x0, x1):
        """Return albedo sigma J over a segment [m] in one piece, a colour [1/m^2]."""
        x1 = dr.minimum(x1, x0 + optical_reach(type(x0)) / piece.medium.least_extinction())
        return _panels(self, piece, x0, x1, self.light_paths(piece, x0, x1))

    def light_paths(self, piece: Piece, x0, x1) -> list[LightPaths]:
        """Return the paths from the light to a segment [m] in one piece, through each medium that they may meet."""
        rays = self.rays
        return paths_from(self.medium, self.light, rays.origin, rays.direction, own=piece.number, segment=(x0, x1))

    def growth(self, piece: Piece, x, r):
        """Return how fast the depth of both paths grows along the ray, bounded media on the light's left out [1/m]."""
        rate = reduce(dr.maximum, piece.medium.sigma_t)
        if self.light.w and not self.medium.clear:
            rate = rate + reduce(dr.maximum, self.medium.sigma_t)
        return rate

    def depths(self, piece: Piece, x, r, lengths) -> list[Any]:
        """Return the optical depth of both paths at x, by channel; `lengths` of the light's by medium [m]."""
        depths = []
        for channel, around in enumerate(self.medium.sigma_t):
            depth = dr.fma(piece.medium.sigma_t[channel], x - piece.begin, piece.before[channel])
            if not self.medium.clear:
                depth = dr.fma(around, r, depth)
            for medium, length in lengths:
                depth = dr.fma(medium.sigma_t[channel] - around, length, depth)
            depths.append(depth)
        return depths

    def distance_to_light(self, x):
        """Return r at a distance x of the rays [m]; 1 for a light at infinity."""
        if not self.light.w:
            return type(x)(1)
        s = x - self.geometry.foot
        return dr.sqrt(dr.fma(s, s, dr.square(self.height)))

    @property
    def height(self):
        """The height [m]; a ray through the light has an infinite integral, and so nearly is its value."""
        return dr.maximum(self.geometry.height, 1e-15)


def camera_pieces(medium: Any, rays: Rays) -> tuple[Piece, ...]:
    """Return the pieces of camera rays in which something scatters."""
    Float = type(rays.direction.x)

    def piece(own: Homogeneous, number, begin, end):
        before = medium.optical_depth(rays, 0, dr.select(dr.isfinite(begin), begin, 0))
        return Piece(own, number, begin, end, before)

    pieces = [
        piece(bounded.medium, number, *ends)
        for number, (bounded, ends) in enumerate(zip(medium.bounded_media, rays.crossed, strict=True))
    ]
    if not medium.clear:
        around = Homogeneous(medium.sigma_t, medium.albedo, medium.phase)
        starts = [dr.zeros(Float, dr.width(rays.direction)), *(leave for _, leave in rays.crossed)]
        for begin in starts:
            end = Float(dr.inf)
            for enter, _ in rays.crossed:
                end = dr.minimum(end, dr.select(enter >= begin, enter, dr.inf))
            # A camera within a bounded medium has no gap before it.
            inside = reduce(or_, [(enter <= begin) & (begin < leave) for enter, leave in rays.crossed])
            pieces.append(piece(around, None, begin, dr.select(inside, begin, end)))
    return tuple(pieces)


def _panels(ray: BoundedRays, piece: Piece, x0, x1, paths: list[LightPaths]):
    """Sum the panels of a segment whose light paths meet none but the media of `paths`."""
    Float, Color = type(x0), type(ray.medium.albedo)
    bends = [x for path in paths for x in path.grazed_at()]
    if ray.light.varies:
        bends += [end for _, end in ray.geometry.smooth_subsegments(ray.light, x0, x1)]

    def panel(turn, x, envelopes, totals):
        at = beyond(x)
        changes = [own and path.next_change(own, at) for path, own in zip(paths, envelopes)]
        until = x1
        for bend in bends:
            until = dr.minimum(until, dr.select(bend > at, bend, dr.inf))
        for own, change in zip(envelopes, changes):
            if own:
                until = dr.minimum(until, dr.maximum(dr.minimum(*change[0]), at))
                until = dr.minimum(until, own.crossing(at))
        length = until - x
        count = dr.ceil(length / _longest(ray, piece, paths, envelopes, x))
        end = dr.select(count > 1, x + length / count, until)
        totals = [total + part for total, part in zip(totals, _panel(ray, piece, paths, envelopes, x, end))]
        envelopes = [own and _after(own, change, end) for own, change in zip(envelopes, changes)]
        return turn + 1, end, envelopes, totals

    # A path enters and leaves each facet of a convex body once, and there are two of them.
    most = _MOST + 2 * sum(path.bounded.count for path in paths)
    width = dr.width(ray.geometry.height, x0, x1)
    x0 = x0 + dr.zeros(Float, width)
    _, reached, _, totals = dr.while_loop(
        state=(
            dr.zeros(mi.UInt32, width),
            x0,
            [path.envelopes_at(beyond(x0)) for path in paths],
            [dr.zeros(Float, width) for _ in piece.before],
        ),
        cond=lambda turn, x, envelopes, totals: (x < x1) & (turn < most),
        body=panel,
        labels=("turn", "x", "envelopes", "totals"),
    )
    totals = [unfinished(reached < x1, total) for total in totals]
    return piece.medium.albedo * Color(*(sigma * total for sigma, total in zip(piece.medium.sigma_t, totals)))


def _after(own: Envelopes, change, x) -> Envelopes:
    """Return the envelopes from x on, a distance not beyond the next change of either [m]."""
    (until_low, until_high), after = change
    return Envelopes(
        dr.select(until_low <= x, after.least, own.least),
        dr.select(until_high <= x, after.largest, own.largest),
        (
            dr.select(until_low <= x, after.planes[0], own.planes[0]),
            dr.select(until_high <= x, after.planes[1], own.planes[1]),
        ),
    )


def _longest(ray: BoundedRays, piece: Piece, paths: list[LightPaths], envelopes, x):
    """Return the length of the longest panel that begins at x [m]."""
    r, h = ray.distance_to_light(x), ray.height
    longest, rate = type(x)(dr.inf), ray.growth(piece, x, r)
    if ray.light.w:
        s = x - ray.geometry.foot
        phase, e = piece.medium.phase, dr.select(s > 0, r + s, h) / dr.select(s > 0, h, r - s)
        tangent = dr.minimum(
            TANGENT, phase.reach.turn * angle_scale(dr.minimum(e, 1e9), *phase.lobe_scales(type(x)), dr.sqrt)
        )
        if ray.light.varies:
            tangent = dr.minimum(tangent, 0.4 * TANGENT)
        turning = h - tangent * s
        longest = dr.select(turning > 0, tangent * dr.square(r) / turning, dr.inf)
        longest = dr.minimum(longest, dr.select(s < 0, _NEARER, _FARTHER) * r)
    for path, own in zip(paths, envelopes):
        steepness, smooth = path.steepness(own, x, r)
        rate = rate + steepness * reduce(dr.maximum, path.bounded.medium.sigma_t)
        longest = dr.minimum(longest, smooth)
    return dr.minimum(longest, (TURN_DEPTH if is_single(type(x)) else _DEPTH_DOUBLE) / rate)


def _panel(ray: BoundedRays, piece: Piece, paths: list[LightPaths], envelopes, x0, x1) -> list[Any]:
    """Return the integrals of p exp(-tau) / r^2 over a panel, by channel."""
    Float, w = type(x0), ray.light.w
    length = scale = x1 - x0
    if w:
        h, s0, s1 = ray.height, x0 - ray.geometry.foot, x1 - ray.geometry.foot
        square0, square1 = dr.fma(s0, s0, h * h), dr.fma(s1, s1, h * h)
        # A panel turns by less than 31 degrees, so a smaller product is the work of rounding.
        product = dr.maximum(dr.fma(s0, s1, h * h), 0.5 * dr.sqrt(square0 * square1))
        scale = length / product
        tangent = dr.square(h * scale)
    totals = [Float(0) for _ in piece.before]
    for t, weight in unit_nodes(TURN_NODES if is_single(Float) else _NODES_DOUBLE):
        if w:
            far = t * square0
            s = dr.fma(length, far / dr.fma(1 - t, product, far), s0)
            x, r = s + ray.geometry.foot, dr.sqrt(dr.fma(s, s, h * h))
            fraction = weight / dr.fma(t * t, tangent, 1)
        else:
            x, r, fraction = dr.fma(t, length, x0), Float(1), weight
        fraction = fraction * _scattered(ray, piece, x, r)
        lengths = [(path.bounded.medium, path.length(own, x, r)) for path, own in zip(paths, envelopes)]
        for channel, depth in enumerate(ray.depths(piece, x, r, lengths)):
            totals[channel] += fraction * exp_bounded(-depth)
    return [scale * total for total in totals]


def _scattered(ray: BoundedRays, piece: Piece, x, r):
    """Return the phase function times the spot's profile [1]."""
    phase = ray.angle(x - ray.geometry.foot, r)(piece.medium.phase)
    return phase * ray.geometry.falloff(ray.light, x) if ray.light.varies else phase
