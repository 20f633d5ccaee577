# SPDX-License-Identifier: BSD-3-Clause
"""Lines of camera rays over the texels of a face, and which texels are near them: see
`realtime.methods.light_volumes.crossings`.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.light_volumes.ray_lines import FaceRay, at_line
from realtime.methods.light_volumes.texel_walls import height_in, parts_of
from realtime.shadow_maps.inverse_depth_field import InverseDepthField, texel_heights, texel_walls

_ROUNDING = 1e-5  # of a height of the map, with room
_STEEPEST = 1e6  # rows a column; what is steeper goes over all rows of its column
_MARGIN = 4e-6  # of the map: rounding, with room


@dataclass
class Line:
    """A ray's line over a face, with D at its ends."""

    ray: FaceRay
    right: Any  #: whether columns rise along it
    up: Any  #: whether rows do
    excess: tuple[Any, Any]  #: D at t = 0 and t = 1
    cells: tuple[tuple[Any, Any], tuple[Any, Any]]  #: column and row of the texels that they lie in
    slack: Any  #: how far below the height field a point at t = 1 may seem that lies on what it samples


def line_of(heights: InverseDepthField, face, ray: FaceRay) -> Line:
    """Return the line of a ray in a face; D at its ends is that of the texel whose borders lie about them."""
    right, up = ray.per_u > 0, ray.per_v > 0
    excess, cells, slack = [], [], type(ray.begin)(0)
    for t in (0, 1):
        at = type(ray.begin)(t)
        i, j = (
            cell_at(pair, per, at, mi.UInt32(0), mi.UInt32(heights.size))
            for pair, per in ((ray.u, ray.per_u), (ray.v, ray.per_v))
        )
        four = texel_heights(heights, face, i, j, ray.walks)
        x, y = ray.u[t] - type(at)(i), ray.v[t] - type(at)(j)
        height, doubt = _height_in(heights, (face, i, j, ray.walks), four, x, y)
        excess.append(ray.s[t] - height)
        cells.append((i, j))
        slack = dr.fma(ray.s[t], _ROUNDING, doubt)
    return Line(ray, right, up, (excess[0], excess[1]), (cells[0], cells[1]), slack)


def _height_in(heights, texel, four, x, y):
    """Return the height at a point of a texel with four heights, and how far below it a lit surface may seem to be.

    That is the range of the heights, as the surface may do anything between the samples. Beside a wall it is half of
    it: then it is a question of which of two surfaces the point lies on.
    """
    s00, s10, s01, s11 = four
    below = x >= y
    along, upward = dr.select(below, s10 - s00, s11 - s01), dr.select(below, s11 - s10, s01 - s00)
    height, range_ = dr.fma(x, along, dr.fma(y, upward, s00)), dr.max(four) - dr.min(four)
    if heights.walls is None:
        return height, range_
    walls = texel_walls(heights, *texel)
    beside = walls != 0
    walled = height_in(parts_of(four, walls, type(x)), x, y)
    return dr.select(beside, walled, height), dr.select(beside, 0.5 * range_, range_)


def cell_at(pair, per, t, low, side):
    """Return the column (or row) of a strip of texels whose own borders are on either side of t.

    The strip begins at texel `low`; `pair` is the coordinate at the ends of the line and `per` its inverse change.
    """
    first, last = mi.Int32(low), mi.Int32(low + side) - 1
    cell = dr.clip(mi.Int32(dr.floor(at_line(pair, t))), first, last)
    # Rounding may have put it one too far, or not far enough.
    begin, end = borders(type(t)(cell), pair[0], per)
    step = dr.select(per > 0, mi.Int32(1), mi.Int32(-1))
    return mi.UInt32(dr.clip(dr.select(t >= end, cell + step, dr.select(t < begin, cell - step, cell)), first, last))


def borders(low, start, per, across=1.0):
    """Return the t at which a line enters and leaves the strip from `low` to `low + across` [texels].

    The line is at `start` [texels] for t = 0 and needs `per` for a texel.
    """
    at_low, at_high = (low - start) * per, (low + across - start) * per
    return dr.minimum(at_low, at_high), dr.maximum(at_low, at_high)


def slope_of(line: Line, size: int):
    """Return what `texels_on` needs to know of a line: dv/du, and the least and largest step over a column."""
    ray = line.ray
    slope = dr.clip((ray.v[1] - ray.v[0]) * ray.per_u, -_STEEPEST, _STEEPEST)
    margin = _MARGIN * size
    pad = dr.fma(margin, dr.abs(slope), margin)
    return slope, dr.minimum(slope, 0) - pad, dr.maximum(slope, 0) + pad


def texels_on(line: Line, slope, node):
    """Return bit 4 row + column of each texel of the leaf `node` near the line of a ray; `slope` is its `slope_of`."""
    ray = line.ray
    Float = type(ray.begin)
    per_column, below, above = slope
    column, row = Float(node.i << 2), Float(node.j << 2)
    v = dr.fma(column - ray.u[0], per_column, ray.v[0] - row)
    low, high = dr.fma(4.0, v + below, -3.0), dr.fma(4.0, v + above, 1.0)
    step = dr.fma(4.0, per_column, 1.0)
    bits = mi.UInt32(0)
    for k in range(4):
        # One bit in four for each row.
        first, end = (mi.UInt32(dr.clip(dr.fma(step, float(k), offset), 0, 20)) for offset in (low, high))
        bits |= ((mi.UInt32(1) << end) - (mi.UInt32(1) << first)) & (0x1111 << k)
    return bits
