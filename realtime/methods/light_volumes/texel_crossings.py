# SPDX-License-Identifier: BSD-3-Clause
"""The passage of a camera ray over one texel, and where it crosses the height field there.

This is one step of `realtime.methods.light_volumes.walk`.

With D = s of the ray - height, a ray is lit where D > 0. On the borders of texels, D is
the same number for both.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.light_volumes.face_lines import Line, at_line, borders
from airlight.realtime.methods.light_volumes.texel_walls import (
    BOTTOM,
    LEFT,
    RIGHT,
    TOP,
    Side,
    height_at,
    parts_of,
    side_of,
    value_at,
)
from airlight.realtime.shadow_maps.inverse_depth_field import texel_heights, texel_walls


@dataclass
class Passage:
    """A ray's line over a texel, by the texel's own borders and heights alone."""

    place: tuple[Any, Any]  #: column and row of the texel [texels]
    four: Any  #: its heights s00, s10, s01, s11 [1/m]
    #: its walls, see `realtime.methods.light_volumes.jump_search`; None where no texel has any
    walls: Any
    t: tuple[Any, Any]  #: where the line enters and leaves the texel, or begins and ends in it
    excess: tuple[Any, Any]  #: D there
    ends: Any  #: whether the ray ends in the texel

    @property
    def lit(self) -> tuple[Any, Any]:
        """Whether the ray is lit there."""
        return self.excess[0] > 0, self.excess[1] > 0


@dataclass
class TexelCrossings:
    """Where a ray crosses the height field in a texel: not at all, once, or twice."""

    crosses: Any  #: whether it does
    t: Any  #: where
    twice: Any  #: whether it does a second time
    second: Any  #: where


def passage(heights, face, line: Line, texel) -> Passage:
    """Return the passage of a ray over a texel of a face of the `heights`."""
    ray = line.ray
    Float = type(ray.begin)
    place = column, row = Float(texel[0]), Float(texel[1])
    # The line is over the texel while it is over its column and its row, within [0, 1].
    in_u, out_u = borders(column, ray.u[0], ray.per_u)
    in_v, out_v = borders(row, ray.v[0], ray.per_v)
    into, out = dr.maximum(in_u, in_v), dr.minimum(out_u, out_v)
    begin, end = dr.maximum(into, 0), dr.minimum(out, 1)
    starts, ends = ((texel[0] == i) & (texel[1] == j) for i, j in line.cells)
    # D where it enters, on a border of u or of v: from the texel's corners near to where the line
    # comes from. A texel in which the line itself begins has D from there.
    by_u, out_by_u = in_u >= begin, out_u <= end
    four = texel_heights(heights, face, *texel)
    walls = None if heights.walls is None else texel_walls(heights, face, *texel)
    near_near, near_far, far_near, far_far = _as_seen(line, four)
    pair = near_near, dr.select(by_u, near_far, far_near)
    d0 = _excess_on_border(
        line, place, begin, by_u, pair, _wall_on_border(line, walls, by_u, False)
    )
    d0 = dr.select(starts, line.excess[0], d0)
    # The same where it leaves: from the corners on the far border.
    pair = dr.select(out_by_u, far_near, near_far), far_far
    d1 = _excess_on_border(
        line, place, end, out_by_u, pair, _wall_on_border(line, walls, out_by_u, True)
    )
    d1 = dr.select(ends, line.excess[1], d1)
    return Passage(place, four, walls, (begin, end), (d0, d1), ray.stops & ends)


def texel_crossings(line: Line, over: Passage) -> TexelCrossings:
    """Return where a ray crosses the height field in a texel: over its two triangles, or
    its two parts at a wall.

    In a texel with a wall, a ray that is lit at one end only crosses once, at the first change:
    from the border to the part, over it, at the wall, over the other part, or from there to the
    border. If the ray ends in the texel, rounding may decide the sign of D at its end, as the
    surface is the height field: the first two changes count.
    """
    (begin, end), (from_light, to_light) = over.t, over.lit
    # D is linear over each of the two triangles: where its sign differs between the border of the
    # texel and the diagonal, it has a zero in that triangle.
    middle, before = _on_diagonal(line, over)
    if over.walls is None:
        first, last = (before > 0) != from_light, (before > 0) != to_light
        early, late = _zeros(
            (begin, middle, end), (over.excess[0], before), (before, over.excess[1])
        )
        passes = begin < end
        return TexelCrossings(
            passes & (first | last), dr.select(first, early, late), passes & first & last, late
        )
    # At a wall, six values in the order of the ray: on the border where it enters, on the plane of
    # the part there, before the wall, behind it, on the plane where it leaves, and on the border
    # there. In texels without walls the diagonal takes the place of the wall, and nothing jumps at
    # it.
    walled = over.walls != 0
    plain = middle, over.excess[0], before, before, over.excess[1]
    middle, *excess = (dr.select(walled, *pair) for pair in zip(_on_wall(line, over), plain))
    lit = [from_light, *(value > 0 for value in excess), to_light]
    enters, first, jumps, last, _ = (before != behind for before, behind in pairwise(lit))
    early, late = _zeros((begin, middle, end), excess[:2], excess[2:])
    # The fifth change, from the plane to the border where the ray leaves, has no mask: a ray that
    # is lit at one end only changes there if it changes nowhere else.
    some = enters | first | jumps | last
    two = (enters & (first | jumps | last)) | (first & (jumps | last)) | (jumps & last)
    # A ray that is lit at both ends, or dark at both, does not cross in a texel with a wall, unless
    # it ends there.
    crosses = dr.select(walled, dr.select(over.ends, some, from_light != to_light), some)
    # The first change, from the last possible one back; then the second.
    t = dr.select(jumps, middle, dr.select(last, late, end))
    return TexelCrossings(
        crosses & (begin < end),
        dr.select(enters, begin, dr.select(first, early, t)),
        two & (over.ends | ~walled) & (begin < end),
        dr.select(enters & first, early, dr.select((enters | first) & jumps, middle, late)),
    )


def _zeros(t, first, second):
    """Return where D is 0 between t[0] and t[1], and t[1] and t[2]."""
    return _zero_between(t[:2], first), _zero_between(t[1:], second)


def _zero_between(t, excess):
    """Return where D is 0 between two t."""
    return dr.fma(excess[0] / (excess[0] - excess[1]), t[1] - t[0], t[0])


def _on_diagonal(line: Line, over: Passage):
    """Return where the line crosses the diagonal of a texel, and D there;
    its end where it does not.
    """
    ray, (column, row), (begin, end), four = line.ray, over.place, over.t, over.four
    # On the diagonal v - u is the same as at the texel's corner: t follows without a division.
    middle = ((ray.u[0] - column) - (ray.v[0] - row)) * ray.per_diagonal
    bends = (middle > begin) & (middle < end)
    middle = dr.select(bends, middle, end)
    height = dr.fma(at_line(ray.u, middle) - column, four[3] - four[0], four[0])
    return middle, dr.select(bends, at_line(ray.s, middle) - height, over.excess[1])


def _on_wall(line: Line, over: Passage):
    """Return where the ray's line crosses the line between the parts of a texel, or its end, and
    D by the planes of the parts: where it enters, before and behind the wall, and where it leaves.
    """
    ray, (begin, end) = line.ray, over.t
    parts = parts_of(over.four, over.walls, type(ray.begin))
    x, y = (
        [at_line(pair, t) - low for t in over.t] for pair, low in zip((ray.u, ray.v), over.place)
    )
    at_begin, at_end = (value_at(parts.line, *point) for point in zip(x, y))
    # The sign of the line between the parts says in which part the ray enters and leaves; where
    # both are the same the ray does not cross the line, and the middle is its end.
    from_second, to_second = at_begin > 0, at_end > 0
    fraction = dr.select(from_second ^ to_second, at_begin / (at_begin - at_end), 1)
    middle = dr.fma(fraction, end - begin, begin)
    x.insert(1, dr.fma(fraction, x[1] - x[0], x[0]))
    y.insert(1, dr.fma(fraction, y[1] - y[0], y[0]))
    s = [at_line(ray.s, t) for t in (begin, middle, end)]

    def excess(place, second):
        return s[place] - height_at(parts, second, x[place], y[place])

    return (
        middle,
        excess(0, from_second),
        excess(1, from_second),
        excess(1, to_second),
        excess(2, to_second),
    )


def _as_seen(line: Line, four):
    """Return the heights of a texel's corners near or far in u, then near or
    far in v, as the line goes.
    """
    s00, s10, s01, s11 = four
    # Near and far in u by the direction of columns, in both rows; then near and far in v.
    low = dr.select(line.right, s00, s10), dr.select(line.right, s10, s00)
    high = dr.select(line.right, s01, s11), dr.select(line.right, s11, s01)
    near_near, near_far = dr.select(line.up, low[0], high[0]), dr.select(line.up, high[0], low[0])
    far_near, far_far = dr.select(line.up, low[1], high[1]), dr.select(line.up, high[1], low[1])
    return near_near, near_far, far_near, far_far


def _wall_on_border(line: Line, walls, on_u, behind: bool) -> Side | None:
    """Return the wall on the border where a line enters a texel, or leaves it, as the line goes."""
    if walls is None:
        return None
    # Where the line goes right it enters a texel on its left; where it leaves, on the side across.
    across, upward = (line.right, line.up) if not behind else (~line.right, ~line.up)
    bottom, top, left, right = (mi.UInt32(side) for side in (BOTTOM, TOP, LEFT, RIGHT))
    side = dr.select(on_u, dr.select(across, left, right), dr.select(upward, bottom, top))
    wall = side_of(walls, side, type(line.ray.begin))
    return Side(
        wall.stands, dr.select(dr.select(on_u, line.up, line.right), wall.place, 1 - wall.place)
    )


def _excess_on_border(line: Line, texel, t, on_u, pair, wall: Side | None):
    """Return D on the border of a texel, from the heights of its nearer and its farther corner."""
    ray, (base, other) = line.ray, pair
    # The place on the border, from its nearer corner: along v on a border of u, along u on one of
    # v.
    along = dr.select(on_u, ray.v[0], ray.u[0]), dr.select(on_u, ray.v[1], ray.u[1])
    x = at_line(along, t) - dr.select(on_u, texel[1], texel[0])
    x = dr.select(dr.select(on_u, line.up, line.right), x, 1 - x)
    height = dr.fma(x, other - base, base)
    if wall is not None:
        height = dr.select(wall.stands, dr.select(x < wall.place, base, other), height)
    return at_line(ray.s, t) - height
