# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays over a face of a shadow map: in its projective coordinates, and
their lines over its texels.

With the camera at a0 across + b0 up + c0 axis from the light and the direction (da, db, dc)
likewise, the point at x has

    u = (a0 + x da) / c,   v = (b0 + x db) / c,   s = 1 / c,   c = c0 + x dc,

and y = x / c. All four are linear along the projective line: with t from 0 to 1 between two points
of the ray, each is (1 - t) its value at one and t its value at the other, and x = y / s. At the end
of an unbounded ray s = 0 and y = 1 / dc.

On the face of a directional light u, v and s are linear in x itself, so y = x with weight 1 in
place of s; the ray is cut where the media end, at s = 0 or far behind it, and all before the
largest height is lit. Where media have no sides, all beside the map is lit too.

The part of the ray in the face is cut out by c + a >= 0, c - a >= 0, c + b >= 0, c - b >= 0. A ray
that stays on the border of two faces is in the face of the first axis alone: neighbours compute
the same numbers there, with opposite signs. The line t goes over the part of it beyond the nearest
height of the face: all before that is lit.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.light_volumes.texel_walls import height_in, parts_of
from airlight.realtime.shadow_maps.inverse_depth_field import (
    InverseDepthField,
    node_bounds,
    texel_heights,
    texel_walls,
)


@dataclass
class FaceRay:
    """A ray in a face; the coordinates are those of its line at t = 0 and t = 1."""

    begin: Any  #: of the part of the ray in the face [m]
    end: Any  #: of that part [m]
    walks: Any  #: whether any of it lies beyond the nearest height
    u: tuple[Any, Any]  #: columns [texels]
    v: tuple[Any, Any]  #: rows [texels]
    s: tuple[Any, Any]  #: [1/m]
    y: tuple[Any, Any]  #: x s, or x itself where rays of light are parallel
    per_u: Any  #: dt/du, positive where u stays the same
    per_v: Any
    per_diagonal: Any  #: dt/d(v - u)
    parallel: bool = False  #: whether the rays of the light are parallel
    stops: Any = False  #: whether the ray ends in the face, and does not go on in another one


def in_face(heights: InverseDepthField, face, away, direction, segment):
    """Return the part of a segment of rays [m] that lies in a face, x0 >= x1 where none does.

    `away` and `direction` as for `face_ray`.
    """
    a0, b0, s0, c0 = heights.projection.homogeneous(face, away, 1)
    da, db, ds, dc = heights.projection.homogeneous(face, direction, 0)
    begin, end = segment
    # The ray of a directional light's map ends with the media. Without sides that is a place so far
    # away that a little before it does as well: there D is above 0 where nothing stands.
    if not heights.projection.w:
        begin, end = _cut(begin, end, s0 - 0.999 * heights.projection.lowest, ds)
    # The neighbours across come later in the order of axes, except for the last axis; those
    # above only for the first one.
    for start, slope, is_first in (
        (c0 + a0, dc + da, face < 4),
        (c0 - a0, dc - da, face < 4),
        (c0 + b0, dc + db, face < 2),
        (c0 - b0, dc - db, face < 2),
    ):
        begin, end = _cut(begin, end, start, slope)
        end = dr.select((slope == 0) & (start == 0) & ~is_first, begin, end)
    return begin, end


def face_ray(heights: InverseDepthField, face, away, direction, segment) -> FaceRay:
    """Return rays in a face.

    `heights`: the height field; `face`: number of the face; `away`: the camera less the light [m];
    `direction`: unit directions; `segment`: the distances (x0, x1) of the part in the face; `x1`
    may be infinite.
    """
    a0, b0, s0, c0 = heights.projection.homogeneous(face, away, 1)
    da, db, ds, dc = heights.projection.homogeneous(face, direction, 0)
    begin, end = segment
    # The root of the pyramid holds the largest height of the face, the nearest surface to the
    # light.
    zero = mi.UInt32(0)
    _, highest = node_bounds(heights, face, zero, zero, zero)
    nearer = 1 - 1e-4  # of the nearest surface, with room for rounding
    if not heights.projection.w:
        # The third product, c0 + x dc, is -s: the line begins where s comes down to the largest
        # height.
        (*_, c0), (*_, dc) = (
            heights.projection.products(face, vector) for vector in (away, direction)
        )
        t0, t1 = _cut(begin, end, highest / nearer + c0, dc)
        walks = (t0 < t1) & (highest > 0)
        ends = [
            _parallel_coordinates(heights.size, x, (a0, b0, s0), (da, db, ds), walks)
            for x in (t0, t1)
        ]
        return _face_ray(begin, end, walks, ends, parallel=True)
    # The line begins where the planar depth c reaches the depth of the nearest surface.
    nearest = nearer / highest  # infinite where nothing is hit: all is lit
    t0, t1 = _cut(begin, end, c0 - nearest, dc)
    walks = (t0 < t1) & (highest > 0)
    ends = [_coordinates(heights.size, x, (a0, b0, c0), (da, db, dc), nearest) for x in (t0, t1)]
    return _face_ray(begin, end, walks, ends)


def _face_ray(begin, end, walks, ends, *, parallel: bool = False) -> FaceRay:
    u, v, s, y = zip(*ends)
    across, upward = u[1] - u[0], v[1] - v[0]
    per_u, per_v, per_diagonal = (_inverse(length) for length in (across, upward, upward - across))
    return FaceRay(begin, end, walks, u, v, s, y, per_u, per_v, per_diagonal, parallel)


def _cut(begin, end, start, slope):
    """Cut a segment down to where start + x slope >= 0."""
    # A slope of 0 cuts all or nothing.
    at = -start / slope
    begin = dr.select(slope > 0, dr.maximum(begin, at), begin)
    end = dr.select(slope < 0, dr.minimum(end, at), end)
    return begin, dr.select((slope == 0) & (start < 0), begin, end)


def _coordinates(size: int, x, origin, direction, nearest):
    """Return u, v [texels], s and y of the point at x."""
    # At the end of an unbounded ray the direction takes the place of the point: s = 0, y = 1 / dc.
    finite = dr.isfinite(x)
    at = dr.select(finite, x, 0)
    a, b, c = (dr.select(finite, dr.fma(at, d, o), d) for o, d in zip(origin, direction))
    # Rounding must not put the point nearer to the light than where the line begins.
    inverse = dr.rcp(dr.select(finite, dr.maximum(c, nearest), c))
    half = 0.5 * size
    # Stay just within the last column and row: a line along the far border would lie in none.
    last_place = size * (1 - dr.epsilon(type(x)))
    u, v = (dr.clip(dr.fma(half * p, inverse, half), 0, last_place) for p in (a, b))
    return u, v, dr.select(finite, inverse, 0), dr.select(finite, at * inverse, inverse)


def _parallel_coordinates(size: int, x, origin, direction, walks):
    """Return u, v [texels], s and x of the point at x, or of any point
    where the line does not walk.
    """
    at = dr.select(walks, x, 0)
    a, b, s = (dr.fma(at, d, o) for o, d in zip(origin, direction))
    half = 0.5 * size
    last_place = size * (1 - dr.epsilon(type(x)))
    u, v = (dr.clip(dr.fma(half, p, half), 0, last_place) for p in (a, b))
    return u, v, s, at


def _inverse(length):
    # Lines of texels that the ray never crosses lie far beyond [0, 1]: 1e30 stands for 1/0.
    steep = 1e30
    return dr.select(dr.abs(length) < 1 / steep, steep, 1 / length)


def at_line(pair, t):
    """Return a coordinate of the line at t; `pair` is that coordinate at its ends."""
    return dr.fma(t, pair[1], dr.fma(-t, pair[0], pair[0]))


def distance_at(ray: FaceRay, t):
    """Return the distance x along the ray at t [m]."""
    return at_line(ray.y, t) if ray.parallel else at_line(ray.y, t) / at_line(ray.s, t)


@dataclass
class Line:
    """A ray's line over a face, with D at its ends."""

    ray: FaceRay
    right: Any  #: whether columns rise along it
    up: Any  #: whether rows do
    excess: tuple[Any, Any]  #: D at t = 0 and t = 1
    #: column and row of the texels that hold the two ends
    cells: tuple[tuple[Any, Any], tuple[Any, Any]]
    #: how far below the height field a point at t = 1 may seem although it lies on the surface
    slack: Any


def line_of(heights: InverseDepthField, face, ray: FaceRay) -> Line:
    """Return the line of a ray in a face; D at either end is read in the texel whose borders lie
    about that end.
    """
    right, up = ray.per_u > 0, ray.per_v > 0
    excess, cells, slack = [], [], type(ray.begin)(0)
    for t in (0, 1):
        at = type(ray.begin)(t)
        # The texel whose borders lie about this end of the line, and the height there.
        i, j = (
            cell_at(pair, per, at, mi.UInt32(0), mi.UInt32(heights.size))
            for pair, per in ((ray.u, ray.per_u), (ray.v, ray.per_v))
        )
        four = texel_heights(heights, face, i, j, ray.walks)
        x, y = ray.u[t] - type(at)(i), ray.v[t] - type(at)(j)
        height, doubt = _height_in(heights, (face, i, j, ray.walks), four, x, y)
        excess.append(ray.s[t] - height)
        cells.append((i, j))
        # The slack at t = 1 stays; 1e-5 of the height is the rounding of the map, with room.
        slack = dr.fma(ray.s[t], 1e-5, doubt)
    return Line(ray, right, up, (excess[0], excess[1]), (cells[0], cells[1]), slack)


def _height_in(heights, texel, four, x, y):
    """Return the height at a point of a texel with four heights, and how far below it a
    lit surface may seem to be.

    That distance is the range of the heights, as the surface may do anything between the samples.
    Next to a wall it is half the range: there the only question is on which of two surfaces the
    point lies.
    """
    # Over the triangle below the diagonal the height changes with x along the bottom and with y
    # along the right side; over the one above it along the top and the left side.
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

    The strip begins at texel `low`; `pair` is the coordinate at the ends of the line and
    `per` its inverse change.
    """
    first, last = mi.Int32(low), mi.Int32(low + side) - 1
    cell = dr.clip(mi.Int32(dr.floor(at_line(pair, t))), first, last)
    # Rounding may have put it one too far, or not far enough.
    begin, end = borders(type(t)(cell), pair[0], per)
    step = dr.select(per > 0, mi.Int32(1), mi.Int32(-1))
    return mi.UInt32(
        dr.clip(
            dr.select(t >= end, cell + step, dr.select(t < begin, cell - step, cell)), first, last
        )
    )


def borders(low, start, per):
    """Return the t at which a line enters and leaves the strip from `low` to `low + 1` [texels].

    The line is at `start` [texels] for t = 0 and needs `per` for a texel.
    """
    at_low, at_high = (low - start) * per, (low + 1 - start) * per
    return dr.minimum(at_low, at_high), dr.maximum(at_low, at_high)
