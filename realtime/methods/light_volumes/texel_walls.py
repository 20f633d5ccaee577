# SPDX-License-Identifier: BSD-3-Clause
"""The height field over a texel on whose sides upright walls stand: see
`realtime.methods.light_volumes.jump_search`.

A texel's walls are one whole number: a byte for each side, 0 or 1 + the number of the place where
the wall stands. Both texels of a side hold the same byte. On a side with a wall the height jumps at
the wall from the height of one corner to the height of the other; on a side without, it is linear.
A side looks the same from both of its texels, so the rule for crossings in
`realtime.methods.light_volumes.walk` still holds: the number of changes of sign between two ends of
a ray says whether both are lit.

One straight line divides the texel into two parts, each under a plane; where these differ a
wall stands on the line:

* where walls on two sides that meet cut a corner off, the line joins them. The corner's part has
  its height, the other the plane through the other three corners;
* where walls stand on two sides across from each other, the line joins them. Each part has the
  heights of the side that lies in it;
* else the line is the diagonal from (0, 0) to (1, 1), between two triangles, as without walls.

A plane through three corners may leave their range towards the fourth: `walled_heights` widens the
bounds that rays go by. Next to a corner that is cut off, the border and the plane differ by the
slope over a part of a texel. If three or four sides have walls, one or two walls end at the border:
there a step stands on the border itself, and the border says which side of it is lit.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.shadow_maps.inverse_depth_field import (
    InverseDepthField,
    level_start,
    texel_heights,
)

#: on a side, where a wall may stand: what is smaller costs rays, and outlines
#: between two sides are bent
PLACES = 64
#: sides of a texel, v = 0, v = 1, u = 0 and u = 1, by their bytes
BOTTOM, TOP, LEFT, RIGHT = range(4)


Numbers = tuple[Any, Any, Any]


@dataclass
class Side:
    """The wall on a side of a texel, which goes from its corner of lower u or v to the other."""

    stands: Any  #: whether there is one
    place: Any  #: where, from 0 to 1 [1]


def side_of(walls, side, Float) -> Side:
    """Return the wall on one side of a texel with the numbers `walls`;
    `side` may depend on the lane.
    """
    number = (walls >> (8 * side)) & 0xFF
    return Side(number != 0, dr.fma(Float(number), 1 / PLACES, -0.5 / PLACES))


@dataclass
class Parts:
    """The two parts of a texel; each triple c0, cx, cy stands for c0 + cx x + cy y."""

    line: Numbers  #: above 0 in the second part
    first: Numbers  #: height over the first part
    second: Numbers  #: height over the second part


def parts_of(four, walls, Float) -> Parts:
    """Return the parts of a texel with four heights and the walls of a number, see
    `realtime.methods.light_volumes.jump_search`.
    """
    s00, s10, s01, s11 = four
    bottom, top, left, right = sides = _sides_of(walls, Float)
    # Which of the three lines divides the texel: around a corner, upright or level across it, or
    # the diagonal. With walls on three or four sides, upright comes before level.
    cut = _cuts_corner(sides)
    upright = bottom.stands & top.stands
    level = left.stands & right.stands & ~upright
    # x - y is above 0 below the diagonal. An upright line goes from the wall at the bottom to the
    # one at the top, with the second part right of it; a level line from left to right, with it
    # above.
    zero, unit = Float(0), Float(1)
    line = _select(upright, (-bottom.place, unit, bottom.place - top.place), (zero, unit, -unit))
    line = _select(level, (-left.place, left.place - right.place, unit), line)
    line = _select(cut, _cut_line(bottom, top, left, right), line)
    # The slopes of the heights along the bottom, the top, the left and the right.
    below, above, before, behind = s10 - s00, s11 - s01, s01 - s00, s11 - s10
    # The first part: the height of a corner that is cut off; the left side, or the bottom; the
    # triangle above the diagonal.
    corner = dr.select(
        right.stands, dr.select(top.stands, s11, s10), dr.select(top.stands, s01, s00)
    )
    first = (
        dr.select(cut, corner, s00),
        dr.select(cut | upright, zero, dr.select(level, below, above)),
        dr.select(cut | level, zero, before),
    )
    # The second part: the plane through the other three corners, whose slopes are those of the two
    # sides without walls; the right side, or the top; the triangle below the diagonal. Where (0, 0)
    # is cut off, the plane's height there follows from the other three.
    at_zero = dr.select(bottom.stands & left.stands, s10 - above, s00)
    second = (
        dr.select(cut, at_zero, dr.select(upright, s10, dr.select(level, s01, s00))),
        dr.select(upright, zero, dr.select(level | (cut & bottom.stands), above, below)),
        dr.select(level, zero, dr.select(cut & ~left.stands, before, behind)),
    )
    return Parts(line, first, second)


def _sides_of(walls, Float) -> list[Side]:
    """Return the walls on the bottom, top, left and right of a texel."""
    return [side_of(walls, side, Float) for side in (BOTTOM, TOP, LEFT, RIGHT)]


def _cuts_corner(sides: list[Side]):
    """Return whether there are two walls, on sides that meet."""
    bottom, top, left, right = (side.stands for side in sides)
    return (bottom ^ top) & (left ^ right)


def _cut_line(bottom: Side, top: Side, left: Side, right: Side) -> Numbers:
    """Return the line through the walls of two sides that meet, below 0 at
    the corner between them.
    """
    Float = type(bottom.place)
    # Where the two walls stand on the sides that meet, and the corner where they meet.
    x, y = (
        dr.select(bottom.stands, bottom.place, top.place),
        dr.select(left.stands, left.place, right.place),
    )
    corner_x, corner_y = dr.select(right.stands, Float(1), 0), dr.select(top.stands, Float(1), 0)
    # Distances from the corner over those of the walls from it: their sum is 1 on the line.
    per_x, per_y = dr.rcp(x - corner_x), dr.rcp(y - corner_y)
    return -1 - corner_x * per_x - corner_y * per_y, per_x, per_y


def _select(condition, chosen: Numbers, otherwise: Numbers) -> Numbers:
    a, b, c = (dr.select(condition, *pair) for pair in zip(chosen, otherwise))
    return a, b, c


def value_at(numbers: Numbers, x, y):
    """Return c0 + cx x + cy y at a point (x, y) of a texel, each from 0 to 1 [1/m]."""
    return dr.fma(numbers[1], x, dr.fma(numbers[2], y, numbers[0]))


def height_at(parts: Parts, second, x, y):
    """Return the height at (x, y) by the plane of the second part, or of the first [1/m]."""
    return dr.select(second, value_at(parts.second, x, y), value_at(parts.first, x, y))


def height_in(parts: Parts, x, y):
    """Return the height at the point (x, y) of a texel, each from 0 to 1 [1/m]."""
    return height_at(parts, value_at(parts.line, x, y) > 0, x, y)


def walled_heights(heights: InverseDepthField, walls, texels) -> InverseDepthField:
    """Return a height field with walls in its texels, and the bounds of its
    nodes as these need them.

    `heights`: the height field; `walls`: the number of each texel; `texels`: the numbers of
    the texels that may have walls, some of them more than once.
    """
    bounds = heights.bounds + 0
    if dr.width(texels):
        size = heights.size
        row = texels // size
        face, i = row // size, texels - row * size
        _widen(heights, bounds, (face, i, row - face * size), dr.gather(mi.UInt32, walls, texels))
    dr.eval(bounds)
    return replace(heights, bounds=bounds, walls=walls)


def _widen(heights: InverseDepthField, bounds, texel, walls) -> None:
    """Widen the bounds to hold the planes over texels with a corner cut off."""
    mode = dr.ReduceMode.Direct  # few: no copies of the arrays for each thread
    face, i, j = texel
    four = texel_heights(heights, face, i, j)
    sides = _sides_of(walls, type(bounds))
    cut, (_, top, _, right) = _cuts_corner(sides), (side.stands for side in sides)
    # The plane at the corner that is cut off, the farthest that it can come to.
    ends = dr.select(right == top, four[1] + four[2], four[0] + four[3])
    value = ends - dr.select(
        right, dr.select(top, four[0], four[2]), dr.select(top, four[1], four[3])
    )
    value = dr.maximum(value, heights.projection.lowest)  # no ray comes below
    low, high = cut & (value < dr.min(four)), cut & (value > dr.max(four))
    # Every node that holds the texel, from the whole face down to the texel itself.
    for level in range(heights.finest + 1):
        shift = heights.finest - level
        node = face * heights.nodes + level_start(level) + ((j >> shift) << level) + (i >> shift)
        dr.scatter_reduce(dr.ReduceOp.Min, bounds, value, 2 * node, low, mode)
        dr.scatter_reduce(dr.ReduceOp.Max, bounds, value, 2 * node + 1, high, mode)
