# SPDX-License-Identifier: BSD-3-Clause
"""The lit pieces of camera rays in a light volume: each ray looks at the texels on its line.

A ray's line in (u, v) crosses the borders of texels at t = (column - u0) dt/du and t = (row - v0) dt/dv. In order,
these cut [0, 1] into pieces of one texel each, and a texel's own piece is computed from its own four borders alone. So
two neighbours see the same number t between them, and the same two heights: the sign of

    D(t) = s of the ray - height

there, lit or not, is the same for both. Crossings are where D changes its sign from one end of a piece, over the
texel's diagonal, to the other; within a triangle D is linear in t. Which texels are looked at, and in what order, does
not matter (Billeter, Sintorn, Assarsson 2010, eq. 3), and what `realtime.volume_tiles` leaves out has no change of
sign. A ray that is lit at its beginning is lit at its end after an even number of crossings: no tolerance can break it.

Crossings are kept in order of distance, the nearest eight. A ray with more goes over its texels again for those that
are farther; two may lie at the same distance, so it counts anew how many it has passed. Between crossings the kernel
integrates each lit piece by itself: a sum of positive terms, where a sum of J(0, x) of both signs would lose digits.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any

from realtime.light_heights import LightHeights, texel_heights
from realtime.volume_rays import FaceRay, at_line, distance_at, face_ray, in_face
from realtime.volume_tiles import TILE, Leaves, unpacked

_ROUNDING = 1e-5  # of a height of the map, with room

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

    def of_face(face, total, reached):
        begin, end = in_face(heights, face, away, direction, segment)

        def add(total, reached):
            ray = face_ray(heights, face, away, direction, (begin, end))
            place = tile * heights.faces + face
            source = leaves.entries, *(dr.gather(mi.UInt32, ends, place) for ends in (leaves.first, leaves.last))
            total, lit = _face_sum(heights, face, ray, source, total, integral)
            return total, dr.select(end >= segment[1], lit, reached)

        total, reached = dr.if_stmt(
            args=(total, reached), cond=begin < end, true_fn=add, false_fn=lambda total, reached: (total, reached)
        )
        return face + 1, total, reached

    if heights.faces == 1:
        _, total, reached = of_face(mi.UInt32(0), zero, dr.full(mi.Bool, False, width))
        return total, reached
    _, total, reached = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), zero, dr.full(mi.Bool, False, width)),
        cond=lambda face, total, reached: face < heights.faces,
        body=of_face,
        labels=("face", "total", "reached"),
    )
    return total, reached


def _face_sum(heights, face, ray: FaceRay, source, total, integral):
    """Add the lit pieces of one face to a total; return also whether the ray is lit where it leaves the face."""
    import drjit as dr

    line = _line_of(heights, face, ray)
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
class _Line:
    """A ray's line over a face, with D at its ends."""

    ray: FaceRay
    right: Any  #: whether columns rise along it
    up: Any  #: whether rows do
    excess: tuple[Any, Any]  #: D at t = 0 and t = 1
    slack: Any  #: how far below the height field a point at t = 1 may seem that lies on what it samples


def _line_of(heights: LightHeights, face, ray: FaceRay) -> _Line:
    """Return the line of a ray; D at its ends is that of the texel whose own borders are on either side of them."""
    import drjit as dr
    import mitsuba as mi

    right, up = ray.per_u > 0, ray.per_v > 0
    excess, slack = [], type(ray.begin)(0)
    for t in (0, 1):
        at = type(ray.begin)(t)
        i, j = (
            _cell(pair, per, at, mi.UInt32(0), mi.UInt32(heights.size))
            for pair, per in ((ray.u, ray.per_u), (ray.v, ray.per_v))
        )
        s00, s10, s01, s11 = texel_heights(heights, face, i, j, ray.walks)
        x, y = ray.u[t] - type(at)(i), ray.v[t] - type(at)(j)
        below = x >= y
        along, upward = dr.select(below, s10 - s00, s11 - s01), dr.select(below, s11 - s10, s01 - s00)
        excess.append(ray.s[t] - dr.fma(x, along, dr.fma(y, upward, s00)))
        heights_there = (s00, s10, s01, s11)
        slack = dr.fma(ray.s[t], _ROUNDING, reduce(dr.maximum, heights_there) - reduce(dr.minimum, heights_there))
    return _Line(ray, right, up, (excess[0], excess[1]), slack)


def _cell(pair, per, t, low, side):
    """Return the column (or row) of a strip of texels whose own borders are on either side of t."""
    import drjit as dr
    import mitsuba as mi

    first, last = mi.Int32(low), mi.Int32(low + side) - 1
    cell = dr.clip(mi.Int32(dr.floor(at_line(pair, t))), first, last)
    # Rounding may have put it one too far, or not far enough.
    begin, end = _borders(type(t)(cell), pair[0], per)
    step = dr.select(per > 0, mi.Int32(1), mi.Int32(-1))
    return mi.UInt32(dr.clip(dr.select(t >= end, cell + step, dr.select(t < begin, cell - step, cell)), first, last))


def _borders(low, start, per, across=1.0):
    """Return the t at which a line enters and leaves a strip of texels."""
    import drjit as dr

    one, other = (low - start) * per, (low + across - start) * per
    return dr.minimum(one, other), dr.maximum(one, other)


@dataclass
class _Crossings:
    """Crossings of rays, beyond some distance."""

    queue: list[Any]  #: the nearest, in order, infinite where there are no more [m]
    lost: Any  #: whether others had no place in it
    odd: Any  #: whether an odd number of them is not beyond that distance


def _nearest_crossings(heights, face, line: _Line, source, after, active):
    """Return the nearest crossings beyond `after`, and whether there are more."""
    import drjit as dr
    import mitsuba as mi

    entries, first, last = source
    Float = type(after)
    width = dr.width(after)
    last = dr.select(active, last, first)

    def of_entry(k, found):
        node = unpacked(dr.gather(mi.UInt32, entries, k, k < last))
        side = mi.UInt32(heights.size) >> node.level
        return k + 1, _leaf_crossings(heights, face, line, (node.i * side, node.j * side, side), found, after)

    queue, no = [dr.full(Float, dr.inf, width) for _ in range(PLACES)], dr.full(mi.Bool, False, width)
    _, found = dr.while_loop(
        state=(first + dr.zeros(mi.UInt32, width), _Crossings(queue, no, no & True)),
        cond=lambda k, found: k < last,
        body=of_entry,
        labels=("k", "found"),
    )
    return found


def _leaf_crossings(heights, face, line: _Line, square, found: _Crossings, after) -> _Crossings:
    """Add the crossings in a square of texels."""
    import drjit as dr

    column, row, side = square
    ray, Float = line.ray, type(after)
    in_u, out_u = _borders(Float(column), ray.u[0], ray.per_u, Float(side))
    in_v, out_v = _borders(Float(row), ray.v[0], ray.per_v, Float(side))
    begin, end = dr.maximum(dr.maximum(in_u, in_v), 0), dr.minimum(dr.minimum(out_u, out_v), 1)
    i, j = _cell(ray.u, ray.per_u, begin, column, side), _cell(ray.v, ray.per_v, begin, row, side)
    by_u = in_u >= begin
    i = dr.select(by_u, dr.select(line.right, column, column + side - 1), i)
    j = dr.select((in_v >= begin) & ~by_u, dr.select(line.up, row, row + side - 1), j)
    near_near, near_far, far_near, _ = _as_seen(line, texel_heights(heights, face, i, j, begin < end))
    excess = _excess_on_border(line, (i, j), begin, by_u, near_near, dr.select(by_u, near_far, far_near))
    excess = dr.select(dr.maximum(in_u, in_v) < 0, line.excess[0], excess)

    def step(i, j, t, excess, found):
        found, t, excess, by_u = _cross_texel(heights, face, line, (i, j), t, excess, found, after)
        i = dr.select(by_u, dr.select(line.right, i + 1, i - 1), i)
        return i, dr.select(by_u, j, dr.select(line.up, j + 1, j - 1)), t, excess, found

    return dr.while_loop(
        state=(i, j, begin, excess, found),
        cond=lambda i, j, t, excess, found: t < end,
        body=step,
        labels=("i", "j", "t", "excess", "found"),
    )[-1]


def _as_seen(line: _Line, four):
    """Return the heights of a texel's corners near or far in u, then near or far in v, as the line goes."""
    import drjit as dr

    s00, s10, s01, s11 = four
    low = dr.select(line.right, s00, s10), dr.select(line.right, s10, s00)
    high = dr.select(line.right, s01, s11), dr.select(line.right, s11, s01)
    near_near, near_far = dr.select(line.up, low[0], high[0]), dr.select(line.up, high[0], low[0])
    far_near, far_far = dr.select(line.up, low[1], high[1]), dr.select(line.up, high[1], low[1])
    return near_near, near_far, far_near, far_far


def _excess_on_border(line: _Line, texel, t, on_u, base, other):
    """Return D on the border of a texel, between the height `base` of its nearer corner and that of the other."""
    import drjit as dr

    ray, Float = line.ray, type(t)
    x, y = at_line(ray.u, t) - Float(texel[0]), at_line(ray.v, t) - Float(texel[1])
    along = dr.select(on_u, dr.select(line.up, y, 1 - y), dr.select(line.right, x, 1 - x))
    return at_line(ray.s, t) - dr.fma(along, other - base, base)


def _cross_texel(heights, face, line: _Line, texel, t, excess, found: _Crossings, after):
    """Add the crossings in a texel, which the line enters at t.

    Returns
    -------
    found
        The crossings so far.
    end, excess
        The t at which the line leaves the texel, and D there.
    by_u
        Whether it leaves it over the border of a column.
    """
    import drjit as dr

    ray, Float = line.ray, type(t)
    _, out_u = _borders(Float(texel[0]), ray.u[0], ray.per_u)
    _, out_v = _borders(Float(texel[1]), ray.v[0], ray.per_v)
    end = dr.minimum(dr.minimum(out_u, out_v), 1)
    by_u = out_u <= end
    four = texel_heights(heights, face, *texel)
    _, near_far, far_near, far_far = _as_seen(line, four)
    d1 = _excess_on_border(line, texel, end, by_u, dr.select(by_u, far_near, near_far), far_far)
    d1 = dr.select(end < dr.minimum(out_u, out_v), line.excess[1], d1)
    middle = ((ray.u[0] - Float(texel[0])) - (ray.v[0] - Float(texel[1]))) * ray.per_diagonal
    bends = (middle > t) & (middle < end)
    middle = dr.select(bends, middle, end)
    on_diagonal = dr.fma(at_line(ray.u, middle) - Float(texel[0]), four[3] - four[0], four[0])
    dm = dr.select(bends, at_line(ray.s, middle) - on_diagonal, d1)
    first, second = (excess > 0) != (dm > 0), (dm > 0) != (d1 > 0)

    def store(found):
        queue, lost, odd = found.queue, found.lost, found.odd
        for changes, ends, excesses in ((first, (t, middle), (excess, dm)), (second, (middle, end), (dm, d1))):
            share = excesses[0] / (excesses[0] - excesses[1])
            x = distance_at(ray, dr.fma(share, ends[1] - ends[0], ends[0]))
            queue, out = _inserted(queue, dr.select(changes & (x > after), x, dr.inf))
            lost = lost | (out < dr.inf)
            odd = odd ^ (changes & (x <= after))
        return _Crossings(queue, lost, odd)

    found = dr.if_stmt(args=(found,), cond=(first | second) & (end > t), true_fn=store, false_fn=lambda found: found)
    return found, end, d1, by_u


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
