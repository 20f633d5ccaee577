# SPDX-License-Identifier: BSD-3-Clause
"""The lit intervals of camera rays in a light volume.

A ray goes over the faces of the map that its tile may pass, in the order of the tile's middle ray. In each it finds
where it crosses the volume's boundary (`realtime.methods.light_volumes.crossings`); between crossings it is lit or dark
as a whole, and the kernel integrates each lit interval (`realtime.intervals.lit_intervals`).

What is lit up to the border of a face, and on from there in the next one, is one interval: it waits until it ends. At a
face where all is lit that the tile passes no ray looks.
"""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.intervals.lit_intervals import LitIntervals, add_waiting, close_interval, no_intervals
from realtime.methods.light_volumes.crossings import NearestCrossings, nearest_crossings
from realtime.methods.light_volumes.cube_faces import FACE_BITS, NO_FACE
from realtime.methods.light_volumes.ray_lines import FaceRay, face_ray, in_face
from realtime.methods.light_volumes.texel_lines import line_of
from realtime.methods.light_volumes.tile_lists import LARGER, LIT, Leaves
from realtime.shadow_maps.inverse_depth_field import InverseDepthField


def sum_lit_intervals(
    heights: InverseDepthField,
    leaves: Leaves,
    *,
    away,
    direction,
    segment,
    integral: Callable[[Any, Any], Any],
    zero,
    tile,
):
    """Add up an integral over the lit intervals of every ray.

    Parameters
    ----------
    heights, leaves
        The height field and which of its leaves concern each tile.
    away
        The camera less the light [m].
    direction
        Unit directions of the rays.
    segment
        Distances (x0, x1) between which to look; `x1` may be infinite [m].
    integral
        Function (x0, x1) -> value of one interval.
    zero
        The value of no interval, one for each ray.
    tile
        The tile of every ray, see `realtime.methods.interface.view.View`.

    Returns
    -------
    total
        Sum over the lit intervals.
    lit
        Whether the light reaches what is at the end of the segment: a hard shadow by the shadow map, with the range of
        the heights over a texel as its bias.
    """
    width = dr.width(direction, zero)

    def of_face(to_come, intervals, reached):
        face = to_come & NO_FACE
        begin, end = in_face(heights, face, away, direction, segment)
        passes = begin < end
        place = tile * heights.faces + face
        first, last = (dr.gather(mi.UInt32, ends, place, passes) for ends in (leaves.first, leaves.last))
        # The whole part is lit. It joins the interval before it, unless that lies elsewhere.
        lit = passes & ((first & LIT) != 0) & (~intervals.waits | (intervals.end == begin))
        intervals = close_interval(intervals, end, lit, begin=dr.select(intervals.waits, intervals.begin, begin))

        def walk(intervals, reached):
            ray = replace(face_ray(heights, face, away, direction, (begin, end)), stops=end >= segment[1])
            source = leaves, first & (LIT - 1), last, (first & LARGER) != 0
            intervals, lit = _over_face(heights, face, ray, source, intervals, integral)
            return intervals, dr.select(end >= segment[1], lit, reached)

        intervals, reached = dr.if_stmt(
            args=(intervals, reached | (lit & (end >= segment[1]))),
            cond=passes & ~lit,
            true_fn=walk,
            false_fn=lambda *unchanged: unchanged,
        )
        return to_come >> FACE_BITS, intervals, reached

    intervals = no_intervals(zero, dr.zeros(type(segment[1]), width))
    no = dr.full(mi.Bool, False, width)
    if heights.faces == 1:
        _, intervals, reached = of_face(mi.UInt32(0), intervals, no)
    else:
        _, intervals, reached = dr.while_loop(
            state=(dr.gather(mi.UInt32, leaves.faces, tile), intervals, no),
            cond=lambda to_come, intervals, reached: to_come != NO_FACE,
            body=of_face,
            labels=("to_come", "intervals", "reached"),
        )
    return add_waiting(intervals, integral).total, reached


def _over_face(heights, face, ray: FaceRay, source, intervals: LitIntervals, integral):
    """Go over one face.

    Returns
    -------
    intervals
        With those of the face; what may go on in the next one waits.
    reached
        Whether the ray is lit where it leaves the face.
    """
    line = line_of(heights, face, ray)
    # All is lit before the line begins, and after it ends early.
    lit = ~ray.walks | (line.excess[0] > 0)
    reached = ~ray.walks | (line.excess[1] > -line.slack)

    def one_pass(after, intervals, more):
        nearest = nearest_crossings(heights, face, line, source, after, more & ray.walks)
        intervals = _add_between(nearest, ray, after, lit ^ nearest.odd, more, integral, intervals)
        return dr.select(nearest.lost, nearest.queue.key[-1], after), intervals, more & nearest.lost

    after = ray.begin + dr.zeros(type(ray.begin), dr.width(intervals))
    _, intervals, _ = dr.while_loop(
        state=(after, intervals, ray.begin < ray.end),
        cond=lambda after, intervals, more: more,
        body=one_pass,
        labels=("after", "intervals", "more"),
    )
    return intervals, reached


def _add_between(nearest: NearestCrossings, ray: FaceRay, after, lit, active, integral, intervals: LitIntervals):
    """Add the lit intervals between the crossings of a queue; the last one is left if there are more crossings.

    The first goes on from one that waits and ends where it begins. One that reaches the end of the face waits, unless
    another one does: of a ray that passes the faces in another order than its tile, or where two faces are at odds
    about a point on their border, by rounding.
    """
    queue, more = nearest.queue.key, nearest.lost
    goes_on = active & intervals.waits & lit & (intervals.end == after)
    waits = intervals.waits & ~goes_on
    # Lit intervals lie between the first and second entry, the third and fourth, and so on.
    bounds = [dr.select(lit, dr.select(goes_on, intervals.begin, after), queue[0])]
    bounds += [dr.select(lit, before, behind) for before, behind in pairwise(queue)]
    bounds.append(dr.select(lit & ~more, queue[-1], dr.inf))
    bounds = [dr.minimum(bound, ray.end) for bound in bounds]

    def body(k, bounds, total):
        value = dr.select(bounds[0] < bounds[1], integral(bounds[0], bounds[1]), 0)
        return k + 1, [*bounds[2:], ray.end, ray.end], total + value

    def is_whole(k, bounds, total):
        return active & (bounds[0] < ray.end) & (k < len(queue)) & (waits | (bounds[1] < ray.end))

    Float = type(ray.end)
    width = dr.width(intervals)
    padded = [*bounds, ray.end]
    _, bounds, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), [bound + dr.zeros(Float, width) for bound in padded], intervals.total),
        cond=is_whole,
        body=body,
        labels=("k", "bounds", "total"),
    )
    left = active & (bounds[0] < ray.end) & ~waits
    return close_interval(replace(intervals, total=total, waits=waits), ray.end, left, begin=bounds[0])
