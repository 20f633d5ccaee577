# SPDX-License-Identifier: BSD-3-Clause
"""The lit pieces of camera rays in a light volume.

A ray goes over the faces of the map that its tile may pass, in the order of the tile's middle ray. In each it finds
where it crosses the volume's boundary (`realtime.methods.light_volumes.crossings`); between crossings the kernel
integrates each lit piece by itself: a sum of positive terms, where a sum of J(0, x) of both signs would lose digits.

What is lit up to the border of a face, and on from there in the next one, is one piece: it is held until it ends. At a
face where all is lit that the tile passes no ray looks.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.light_volumes.crossings import Crossings, nearest_crossings
from realtime.methods.light_volumes.cube_faces import FACE_BITS, NO_FACE
from realtime.methods.light_volumes.ray_lines import FaceRay, face_ray, in_face
from realtime.methods.light_volumes.texel_lines import line_of
from realtime.methods.light_volumes.tile_lists import LARGER, LIT, Leaves
from realtime.shadow_maps.inverse_depth_field import InverseDepthField


def sum_lit_pieces(
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
    """Add up an integral over the lit pieces of every ray.

    Parameters
    ----------
    heights, leaves
        The height field and which of its leaves concern each tile.
    away
        The camera less the light [m].
    direction
        Unit directions of the rays.
    segment
        Distances (x0, x1) between which to look; `x1` may be infinite.
    integral
        Function (x0, x1) -> value of one piece.
    zero
        The value of no piece, one for each ray.
    tile
        The tile of every ray, see `realtime.methods.interface.view.View`.

    Returns
    -------
    total
        Sum over the lit pieces.
    lit
        Whether the light reaches what is at the end of the segment: a hard shadow by the shadow map, with the range of
        the heights over a texel as its bias.
    """
    width = dr.width(direction, zero)

    def of_face(to_come, run, total, reached):
        face = to_come & NO_FACE
        begin, end = in_face(heights, face, away, direction, segment)
        passes = begin < end
        place = tile * heights.faces + face
        first, last = (dr.gather(mi.UInt32, ends, place, passes) for ends in (leaves.first, leaves.last))
        # All lit, and one piece with what was lit before, unless that lies elsewhere.
        lit = passes & ((first & LIT) != 0) & (~run.held | (run.end == begin))
        run = _Run(dr.select(lit & ~run.held, begin, run.begin), dr.select(lit, end, run.end), run.held | lit)

        def walk(run, total, reached):
            ray = replace(face_ray(heights, face, away, direction, (begin, end)), stops=end >= segment[1])
            source = leaves, first & (LIT - 1), last, (first & LARGER) != 0
            run, total, lit = _face_sum(heights, face, ray, source, run, total, integral)
            return run, total, dr.select(end >= segment[1], lit, reached)

        run, total, reached = dr.if_stmt(
            args=(run, total, reached | (lit & (end >= segment[1]))),
            cond=passes & ~lit,
            true_fn=walk,
            false_fn=lambda *unchanged: unchanged,
        )
        return to_come >> FACE_BITS, run, total, reached

    no, nowhere = dr.full(mi.Bool, False, width), dr.zeros(type(segment[1]), width)
    state = _Run(nowhere, nowhere + 0, no), zero, no & True
    if heights.faces == 1:
        _, run, total, reached = of_face(mi.UInt32(0), *state)
    else:
        _, run, total, reached = dr.while_loop(
            state=(dr.gather(mi.UInt32, leaves.faces, tile), *state),
            cond=lambda to_come, run, total, reached: to_come != NO_FACE,
            body=of_face,
            labels=("to_come", "run", "total", "reached"),
        )

    def add_run(total, begin, end):
        return total + integral(begin, end), begin, end

    args = total, run.begin, run.end
    total, *_ = dr.if_stmt(args=args, cond=run.held, true_fn=add_run, false_fn=lambda *unchanged: unchanged)
    return total, reached


@dataclass
class _Run:
    """A lit piece of a ray that may go on in the next face: it is integrated as one."""

    begin: Any  #: [m]
    end: Any
    held: Any  #: whether there is one


def _face_sum(heights, face, ray: FaceRay, source, run: _Run, total, integral):
    """Add the lit pieces of one face to a total, but for one that may go on.

    Returns
    -------
    run
        What may go on in the next face.
    total
        With all others.
    reached
        Whether the ray is lit where it leaves the face.
    """
    line = line_of(heights, face, ray)
    # All is lit before the line begins, and after it ends early.
    lit = ~ray.walks | (line.excess[0] > 0)
    reached = ~ray.walks | (line.excess[1] > -line.slack)

    def one_pass(after, run, total, more):
        found = nearest_crossings(heights, face, line, source, after, more & ray.walks)
        run, total = _add_pieces(found, ray, after, lit ^ found.odd, more, integral, run, total)
        return dr.select(found.lost, found.queue[-1], after), run, total, more & found.lost

    after = ray.begin + dr.zeros(type(ray.begin), dr.width(total))
    _, run, total, _ = dr.while_loop(
        state=(after, run, total, ray.begin < ray.end),
        cond=lambda after, run, total, more: more,
        body=one_pass,
        labels=("after", "run", "total", "more"),
    )
    return run, total, reached


def _add_pieces(found: Crossings, ray: FaceRay, after, lit, active, integral, run: _Run, total):
    """Add the lit pieces between the crossings of a queue; the last one waits if there are more crossings.

    The first goes on from a run that ends where it begins. One that reaches the end of the face is the new run, unless
    there is one already: of a ray that passes the faces in another order than its tile, or where two faces are at odds
    about a point on their border, by rounding.
    """
    queue, more = found.queue, found.lost
    goes_on = active & run.held & lit & (run.end == after)
    held = run.held & ~goes_on
    # Lit pieces lie between the first and second entry, the third and fourth, and so on.
    bounds = [dr.select(lit, dr.select(goes_on, run.begin, after), queue[0])]
    bounds += [dr.select(lit, before, behind) for before, behind in pairwise(queue)]
    bounds.append(dr.select(lit & ~more, queue[-1], dr.inf))
    bounds = [dr.minimum(bound, ray.end) for bound in bounds]

    def body(k, bounds, total):
        value = dr.select(bounds[0] < bounds[1], integral(bounds[0], bounds[1]), 0)
        return k + 1, [*bounds[2:], ray.end, ray.end], total + value

    def is_whole(k, bounds, total):
        return active & (bounds[0] < ray.end) & (k < len(queue)) & (held | (bounds[1] < ray.end))

    Float = type(ray.end)
    width = dr.width(total)
    padded = [*bounds, ray.end]
    _, bounds, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), [bound + dr.zeros(Float, width) for bound in padded], total),
        cond=is_whole,
        body=body,
        labels=("k", "bounds", "total"),
    )
    begins = active & (bounds[0] < ray.end) & ~held
    run = _Run(dr.select(begins, bounds[0], run.begin), dr.select(begins, ray.end, run.end), held | begins)
    return run, total
