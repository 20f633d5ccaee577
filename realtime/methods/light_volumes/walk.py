# SPDX-License-Identifier: BSD-3-Clause
"""The lit intervals of camera rays in a light volume, by a descent into the pyramid of its heights.

A ray goes over the faces of the map in the order in which it passes them. Over a face its line in
(u, v) goes from node to node of the pyramid of bounds (`realtime.shadow_maps.inverse_depth_field`).
With D(t) = s of the ray - height, a node over which the ray is above the largest height is lit as a
whole, one over which it is below the least is dark; the ray steps to its neighbour, one level up
where the border is the parent's too. Into any other node it descends, down to the texels. In
a texel it crosses the height field not at all, once, or twice
(`realtime.methods.light_volumes.texel_crossings`), and between crossings it is lit or dark as a
whole (`realtime.intervals`). Crossings therefore come in the order of the ray.

The borders of a node are crossed at t = (column - u0) dt/du and t = (row - v0) dt/dv, computed from
these four borders alone. Two neighbours therefore see the same number t between them and, if they
are texels, the same two heights: the sign of D, lit or not, is the same for both. A whole node says
by itself whether it is lit; where rounding makes this differ from the ray before the node, the
change is at the beginning of the node.

Lit intervals that meet at the border of two faces are one interval.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.intervals import (
    LitIntervals,
    add_waiting,
    close_interval,
    no_intervals,
    sum_at_end,
)
from airlight.realtime.methods.light_volumes.face_lines import (
    Line,
    at_line,
    distance_at,
    face_ray,
    in_face,
    line_of,
)
from airlight.realtime.methods.light_volumes.texel_crossings import passage, texel_crossings
from airlight.realtime.shadow_maps.inverse_depth_field import InverseDepthField, node_bounds

_NO_FACE = 0b111  # stands behind the last in an order of faces, whose numbers are 0 to 5
_FACE_BITS = _NO_FACE.bit_length()  # of each number there


@dataclass
class _Walk:
    """Where a ray is on its way over a face; columns and rows are counted along its line."""

    i: Any  #: column of the texel at which it comes into the node
    j: Any  #: row
    t: Any  #: where it does so
    shift: Any  #: the node has 2^shift texels on a side
    lit: Any  #: whether the light reaches the ray there
    opened: Any  #: where the light came back last [m]
    intervals: LitIntervals  #: in distances [m]
    done: Any


def sum_lit_intervals(
    heights: InverseDepthField,
    *,
    away,
    direction,
    segment,
    integral: Callable[[Any, Any], Any],
    zero,
):
    """Add up an integral over the lit intervals of every ray.

    `heights`: the height field; `away`: the camera less the light [m]; `direction`: unit directions
    of the rays; `segment`: distances (x0, x1) between which to look; `x1` may be infinite [m];
    function (x0, x1) -> value of one interval; `zero`: the value of no interval, one for each ray.
    Returns `total`: sum over the lit intervals; `lit`: whether the light reaches what is at the end
    of the segment: a hard shadow by the shadow map, with the range of the heights over a texel as
    its bias.
    """
    x0, x1 = segment
    width = dr.width(direction, zero)
    start = x0 + dr.zeros(type(x1), width)

    def between(begin, end):
        return integral(begin, dr.maximum(begin, end))

    def of_face(to_come, lit, opened, intervals, reached):
        # The lowest bits are the number of the next face that the ray passes.
        face = to_come & _NO_FACE
        begin, end = in_face(heights, face, away, direction, segment)
        ray = replace(face_ray(heights, face, away, direction, (begin, end)), stops=end >= x1)
        line = line_of(heights, face, ray)
        # All is lit before the line begins, and after it ends early.
        lit_here = ~ray.walks | (line.excess[0] > 0)
        # At the border of two faces nothing changes if both say the same, so lit intervals go on
        # over it.
        passes = begin < end
        changes = passes & (lit != lit_here)
        intervals, opened = _changed(intervals, (begin, begin), opened, lit, (changes, none))
        # The walk begins in a node three levels below the whole face. Columns and rows are counted
        # along the line, so that the ray always goes to larger ones.
        way = _way(heights, face, line)
        walk = _Walk(
            i=line.cells[0][0] ^ way.mirror[0],
            j=line.cells[0][1] ^ way.mirror[1],
            t=dr.zeros(type(x1), width),
            shift=dr.full(mi.UInt32, max(heights.finest - 3, 0), width),
            lit=dr.select(passes, lit_here, lit),
            opened=opened,
            intervals=intervals,
            done=~(passes & ray.walks),
        )
        (walk,) = dr.while_loop(
            state=(walk,),
            cond=lambda walk: ~walk.done,
            body=lambda walk: (_next_interval(way, walk, between),),
            labels=("walk",),
        )
        # The face in which the segment ends says whether its end is lit: D there, up to the slack,
        # which is the bias of this shadow.
        surface_lit = ~ray.walks | (line.excess[1] > -line.slack)
        reached = dr.select(passes & (end >= x1), surface_lit, reached)
        # Nothing stands beside the map of a light whose medium has no sides.
        leaves = passes & beside & ~walk.lit
        opened = dr.select(leaves, end, walk.opened)
        return to_come >> _FACE_BITS, walk.lit | leaves, opened, walk.intervals, reached

    none = dr.full(mi.Bool, False, width)
    beside = none | heights.projection.goes_on
    state = +beside, start, no_intervals(zero, +start), none & True
    if heights.faces == 1:
        _, *state = of_face(mi.UInt32(0), *state)
    else:
        _, *state = dr.while_loop(
            state=(_faces_in_order(heights, away, direction, segment), *state),
            cond=lambda to_come, *_: to_come != _NO_FACE,
            body=of_face,
            labels=("to_come", "lit", "opened", "intervals", "reached"),
        )
    lit, opened, intervals, reached = state
    wanted = mi.Bool(x1 > x0)
    return sum_at_end(intervals, between, x1, opened=opened, lit=lit, active=wanted), reached


def _faces_in_order(heights: InverseDepthField, away, direction, segment):
    """Return the faces that rays pass in the order of their beginnings, three bits each,
    the first in the lowest.
    """
    begins = []
    for face in range(heights.faces):
        begin, end = in_face(heights, mi.UInt32(face), away, direction, segment)
        begins.append(dr.select(begin < end, begin, dr.inf))
    count, order = mi.UInt32(0), mi.UInt32(0)
    for face, begin in enumerate(begins):
        rank = mi.UInt32(0)
        # The rank of a face is how many begin before it; of two that begin at one place the face of
        # the lower number comes first.
        for other, its_begin in enumerate(begins):
            before = its_begin <= begin if other < face else its_begin < begin
            rank += dr.select(before, mi.UInt32(1), 0)
        passed = begin < dr.inf
        # Its number stands at the place of its rank; the mark of no face comes behind the last.
        order |= dr.select(passed, mi.UInt32(face) << (_FACE_BITS * rank), 0)
        count += dr.select(passed, mi.UInt32(1), 0)
    return order | (mi.UInt32(_NO_FACE) << (_FACE_BITS * count))


@dataclass
class _Way:
    """The line of a ray over a face, counted from where it comes from:
    columns and rows rise along it.
    """

    heights: InverseDepthField
    face: Any
    line: Line
    #: columns and rows of the face are these numbers with those bits the other way round
    mirror: tuple[Any, Any]
    start: tuple[Any, Any]  #: columns and rows of the line at t = 0 [texels]
    per: tuple[Any, Any]  #: dt a column and a row


def _way(heights: InverseDepthField, face, line: Line) -> _Way:
    ray, last = line.ray, heights.size - 1
    # Where columns fall along the line they are counted from the far border: all bits the other way
    # round, as `size` is a power of two.
    mirror = tuple(
        dr.select(rises, mi.UInt32(0), mi.UInt32(last)) for rises in (line.right, line.up)
    )
    start = tuple(
        dr.select(rises, pair[0], heights.size - pair[0])
        for rises, pair in ((line.right, ray.u), (line.up, ray.v))
    )
    return _Way(heights, face, line, mirror, start, (dr.abs(ray.per_u), dr.abs(ray.per_v)))


def _next_interval(way: _Way, walk: _Walk, integral) -> _Walk:
    """Go on to the end of a lit interval, or of the line, and integrate.

    Rays whose intervals end at different places wait for one another here: an integral
    costs as much as many steps.
    """
    (walk,) = dr.while_loop(
        state=(walk,),
        cond=lambda walk: ~(walk.intervals.waits | walk.done),
        body=lambda walk: (_next_texel(way, walk),),
        labels=("walk",),
    )
    walk.intervals = add_waiting(walk.intervals, integral)
    return walk


def _next_texel(way: _Way, walk: _Walk) -> _Walk:
    """Go over nodes up to one that has to be looked at, and look at it: a texel, or one
    that is not as before it.
    """
    none = walk.done & False

    def step(i, j, t, shift, done, stops, whole):
        return _step(way, (i, j, t, shift), walk.lit)

    i, j, t, shift, done, stops, whole = dr.while_loop(
        state=(walk.i, walk.j, walk.t, walk.shift, walk.done, none, none & True),
        cond=lambda i, j, t, shift, done, stops, whole: ~(stops | done),
        body=step,
        labels=("i", "j", "t", "shift", "done", "stops", "whole"),
    )
    line = way.line
    # In a texel crossings are computed. At a node that is lit or dark as a whole, against what the
    # ray was before it, the change is at its beginning.
    over = passage(way.heights, way.face, line, (i ^ way.mirror[0], j ^ way.mirror[1]))
    here = texel_crossings(line, over)
    crosses = stops & (whole | here.crosses)
    twice = stops & ~whole & here.crosses & here.twice
    x, second = (
        distance_at(line.ray, dr.select(whole, t, here.t)),
        distance_at(line.ray, here.second),
    )
    intervals, opened = _changed(
        walk.intervals, (x, second), walk.opened, walk.lit, (crosses, twice)
    )
    ahead, end, has_next = _neighbour(way, i, j, shift)
    goes_on = stops & has_next
    i, j, t = (dr.select(goes_on, new, old) for new, old in zip((*ahead, end), (i, j, t)))
    return _Walk(
        i, j, t, shift, walk.lit ^ crosses ^ twice, opened, intervals, done | (stops & ~has_next)
    )


def _changed(intervals: LitIntervals, x, opened, lit, changes):
    """Return the intervals, and where the last one opened, behind a place `x` [m] where
    the light comes or ends.

    If there are two places, one closes an interval and the other opens one; nothing may wait.
    """
    # A lit ray closes at the first place and opens again at the second; a dark one opens at the
    # first and closes at the second.
    (first, second), (changes, twice) = x, changes
    closes = (changes & lit) | twice
    end, begin = dr.select(lit, first, second), dr.select(lit, opened, first)
    intervals = close_interval(intervals, end, closes, begin=begin)
    return intervals, dr.select(changes & ~lit, first, dr.select(twice, second, opened))


def _step(way: _Way, node, was_lit):
    """Look at the bounds of one node: go over it, or down into it, or stay."""
    i, j, t, shift = node
    heights, ray = way.heights, way.line.ray
    ahead, end, has_next = _neighbour(way, i, j, shift)
    # Back to columns and rows of the face, for the node that holds the texel.
    column, row = (i ^ way.mirror[0]) >> shift, (j ^ way.mirror[1]) >> shift
    low, high = node_bounds(heights, way.face, heights.finest - shift, column, row)
    # s is linear along the line: its values at both ends bound it over the node.
    s0, s1 = at_line(ray.s, t), at_line(ray.s, end)
    lit, dark = dr.minimum(s0, s1) > high, dr.maximum(s0, s1) <= low
    whole, empty = lit | dark, t >= end
    # Over a node that is as the ray was before it, or in which the line has no length by rounding;
    # down into one that is neither lit nor dark as a whole. The others wait for `_next_texel`.
    over = (whole & (lit == was_lit)) | empty
    down = ~over & ~whole & (shift > 0)
    # One level up where the neighbour is beyond the parent too.
    up = over & (shift < heights.finest) & ((((i ^ ahead[0]) | (j ^ ahead[1])) >> shift) > 1)
    shift = dr.select(down, shift - 1, dr.select(up, shift + 1, shift))
    # A ray at the end of its line stays in its last node: it is looked at with the
    # others, and must be in the map.
    goes_on = over & has_next
    i, j, t = (dr.select(goes_on, new, old) for new, old in zip((*ahead, end), (i, j, t)))
    return i, j, t, shift, over & ~has_next, ~over & ~down, whole


def _neighbour(way: _Way, i, j, shift):
    """Return the texel at which a line comes into the neighbour of a node, where,
    and whether there is one.
    """
    ray, size = way.line.ray, way.heights.size
    Float = type(ray.begin)
    # The first column and row behind the node, and t where the line crosses each border: it leaves
    # through the nearer one.
    rest = (mi.UInt32(1) << shift) - 1
    next_i, next_j = (i | rest) + 1, (j | rest) + 1
    out_u, out_v = (
        (Float(n) - start) * per for n, start, per in zip((next_i, next_j), way.start, way.per)
    )
    by_u, end = out_u <= out_v, dr.minimum(dr.minimum(out_u, out_v), 1)
    # Behind that border the line comes into the first texel; along the border into the texel where
    # it is, kept within the node's own rows or columns against rounding.
    along_u, along_v = (
        dr.abs(pair[1] - pair[0]) * end + start for pair, start in zip((ray.u, ray.v), way.start)
    )
    ahead_i = dr.select(by_u, next_i, dr.clip(mi.UInt32(along_u), i, next_i - 1))
    ahead_j = dr.select(by_u, dr.clip(mi.UInt32(along_v), j, next_j - 1), next_j)
    return (ahead_i, ahead_j), end, (end < 1) & (ahead_i < size) & (ahead_j < size)
