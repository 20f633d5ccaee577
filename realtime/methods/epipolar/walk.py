# SPDX-License-Identifier: BSD-3-Clause
"""The lit intervals of rays in the height maps of epipolar slices.

In a slice (`realtime.methods.epipolar.min_max_tree`) let t and h be foot and height of a ray. From
cross(k, direction) = s cross(P, direction) = s h and D direction = (-t, h),

    D h s(q) = G(q) := h k_x + t k_y,      x = D^2 k_y / G.

With S = D times the height of the map the point is lit where

    G(q) >= h S(q),

without a quotient. At a crossing G = h S, thus x = D^2 k_y / (h S); between the ends of a leaf,
with the differences d0 = G - h S at one and d1 at the other, k and S are those at the ends in the
ratio |d1| : |d0|. Nothing cancels, wherever the ray goes.

With a light at infinity foot and height are the cosine and the sine of the ray's angle with it, D =
1 and k = (s_O, Y). The point of the ray over Y is x = Y / h = k_y / h, and the height of the ray
less S is G / h - S: G(q) >= h S(q) again. Only x has another divisor: at a crossing within a leaf h
(|d1| + d0) instead of h (S |d1| + ...).

A ray that at both ends of a node is above its greatest S is lit all over it, one that is below the
least is dark (Chen et al. 2011): a long step.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.intervals import (
    LitIntervals,
    add_waiting,
    close_interval,
    no_intervals,
    open_interval,
)
from airlight.realtime.methods.epipolar.min_max_tree import SliceHeights, line_point, node_pair
from airlight.realtime.rays import RayGeometry


@dataclass
class _Walk:
    """Where a ray is on its way along the leaves."""

    place: Any  #: the first leaf of the node to look at
    level: Any  #: the node has 2^level leaves
    lit: Any  #: whether the light reaches the ray there
    intervals: LitIntervals  #: in distances [m]
    done: Any  #: there are no more nodes


def sum_lit_intervals(
    heights: SliceHeights,
    number,
    geometry: RayGeometry,
    segment,
    integral: Callable[[Any, Any], Any],
    zero,
):
    """Add up an integral over the lit intervals of rays.

    `heights`: the maps; `number`: the slice that stands for each ray: the ray is turned into it
    about the line of camera and light; `geometry`: the rays and the light; `segment`: distances
    (x0, x1) between which to look; `x1` may be infinite, and x1 <= x0 for rays to leave out [m];
    function (x0, x1) -> value of one interval; `zero`: the value of no interval, one for each ray.
    """
    x0, x1 = segment
    width = dr.width(zero)
    x0 = x0 + dr.zeros(type(x1), width)
    distance = heights.slices.distance
    # A ray through the light has no height: a ray next to it sees the same.
    height = dr.maximum(geometry.height, 1e-12 * distance)
    ray = (geometry.foot, height, dr.square(distance))
    # Where the segment lies among the leaves, from a fraction of the first to one of the last.
    begin, end = (_position(heights, number, ray, x) for x in segment)
    last_leaf = dr.minimum(mi.UInt32(end), heights.leaves - 1)
    leaf = dr.minimum(mi.UInt32(begin), last_leaf)
    # The first leaf says whether the ray is lit at its beginning: S there is linear between its
    # ends.
    s0, s1 = node_pair(heights, number, leaf, mi.UInt32(0))
    s = dr.fma(begin - type(begin)(leaf), s1 - s0, s0)
    start = _Walk(
        place=leaf,
        # From a leaf that begins no larger node the way up is by steps.
        level=dr.select(leaf % heights.size == 0, mi.UInt32(heights.top), mi.UInt32(0)),
        lit=_line_value(heights, number, ray, begin) >= height * s,
        intervals=no_intervals(zero, +x0),
        done=~(x1 > x0),
    )

    def between(begin, end):
        return integral(begin, dr.maximum(begin, end))

    def body(walk):
        # The inner loop goes on to the end of a lit interval; rays whose intervals end at different
        # nodes wait there for one another, as an integral costs as much as many steps.
        (walk,) = dr.while_loop(
            state=(walk,),
            cond=lambda walk: ~walk.intervals.waits & ~walk.done,
            body=lambda walk: (_step(heights, number, ray, (x0, x1), (end, last_leaf), walk),),
            labels=("walk",),
        )
        walk.intervals = add_waiting(walk.intervals, between)
        return (walk,)

    (walk,) = dr.while_loop(
        state=(start,), cond=lambda walk: ~walk.done, body=body, labels=("walk",)
    )
    return walk.intervals.total


def _step(heights: SliceHeights, number, ray, segment, stop, walk: _Walk) -> _Walk:
    """Look at one node: go over it, or down into it."""
    _, height, square = ray
    end, last_leaf = stop
    Float = type(height)
    after = walk.place + (mi.UInt32(1) << walk.level)
    s0, s1 = node_pair(heights, number, walk.place, walk.level)
    kx0, ky0 = line_point(heights, number, Float(walk.place))
    kx1, ky1 = line_point(heights, number, Float(after))
    g0, g1 = _line(ray, kx0, ky0), _line(ray, kx1, ky1)
    # G is linear between the ends of the node, as k is. The ray may end within the node.
    g_end = dr.select(Float(after) > end, _line_value(heights, number, ray, end), g1)
    # Above the greatest S at both ends, or below the least: a long step.
    all_lit = dr.minimum(g0, g_end) >= height * dr.maximum(s0, s1)
    all_dark = dr.maximum(g0, g_end) < height * dr.minimum(s0, s1)
    whole, leaf = all_lit | all_dark, walk.level == 0
    # Within a leaf, from end to end. The walk knows whether the ray is lit at the beginning, so d0
    # is the size of the difference alone: rounding cannot turn it round. The sign of d1 says
    # whether the ray is lit at the end.
    d0, d1 = dr.abs(g0 - height * s0), g1 - height * s1
    lit = dr.select(whole, all_lit, d1 >= 0)
    passed = whole | leaf
    lit = dr.select(passed, lit, walk.lit)
    # Where a whole node differs from the leaf before it, by rounding, the change is at the node's
    # beginning.
    ky = dr.select(whole, ky0, ky0 * dr.abs(d1) + ky1 * d0)
    # x = D^2 k_y / (h S) at a crossing in a leaf, and D^2 k_y / G at the beginning of a whole node.
    # In a leaf k_y and S are sums with the weights |d1| and d0; the sum of the weights cancels,
    # except at infinity, where x = k_y / h.
    if heights.slices.w:
        divisor = dr.select(whole, g0, height * (s0 * dr.abs(d1) + s1 * d0))
    else:
        divisor = height * dr.select(whole, 1, dr.abs(d1) + d0)
    # Without a positive divisor the crossing lies beyond the end, however far the ray goes.
    x = dr.select(divisor > 0, square * ky / divisor, dr.inf)
    x = dr.clip(x, segment[0], segment[1])
    # Behind the last leaf of the segment a ray that is lit closes its interval at x1.
    over = passed & (after > last_leaf)
    changed, remains = lit != walk.lit, over & lit
    intervals = open_interval(walk.intervals, x, changed & lit)
    intervals = close_interval(
        intervals, dr.select(remains, segment[1], x), remains | (changed & walk.lit)
    )
    # Up by one level where the next leaf begins a node of that level; down by one into a node that
    # is not passed.
    step_up = passed & (dr.tzcnt(after) > walk.level) & (walk.level < heights.top)
    level = dr.select(passed, dr.select(step_up, walk.level + 1, walk.level), walk.level - 1)
    return _Walk(dr.select(passed, after, walk.place), level, lit, intervals, over)


def _line(ray, kx, ky):
    """Return G."""
    foot, height, _ = ray
    return dr.fma(height, kx, foot * ky)


def _line_value(heights: SliceHeights, number, ray, q):
    """Return G at a place along k(q), counted in leaves."""
    return _line(ray, *line_point(heights, number, q))


def _position(heights: SliceHeights, number, ray, x):
    """Return where the point at x lies along k(q), in leaves."""
    foot, height, square = ray
    # At infinity k_y = Y = x h, which is linear along the band.
    if heights.chord is not None and not heights.slices.w:
        y0, y1 = (dr.gather(type(x), heights.chord[end], number) for end in (1, 3))
        return dr.clip((x * height - y0) / (y1 - y0), 0, 1) * heights.size
    # D P = (D^2 - x t, x h), since D direction = (-t, h). The end of an unbounded ray is the
    # direction (-t, h) itself.
    finite = dr.isfinite(x)
    at = dr.select(finite, x, 1)
    px = dr.fma(-at, foot, dr.select(finite, square, 0))
    py = at * height
    if heights.chord is None:
        # The first edge is k = (1 - q, q), so q = py / (px + py); the second is (1 - q, 2 - q).
        q = dr.select(px >= 0, py / (px + py), 2 - py / (py - px))
        # P at the light itself has no direction.
        q = dr.select(px + py == 0, 0, q)
    else:
        # The chord from k0 to k1 is divided in the ratio of the areas that P spans with its ends.
        x0, y0, x1, y1 = (dr.gather(type(x), place, number) for place in heights.chord)
        before, beyond = x0 * py - y0 * px, px * y1 - py * x1
        # Outside the wedge of the chord one of them is negative.
        before, beyond = dr.maximum(before, 0), dr.maximum(beyond, 0)
        q = dr.select(before + beyond > 0, before / (before + beyond), 0)
    return dr.clip(q, 0, heights.edges) * heights.size
