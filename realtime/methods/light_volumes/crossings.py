# SPDX-License-Identifier: BSD-3-Clause
"""The crossings of a camera ray with the boundary of a light volume: it looks at the texels on its line.

A ray's line in (u, v) crosses the borders of texels at t = (column - u0) dt/du and t = (row - v0) dt/dv. In order,
these cut [0, 1] into pieces of one texel each, and a texel's own piece is computed from its own four borders alone. So
two neighbours see the same number t between them, and the same two heights: the sign of

    D(t) = s of the ray - height

there, lit or not, is the same for both. Crossings are where D changes its sign from one end of a piece, over the
texel's diagonal or the wall in it (`realtime.methods.light_volumes.texel_crossings`), to the other; between these D is
linear in t. Which texels are looked at, and in what order, does not matter (Billeter, Sintorn, Assarsson 2010, eq. 3),
and what `realtime.methods.light_volumes.tile_lists` leaves out has no change of sign. A ray that is lit at its
beginning is lit at its end after an even number of crossings: no tolerance can break it.

A leaf's texels are looked at only where the tile may cross them and the ray passes: one bit each, 64 bits for four
leaves. Crossings are computed again when they are kept: most texels have none.

Crossings are kept in order of distance, the nearest eight. A ray with more goes over its texels again for those that
are farther; two may lie at the same distance, so it counts anew how many it has passed.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.intervals.nearest_crossings import Crossings, filled, insert
from realtime.methods.light_volumes.pyramid import unpacked
from realtime.methods.light_volumes.ray_lines import distance_at
from realtime.methods.light_volumes.texel_crossings import Passage, may_cross, passage, texel_crossings
from realtime.methods.light_volumes.texel_lines import Line, borders, cell_at, slope_of, texels_on
from realtime.methods.light_volumes.tile_lists import CHUNK

PLACES = 8  #: crossings that a ray keeps; even, so that it is lit after them as before


@dataclass
class NearestCrossings:
    """Crossings of rays, beyond some distance."""

    queue: Crossings  #: the nearest, by distance, infinite where there are no more [m]
    lost: Any  #: whether others had no place in it
    odd: Any  #: whether an odd number of them is not beyond that distance


def nearest_crossings(heights, face, line: Line, source, after, active) -> NearestCrossings:
    """Return the nearest crossings of rays beyond some distance.

    Parameters
    ----------
    heights, face
        The height field and the number of its face.
    line
        The lines of the rays over it.
    source
        The leaves of all tiles, the places of the first and behind the last one of the ray's, and whether they are
        larger nodes.
    after
        The distance [m].
    active
        Rays to look for.
    """
    leaves, first, last, larger = source
    Float = type(after)
    width = dr.width(after)
    last = dr.select(active, last, first)
    slope = slope_of(line, heights.size)

    def of_chunk(k, nearest):
        bits = _chunk_bits(line, slope, leaves, k, last)

        def texel(bits):
            bit = mi.UInt32(dr.tzcnt(bits))
            node = unpacked(dr.gather(mi.UInt32, leaves.entries, k + (bit >> 4)))
            return (node.i << 2) + (bit & 3), (node.j << 2) + ((bit >> 2) & 3)

        def look(bits, crossed):
            lowest = bits & (~bits + 1)
            is_crossed = may_cross(line, passage(heights, face, line, texel(bits)))
            return bits ^ lowest, crossed | dr.select(is_crossed, lowest, 0)

        _, crossed = dr.while_loop(
            state=(bits, mi.UInt64(0)), cond=lambda bits, crossed: bits != 0, body=look, labels=("bits", "crossed")
        )

        def keep(crossed, nearest):
            nearest = _with_crossings(line, passage(heights, face, line, texel(crossed)), nearest, after)
            return crossed & (crossed - 1), nearest

        _, nearest = dr.while_loop(
            state=(crossed, nearest),
            cond=lambda crossed, nearest: crossed != 0,
            body=keep,
            labels=("crossed", "nearest"),
        )
        return k + CHUNK, nearest

    def of_larger(k, nearest):
        node = unpacked(dr.gather(mi.UInt32, leaves.entries, k))
        side = mi.UInt32(heights.size) >> node.level
        return k + 1, _square_crossings(heights, face, line, (node.i * side, node.j * side, side), nearest, after)

    no = dr.full(mi.Bool, False, width)
    nearest = NearestCrossings(filled(dr.inf, PLACES, Float, width, gains=False), no, no & True)
    for kind, body in ((~larger, of_chunk), (larger, of_larger)):
        _, nearest = dr.while_loop(
            state=(dr.select(kind, first, last), nearest),
            cond=lambda k, nearest: k < last,
            body=body,
            labels=("k", "nearest"),
        )
    return nearest


def _chunk_bits(line: Line, slope, leaves, k, last):
    """Return 16 bits for each leaf of a chunk: which of its texels the tile may cross and the ray passes."""
    bits = mi.UInt64(0)
    for place in range(CHUNK):
        node = unpacked(dr.gather(mi.UInt32, leaves.entries, k + place))
        texels = dr.gather(mi.UInt32, leaves.texels, k + place) & texels_on(line, slope, node)
        bits |= mi.UInt64(dr.select(k + place < last, texels, 0)) << (16 * place)
    return bits


def _with_crossings(line: Line, over: Passage, nearest: NearestCrossings, after) -> NearestCrossings:
    """Add the crossings of a texel; few rays have two, in a branch of their own."""
    here = texel_crossings(line, over)
    nearest = _with_crossing(nearest, here.crosses, distance_at(line.ray, here.t), after)

    def add(nearest, x):
        return _with_crossing(nearest, dr.full(type(here.twice), True), x, after)

    args = nearest, distance_at(line.ray, here.second)
    return dr.if_stmt(args=args, cond=here.twice, true_fn=add, false_fn=lambda nearest, x: nearest)


def _with_crossing(nearest: NearestCrossings, crosses, x, after) -> NearestCrossings:
    """Add a crossing at distance `x` where there is one."""
    x_beyond = dr.select(crosses & (x > after), x, dr.inf)
    queue, farthest, _ = insert(nearest.queue, x_beyond, larger_is_nearer=False)
    return NearestCrossings(queue, nearest.lost | (farthest < dr.inf), nearest.odd ^ (crosses & (x <= after)))


def _square_crossings(heights, face, line: Line, square, nearest: NearestCrossings, after):
    """Add the crossings in a square of texels, one after the other."""
    column, row, side = square
    ray, Float = line.ray, type(after)
    in_u, out_u = borders(Float(column), ray.u[0], ray.per_u, Float(side))
    in_v, out_v = borders(Float(row), ray.v[0], ray.per_v, Float(side))
    begin, end = dr.maximum(dr.maximum(in_u, in_v), 0), dr.minimum(dr.minimum(out_u, out_v), 1)
    i, j = cell_at(ray.u, ray.per_u, begin, column, side), cell_at(ray.v, ray.per_v, begin, row, side)
    by_u = in_u >= begin
    i = dr.select(by_u, dr.select(line.right, column, column + side - 1), i)
    j = dr.select((in_v >= begin) & ~by_u, dr.select(line.up, row, row + side - 1), j)

    def step(i, j, t, nearest):
        over = passage(heights, face, line, (i, j))
        nearest = _with_crossings(line, over, nearest, after)
        by_u = borders(Float(i), ray.u[0], ray.per_u)[1] <= over.t[1]
        i = dr.select(by_u, dr.select(line.right, i + 1, i - 1), i)
        return i, dr.select(by_u, j, dr.select(line.up, j + 1, j - 1)), over.t[1], nearest

    return dr.while_loop(
        state=(i, j, begin, nearest),
        cond=lambda i, j, t, nearest: t < end,
        body=step,
        labels=("i", "j", "t", "nearest"),
    )[-1]
