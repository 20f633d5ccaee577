# SPDX-License-Identifier: BSD-3-Clause
"""The lit pieces of camera rays in a light volume: each ray looks at the texels on its line.

A ray's line in (u, v) crosses the borders of texels at t = (column - u0) dt/du and t = (row - v0) dt/dv. In order,
these cut [0, 1] into pieces of one texel each, and a texel's own piece is computed from its own four borders alone. So
two neighbours see the same number t between them, and the same two heights: the sign of

    D(t) = s of the ray - height

there, lit or not, is the same for both. Crossings are where D changes its sign from one end of a piece, over the
texel's diagonal or the wall in it (`realtime.volume_passages`), to the other; between these D is linear in t. Which
texels are looked at, and in what order, does not matter (Billeter, Sintorn, Assarsson 2010, eq. 3), and what
`realtime.volume_tiles` leaves out has no change of sign. A ray that is lit at its beginning is lit at its end after an
even number of crossings: no tolerance can break it.

A leaf's texels are looked at only where the tile may cross them and the ray passes: one bit each, 64 bits for four
leaves. What is found to be crossed is computed again to be kept, since most is not.

Crossings are kept in order of distance, the nearest eight. A ray with more goes over its texels again for those that
are farther; two may lie at the same distance, so it counts anew how many it has passed. Between crossings the kernel
integrates each lit piece by itself: a sum of positive terms, where a sum of J(0, x) of both signs would lose digits.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

from realtime.light_heights import LightHeights
from realtime.volume_passages import Passage, may_cross, passage, texel_crossings
from realtime.volume_rays import FaceRay, distance_at, face_ray, in_face
from realtime.volume_texels import Line, borders, cell_at, line_of, slope_of, texels_on
from realtime.volume_tiles import CHUNK, LARGER, TILE, Leaves, unpacked

PLACES = 8  #: crossings that a ray keeps; even, so that it is lit after them as before


def sum_lit_pieces(
    heights: LightHeights, leaves: Leaves, *, away, direction, segment, integral: Callable[[Any, Any], Any], zero
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

    Returns
    -------
    total
        Sum over the lit pieces.
    lit
        Whether the light reaches what is at the end of the segment: a hard shadow by the shadow map, with the range of
        the heights over a texel as its bias.
    """
    import drjit as dr
    import mitsuba as mi

    width = dr.width(direction, zero)
    tile = dr.arange(mi.UInt32, width) // TILE

    def of_face(to_come, total, reached):
        face = mi.UInt32(dr.tzcnt(to_come))
        begin, end = in_face(heights, face, away, direction, segment)

        def add(total, reached):
            ray = replace(face_ray(heights, face, away, direction, (begin, end)), stops=end >= segment[1])
            place = tile * heights.faces + face
            first, last = (dr.gather(mi.UInt32, ends, place) for ends in (leaves.first, leaves.last))
            source = leaves, first & (LARGER - 1), last, (first & LARGER) != 0
            total, lit = _face_sum(heights, face, ray, source, total, integral)
            return total, dr.select(end >= segment[1], lit, reached)

        total, reached = dr.if_stmt(
            args=(total, reached), cond=begin < end, true_fn=add, false_fn=lambda total, reached: (total, reached)
        )
        return to_come & (to_come - 1), total, reached

    if heights.faces == 1:
        _, total, reached = of_face(mi.UInt32(1), zero, dr.full(mi.Bool, False, width))
        return total, reached
    _, total, reached = dr.while_loop(
        state=(dr.gather(mi.UInt32, leaves.faces, tile), zero, dr.full(mi.Bool, False, width)),
        cond=lambda to_come, total, reached: to_come != 0,
        body=of_face,
        labels=("to_come", "total", "reached"),
    )
    return total, reached


def _face_sum(heights, face, ray: FaceRay, source, total, integral):
    """Add the lit pieces of one face to a total; return also whether the ray is lit where it leaves the face."""
    import drjit as dr

    line = line_of(heights, face, ray)
    # All is lit before the line begins, and after it ends early.
    lit = ~ray.walks | (line.excess[0] > 0)
    reached = ~ray.walks | (line.excess[1] > -line.slack)

    def one_pass(after, total, more):
        found = _nearest_crossings(heights, face, line, source, after, more & ray.walks)
        total = _add_pieces(found, ray, after, lit ^ found.odd, more, integral, total)
        return dr.select(found.lost, found.queue[-1], after), total, more & found.lost

    after = ray.begin + dr.zeros(type(ray.begin), dr.width(total))
    _, total, _ = dr.while_loop(
        state=(after, total, ray.begin < ray.end),
        cond=lambda after, total, more: more,
        body=one_pass,
        labels=("after", "total", "more"),
    )
    return total, reached


@dataclass
class _Crossings:
    """Crossings of rays, beyond some distance."""

    queue: list[Any]  #: the nearest, in order, infinite where there are no more [m]
    lost: Any  #: whether others had no place in it
    odd: Any  #: whether an odd number of them is not beyond that distance


def _nearest_crossings(heights, face, line: Line, source, after, active):
    """Return the nearest crossings beyond `after`, and whether there are more."""
    import drjit as dr
    import mitsuba as mi

    leaves, first, last, larger = source
    Float = type(after)
    width = dr.width(after)
    last = dr.select(active, last, first)
    slope = slope_of(line, heights.size)

    def of_chunk(k, found):
        bits = _chunk_bits(line, slope, leaves, k, last)

        def texel(bits):
            bit = mi.UInt32(dr.tzcnt(bits))
            node = unpacked(dr.gather(mi.UInt32, leaves.entries, k + (bit >> 4)))
            return (node.i << 2) + (bit & 3), (node.j << 2) + ((bit >> 2) & 3)

        def look(bits, crossed):
            lowest = bits & (~bits + 1)
            found = may_cross(line, passage(heights, face, line, texel(bits)))
            return bits ^ lowest, crossed | dr.select(found, lowest, 0)

        _, crossed = dr.while_loop(
            state=(bits, mi.UInt64(0)), cond=lambda bits, crossed: bits != 0, body=look, labels=("bits", "crossed")
        )

        def keep(crossed, found):
            found = _with_crossings(line, passage(heights, face, line, texel(crossed)), found, after)
            return crossed & (crossed - 1), found

        _, found = dr.while_loop(
            state=(crossed, found), cond=lambda crossed, found: crossed != 0, body=keep, labels=("crossed", "found")
        )
        return k + CHUNK, found

    def of_larger(k, found):
        node = unpacked(dr.gather(mi.UInt32, leaves.entries, k))
        side = mi.UInt32(heights.size) >> node.level
        return k + 1, _square_crossings(heights, face, line, (node.i * side, node.j * side, side), found, after)

    queue, no = [dr.full(Float, dr.inf, width) for _ in range(PLACES)], dr.full(mi.Bool, False, width)
    found = _Crossings(queue, no, no & True)
    for kind, body in ((~larger, of_chunk), (larger, of_larger)):
        _, found = dr.while_loop(
            state=(dr.select(kind, first, last), found),
            cond=lambda k, found: k < last,
            body=body,
            labels=("k", "found"),
        )
    return found


def _chunk_bits(line: Line, slope, leaves, k, last):
    """Return 16 bits for each leaf of a chunk: which of its texels the tile may cross and the ray passes."""
    import drjit as dr
    import mitsuba as mi

    bits = mi.UInt64(0)
    for place in range(CHUNK):
        node = unpacked(dr.gather(mi.UInt32, leaves.entries, k + place))
        texels = dr.gather(mi.UInt32, leaves.texels, k + place) & texels_on(line, slope, node)
        bits |= mi.UInt64(dr.select(k + place < last, texels, 0)) << (16 * place)
    return bits


def _with_crossings(line: Line, over: Passage, found: _Crossings, after) -> _Crossings:
    """Add the crossings of a texel; few rays have two, in a branch of their own."""
    import drjit as dr

    here = texel_crossings(line, over)
    found = _with_crossing(found, here.crosses, distance_at(line.ray, here.t), after)

    def add(found, x):
        return _with_crossing(found, dr.full(type(here.twice), True), x, after)

    args = found, distance_at(line.ray, here.second)
    return dr.if_stmt(args=args, cond=here.twice, true_fn=add, false_fn=lambda found, x: found)


def _with_crossing(found: _Crossings, crosses, x, after) -> _Crossings:
    """Add a crossing at distance `x` where there is one."""
    import drjit as dr

    queue, out = _inserted(found.queue, dr.select(crosses & (x > after), x, dr.inf))
    return _Crossings(queue, found.lost | (out < dr.inf), found.odd ^ (crosses & (x <= after)))


def _square_crossings(heights, face, line: Line, square, found: _Crossings, after) -> _Crossings:
    """Add the crossings in a square of texels, one after the other."""
    import drjit as dr

    column, row, side = square
    ray, Float = line.ray, type(after)
    in_u, out_u = borders(Float(column), ray.u[0], ray.per_u, Float(side))
    in_v, out_v = borders(Float(row), ray.v[0], ray.per_v, Float(side))
    begin, end = dr.maximum(dr.maximum(in_u, in_v), 0), dr.minimum(dr.minimum(out_u, out_v), 1)
    i, j = cell_at(ray.u, ray.per_u, begin, column, side), cell_at(ray.v, ray.per_v, begin, row, side)
    by_u = in_u >= begin
    i = dr.select(by_u, dr.select(line.right, column, column + side - 1), i)
    j = dr.select((in_v >= begin) & ~by_u, dr.select(line.up, row, row + side - 1), j)

    def step(i, j, t, found):
        over = passage(heights, face, line, (i, j))
        found = _with_crossings(line, over, found, after)
        by_u = borders(Float(i), ray.u[0], ray.per_u)[1] <= over.t[1]
        i = dr.select(by_u, dr.select(line.right, i + 1, i - 1), i)
        return i, dr.select(by_u, j, dr.select(line.up, j + 1, j - 1)), over.t[1], found

    return dr.while_loop(
        state=(i, j, begin, found),
        cond=lambda i, j, t, found: t < end,
        body=step,
        labels=("i", "j", "t", "found"),
    )[-1]


def _inserted(queue, x):
    """Return the queue with a distance in its place, and the farthest of all, which it has no room for."""
    import drjit as dr

    places = []
    for place in queue:
        places.append(dr.minimum(place, x))
        x = dr.maximum(place, x)
    return places, x


def _add_pieces(found: _Crossings, ray: FaceRay, after, lit, active, integral, total):
    """Add the lit pieces between the crossings of a queue; the last one waits if there are more crossings."""
    import drjit as dr
    import mitsuba as mi

    queue, more = found.queue, found.lost
    # Lit pieces lie between the first and second entry, the third and fourth, and so on.
    bounds = [dr.select(lit, after, queue[0])]
    bounds += [dr.select(lit, before, behind) for before, behind in pairwise(queue)]
    bounds.append(dr.select(lit & ~more, queue[-1], dr.inf))
    bounds = [dr.minimum(bound, ray.end) for bound in bounds]

    def body(k, bounds, total):
        value = dr.select(bounds[0] < bounds[1], integral(bounds[0], bounds[1]), 0)
        return k + 1, [*bounds[2:], ray.end, ray.end], total + value

    Float = type(ray.end)
    width = dr.width(total)
    padded = [*bounds, ray.end]
    _, _, total = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), [bound + dr.zeros(Float, width) for bound in padded], total),
        cond=lambda k, bounds, total: active & (bounds[0] < ray.end) & (k < PLACES),
        body=body,
        labels=("k", "bounds", "total"),
    )
    return total
