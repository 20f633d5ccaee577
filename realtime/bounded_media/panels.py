# SPDX-License-Identifier: BSD-3-Clause
"""Panels of few nodes along a ray in a bounded medium: as many as the bends of the legs and its depth ask for.

The integral is that of `realtime.bounded_media.airlight` over a segment in a medium that the leg from the light enters
on its way, and enters no other. With r the distance from the light, u(x) from `realtime.bounded_media.facet_walk` and
rho = r/u what of the leg lies before the medium,

    tau = tau_before + sigma_t (x - x_begin + r - rho) + sigma_0 rho,      sigma_0 of what surrounds the bounded media.

Between two bends all of this is smooth. A panel ends at a bend, and sooner where it would

* turn by more than some angle about the light,
* be optically thicker than some depth, both legs together,
* change u by more than some share of it: rho rises steeply where a leg grazes its facet.

In a panel of n nodes the rule of Gauss and Legendre is used in t from 0 to 1 with the tangent of the angle at the light
from the panel's beginning linear in t: with the ends s_0 and s_1 from the foot, h the height and D = h^2 + s_0 s_1,

    s = ((1 - t) D s_0 + t r_0^2 s_1)/((1 - t) D + t r_0^2),      dx/r^2 = (s_1 - s_0)/D dt/(1 + t^2 T^2),

T = h (s_1 - s_0)/D. All terms are of one sign, and nothing divides by h: a segment far from the light or a ray close to
it loses nothing. The largest angle, of tangent T, ends at s_0 + T r_0^2/(h - T s_0), nowhere where that is behind.
"""

from dataclasses import dataclass
from functools import reduce
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.convex_clip import Seen, inverse_crossings
from realtime.bounded_media.facet_walk import Entry, EntryPlanes, first_entry, next_facet_change
from realtime.numerics.array_types import is_single
from realtime.numerics.fast_exp import exp_bounded
from realtime.numerics.gauss_legendre import unit_nodes
from realtime.rays.ray_light import RayGeometry, falloff
from realtime.scene.lights import Light
from realtime.scene.medium import Medium

_NODES, _NODES_DOUBLE = 3, 6
_MOST = 1000  # panels; no segment needs as many, but a loop over values that are not numbers must end too
_TANGENT = 0.45
_DEPTH = 1.6
_SHARE = 0.5
_NEARER, _FARTHER = 0.5, 0.8
_STEEP, _LEAST = 0.2, 0.002  # share for a sphere, and of its radius in any case


@dataclass(frozen=True)
class MediumSegment:
    """What the integrals over parts of rays in one bounded medium need."""

    medium: Medium  #: what scatters in it
    around: tuple[Any, ...] | None  #: extinction of what surrounds the bounded media [1/m]; None for clear air
    light: Light
    geometry: RayGeometry
    start: Any  #: from the light to the camera [m]
    direction: Any  #: unit directions of the rays
    begin: Any  #: where the rays enter the medium [m]
    before: tuple[Any, ...]  #: optical depth from the camera to there, by channel
    seen: Seen  #: the bounded medium as the light sees it
    planes: EntryPlanes | None  #: None for a sphere


def medium_integral(segment: MediumSegment, x0, x1):
    """Return albedo sigma_t times the integral from x0 to x1 within the medium, RGB [1/m^2]."""
    Float, Color = type(x0), type(segment.medium.albedo)
    foot = segment.geometry.foot
    # A ray passes through the light itself: its integral is infinite, and so nearly is this value.
    h = dr.maximum(segment.geometry.height, 1e-15)
    last = x1 - foot
    walk = _walk_from(segment, x0)

    def panel(turn, s, square, walk, totals):
        until, beyond = _bend(segment, walk)
        until = dr.clip(until - foot, s, last)
        end = s + _panel_length(segment, walk, s=s, square=square, h=h, length=until - s)
        bends = end >= until
        end = dr.minimum(end, until)
        end_square = dr.fma(end, end, h * h)
        parts = _panel(segment, walk, ends=(s, end), squares=(square, end_square), h=h)
        walk = dr.select(bends, beyond, walk)
        return turn + 1, end, end_square, walk, [total + part for total, part in zip(totals, parts)]

    s = x0 - foot
    width = dr.width(s, x1, h)
    *_, totals = dr.while_loop(
        state=(
            dr.zeros(mi.UInt32, width),
            s,
            dr.fma(s, s, h * h),
            walk,
            [dr.zeros(Float, width) for _ in segment.before],
        ),
        cond=lambda turn, s, square, walk, totals: (s < last) & (turn < _MOST),
        body=panel,
        labels=("turn", "s", "square", "walk", "totals"),
    )
    channels = [sigma * total for sigma, total in zip(segment.medium.sigma_t, totals)]
    return segment.medium.albedo * Color(*channels)


def _walk_from(segment: MediumSegment, x):
    """Return the plane where legs enter; a sphere has none, and its entry is not used."""
    if segment.planes is None:
        return Entry(dr.zeros(mi.UInt32, dr.width(x)), x * 0, x * 0)
    return first_entry(segment.planes, segment.start, segment.direction, x)


def _bend(segment: MediumSegment, walk: Entry):
    if segment.planes is None:
        return type(walk.constant)(dr.inf), walk
    return next_facet_change(segment.planes, segment.start, segment.direction, walk)


def _panel_length(segment: MediumSegment, walk: Entry, *, s, square, h, length):
    """Return the length of a panel: the whole `length`, or an equal part of it [m]."""
    x = s + segment.geometry.foot
    u = dr.fma(walk.slope, x, walk.constant)
    slope = dr.abs(walk.slope)
    largest = reduce(dr.maximum, segment.medium.sigma_t)
    tangent = _largest_tangent(segment)
    turning = h - tangent * s
    most = dr.select(turning > 0, tangent * square / turning, dr.inf)
    r = dr.sqrt(square)
    most = dr.minimum(most, dr.select(s < 0, _NEARER, _FARTHER) * r)
    if segment.planes is None:
        most = dr.minimum(most, dr.minimum(_sphere_length(segment, x), _DEPTH / (2 * largest)))
    else:
        rising = dr.select(u > 0, slope / u, 0)
        most = dr.minimum(most, _SHARE / rising)
        most = dr.minimum(most, _DEPTH / (largest * dr.fma(r, rising, 2)))
    return length / dr.maximum(dr.ceil(length / most), 1)


def _sphere_length(segment: MediumSegment, x):
    """Return the length in which the square of half the chord that legs have in a sphere changes by a share of it [m].

    The part of the leg in the sphere is like the root of it: steep where legs graze the sphere. With w from the light
    to the middle of the sphere it is radius^2 - f, f = |v x w|^2/|v|^2, and over a length t f changes by

        (2 ((v x w) . (d x w) - f v . d) t + (|d x w|^2 - f) t^2)/|v + t d|^2,

    whose divisor is taken for |v|^2: panels end before it changes by much. The second term counts where the first is
    none: where a segment begins with the longest chord of its legs.
    """
    radius, w = segment.seen.bounded_medium.radius, segment.seen.toward
    v = dr.fma(segment.direction, x, segment.start)
    cross, turned, square = dr.cross(v, w), dr.cross(segment.direction, w), dr.squared_norm(v)
    distance = dr.squared_norm(cross) / square
    rate = dr.abs(2 * (dr.dot(cross, turned) - distance * dr.dot(v, segment.direction)) / square)
    bend = dr.abs(dr.squared_norm(turned) - distance) / square
    change = _STEEP * dr.maximum(radius * radius - distance, 0)
    length = 2 * change / (rate + dr.sqrt(dr.fma(rate, rate, 4 * bend * change)))
    return dr.clip(dr.select(change > 0, length, 0), _LEAST * radius, 0.25 * radius)


def _largest_tangent(segment: MediumSegment):
    turn = segment.medium.phase.largest_turn()
    if segment.light.varies:
        turn = dr.minimum(turn, 0.4)
    return _TANGENT * turn


def _panel(segment: MediumSegment, walk: Entry, *, ends, squares, h) -> list[Any]:
    """Return the integrals of p exp(-tau) / r^2 over a panel, by channel."""
    s0, s1 = ends
    Float = type(s0)
    length = s1 - s0
    # A panel turns by less than 31 degrees, so a smaller product is the work of rounding.
    product = dr.maximum(dr.fma(s0, s1, h * h), 0.5 * dr.sqrt(squares[0] * squares[1]))
    scale = length / product
    tangent = dr.square(h * scale)
    totals = [Float(0) for _ in segment.before]
    for t, share in unit_nodes(_NODES if is_single(Float) else _NODES_DOUBLE):
        far = t * squares[0]
        s = dr.fma(length, far / dr.fma(1 - t, product, far), s0)
        x = s + segment.geometry.foot
        r = dr.sqrt(dr.fma(s, s, h * h))
        before = _before_medium(segment, walk, x, r)
        inside = (x - segment.begin) + (r - before)
        weight = share * segment.medium.phase.evaluate(-s / r) / dr.fma(t * t, tangent, 1)
        if segment.light.varies:
            weight *= falloff(segment.geometry, segment.light, x)
        for channel, (depth, own) in enumerate(zip(segment.before, segment.medium.sigma_t)):
            depth = dr.fma(own, inside, depth)
            if segment.around is not None:
                depth = dr.fma(segment.around[channel], before, depth)
            totals[channel] += weight * exp_bounded(-depth)
    return [scale * total for total in totals]


def _before_medium(segment: MediumSegment, walk: Entry, x, r):
    """Return what of the leg to a point within the medium lies before it [m]."""
    if segment.planes is None:
        (u,), _ = inverse_crossings(segment.seen, segment.start, segment.direction, [x], True)
        return r / dr.maximum(u, 1)
    return dr.select(segment.planes.within, 0, r / dr.maximum(dr.fma(walk.slope, x, walk.constant), 1))
