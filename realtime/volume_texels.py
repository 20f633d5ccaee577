# SPDX-License-Identifier: BSD-3-Clause
"""Lines of camera rays over the texels of a face, and the pieces of them that texels cut out: see
`realtime.volume_walk`.
"""

from dataclasses import dataclass
from functools import reduce
from typing import Any

from realtime.light_heights import LightHeights, texel_heights
from realtime.volume_rays import FaceRay, at_line

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
    slack: Any  #: how far below the height field a point at t = 1 may seem that lies on what it samples


def line_of(heights: LightHeights, face, ray: FaceRay) -> Line:
    """Return the line of a ray; D at its ends is that of the texel whose own borders are on either side of them."""
    import drjit as dr
    import mitsuba as mi

    right, up = ray.per_u > 0, ray.per_v > 0
    excess, slack = [], type(ray.begin)(0)
    for t in (0, 1):
        at = type(ray.begin)(t)
        i, j = (
            cell_at(pair, per, at, mi.UInt32(0), mi.UInt32(heights.size))
            for pair, per in ((ray.u, ray.per_u), (ray.v, ray.per_v))
        )
        s00, s10, s01, s11 = texel_heights(heights, face, i, j, ray.walks)
        x, y = ray.u[t] - type(at)(i), ray.v[t] - type(at)(j)
        below = x >= y
        along, upward = dr.select(below, s10 - s00, s11 - s01), dr.select(below, s11 - s10, s01 - s00)
        excess.append(ray.s[t] - dr.fma(x, along, dr.fma(y, upward, s00)))
        heights_there = (s00, s10, s01, s11)
        slack = dr.fma(ray.s[t], _ROUNDING, reduce(dr.maximum, heights_there) - reduce(dr.minimum, heights_there))
    return Line(ray, right, up, (excess[0], excess[1]), slack)


def cell_at(pair, per, t, low, side):
    """Return the column (or row) of a strip of texels whose own borders are on either side of t."""
    import drjit as dr
    import mitsuba as mi

    first, last = mi.Int32(low), mi.Int32(low + side) - 1
    cell = dr.clip(mi.Int32(dr.floor(at_line(pair, t))), first, last)
    # Rounding may have put it one too far, or not far enough.
    begin, end = borders(type(t)(cell), pair[0], per)
    step = dr.select(per > 0, mi.Int32(1), mi.Int32(-1))
    return mi.UInt32(dr.clip(dr.select(t >= end, cell + step, dr.select(t < begin, cell - step, cell)), first, last))


def borders(low, start, per, across=1.0):
    """Return the t at which a line enters and leaves a strip of texels."""
    import drjit as dr

    one, other = (low - start) * per, (low + across - start) * per
    return dr.minimum(one, other), dr.maximum(one, other)


def slope_of(line: Line, size: int):
    """Return what `texels_on` needs to know of a line: dv/du, and the least and largest step over a column."""
    import drjit as dr

    ray = line.ray
    slope = dr.clip((ray.v[1] - ray.v[0]) * ray.per_u, -_STEEPEST, _STEEPEST)
    margin = _MARGIN * size
    pad = dr.fma(margin, dr.abs(slope), margin)
    return slope, dr.minimum(slope, 0) - pad, dr.maximum(slope, 0) + pad


def texels_on(line: Line, slope, node):
    """Return bit 4 row + column of each texel of a leaf near the line of a ray."""
    import drjit as dr
    import mitsuba as mi

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
        first, end = (mi.UInt32(dr.clip(dr.fma(step, float(k), one), 0, 20)) for one in (low, high))
        bits |= ((mi.UInt32(1) << end) - (mi.UInt32(1) << first)) & (0x1111 << k)
    return bits


@dataclass
class Pieces:
    """The two pieces of a ray's line in a texel, on either side of its diagonal."""

    t: tuple[Any, Any, Any]  #: where they begin, meet and end
    excess: tuple[Any, Any, Any]  #: D there

    @property
    def changes(self):
        """Whether D changes its sign over each of them."""
        lit = [excess > 0 for excess in self.excess]
        there = self.t[0] < self.t[2]
        return there & (lit[0] != lit[1]), there & (lit[1] != lit[2])


def texel_pieces(heights, face, line: Line, texel) -> Pieces:
    """Return the pieces of a ray's line in a texel, computed from its own borders and heights alone."""
    import drjit as dr

    ray = line.ray
    Float = type(ray.begin)
    column, row = Float(texel[0]), Float(texel[1])
    in_u, out_u = borders(column, ray.u[0], ray.per_u)
    in_v, out_v = borders(row, ray.v[0], ray.per_v)
    into, out = dr.maximum(in_u, in_v), dr.minimum(out_u, out_v)
    begin, end = dr.maximum(into, 0), dr.minimum(out, 1)
    by_u, out_by_u = in_u >= begin, out_u <= end
    four = texel_heights(heights, face, *texel)
    near_near, near_far, far_near, far_far = _as_seen(line, four)
    d0 = _excess_on_border(line, (column, row), begin, by_u, near_near, dr.select(by_u, near_far, far_near))
    d0 = dr.select(into < 0, line.excess[0], d0)
    d1 = _excess_on_border(line, (column, row), end, out_by_u, dr.select(out_by_u, far_near, near_far), far_far)
    d1 = dr.select(end < out, line.excess[1], d1)
    middle = ((ray.u[0] - column) - (ray.v[0] - row)) * ray.per_diagonal
    bends = (middle > begin) & (middle < end)
    middle = dr.select(bends, middle, end)
    on_diagonal = dr.fma(at_line(ray.u, middle) - column, four[3] - four[0], four[0])
    dm = dr.select(bends, at_line(ray.s, middle) - on_diagonal, d1)
    return Pieces((begin, middle, end), (d0, dm, d1))


def _as_seen(line: Line, four):
    """Return the heights of a texel's corners near or far in u, then near or far in v, as the line goes."""
    import drjit as dr

    s00, s10, s01, s11 = four
    low = dr.select(line.right, s00, s10), dr.select(line.right, s10, s00)
    high = dr.select(line.right, s01, s11), dr.select(line.right, s11, s01)
    near_near, near_far = dr.select(line.up, low[0], high[0]), dr.select(line.up, high[0], low[0])
    far_near, far_far = dr.select(line.up, low[1], high[1]), dr.select(line.up, high[1], low[1])
    return near_near, near_far, far_near, far_far


def _excess_on_border(line: Line, texel, t, on_u, base, other):
    """Return D on the border of a texel, between the height `base` of its nearer corner and that of the other."""
    import drjit as dr

    ray = line.ray
    pair = dr.select(on_u, ray.v[0], ray.u[0]), dr.select(on_u, ray.v[1], ray.u[1])
    x = at_line(pair, t) - dr.select(on_u, texel[1], texel[0])
    along = dr.select(dr.select(on_u, line.up, line.right), x, 1 - x)
    return at_line(ray.s, t) - dr.fma(along, other - base, base)
