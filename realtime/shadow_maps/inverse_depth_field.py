# SPDX-License-Identifier: BSD-3-Clause
"""The light volume as a height field: the inverse of the planar depth over the texels of a shadow map.

Billeter, Sintorn, Assarsson 2010, section 4, displace a grid by the depths of a shadow map; what lies between the light
and the displaced grid is lit. A point has the projective coordinates (u, v, s) of `realtime.shadow_maps.projection`:
planes stay planes and lines stay lines. So the triangles of the displaced grid are triangles over the texels of the
map, linear in s; a camera ray is a straight line; and a point is lit where its s is above the height field. Where
nothing is hit s = 0: a vertex at infinity, or for parallel rays the end of the media.

A texel is cut along the diagonal from its corner (0, 0) to (1, 1), into

    s00 + x (s10 - s00) + y (s11 - s10)   where x >= y,
    s00 + y (s01 - s00) + x (s11 - s01)   where y >= x.

The bounds of the heights over squares of texels form a pyramid: level 0 is the whole face, the last level leaves of 4 x
4 texels. Its nodes stand level by level, row by row; 1 + 4 + ... + 4^(d - 1) = (4^d - 1) / 3 of them, in binary
0101...01, come before level d.

At an edge of what the light sees, a leaf's bounds go from the near side to the far side, and all that passes behind the
near one lies within them. So the texels of a leaf are sorted by a height between the bounds: those below it, those
above it, and those on both sides. Between the two groups there is a gap, where rays meet only texels on both sides.
"""

from dataclasses import dataclass
from functools import reduce
from itertools import pairwise
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.numerics.array_types import four_numbers, two_numbers
from realtime.shadow_maps.projection import Projection
from realtime.shadow_maps.shadow_map import ShadowMap, inverse_depth

LEAF = 4  #: texels on a side of a node of the last level: smaller nodes cost more to find than they save
_DIVIDE = 0.7  # from the least height of a leaf to the largest, of the height that divides its texels


@dataclass(frozen=True)
class InverseDepthField:
    """Inverse planar depths over the faces of a shadow map, or heights for parallel rays, with their bounds."""

    size: int  #: texels on a side
    projection: Projection  #: of its faces
    texels: Any  #: the heights s00, s10, s01, s11 of every texel, face by face, row by row [1/m]
    bounds: Any  #: least and largest height of every node of the pyramid, face by face [1/m]
    gaps: Any = None  #: by leaf: largest height of the texels below the height that divides them, least of those above
    sides: Any = None  #: by leaf: bit 4 row + column of texels below that height, and 16 more of those on both sides
    walls: Any = None  #: by texel, where on its sides upright walls stand, see `jump_search`; None for none

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return self.projection.faces

    @property
    def finest(self) -> int:
        """The last level of the pyramid, 2^finest nodes across."""
        return (self.size // LEAF).bit_length() - 1

    @property
    def nodes(self) -> int:
        """Nodes of the pyramid of one face."""
        return level_start(self.finest + 1)


def level_start(level: int) -> int:
    """Return how many nodes of a face's pyramid come before a level."""
    return (4**level - 1) // 3


def inverse_depth_field(shadow_map: ShadowMap) -> InverseDepthField:
    """Return the height field of a shadow map, with its pyramid of bounds."""
    size = shadow_map.size
    height = inverse_depth(shadow_map)
    dr.eval(height)
    Float = type(height)
    index = dr.arange(mi.UInt32, shadow_map.faces * size * size)
    row = index // size
    # A face has one row and one column of corners more than of texels.
    corner = (row + row // size) * (size + 1) + (index - row * size)
    texels = dr.empty(Float, 4 * dr.width(index))
    four = [dr.gather(Float, height, corner + step) for step in (0, 1, size + 1, size + 2)]
    dr.scatter(texels, four_numbers(Float)(*four), index)
    dr.eval(texels)
    field = InverseDepthField(size, shadow_map.projection, texels, dr.empty(Float, 0))
    bounds = dr.empty(Float, 2 * field.faces * field.nodes)
    gaps, sides = _write_leaves(field, height, bounds)
    for level in reversed(range(field.finest)):
        _write_level(field, bounds, level)
        dr.eval(bounds)
    return InverseDepthField(size, shadow_map.projection, texels, bounds, gaps, sides)


def node_bounds(heights: InverseDepthField, face, level, i, j, active=True):
    """Return the least and largest height over the node in column `i` and row `j` of a level of a face [1/m]."""
    node = face * heights.nodes + _before(level) + (j << level) + i
    pair = dr.gather(two_numbers(type(heights.bounds)), heights.bounds, node, active)
    return pair.x, pair.y


def _before(level):
    """Return `level_start` of a level that only the device knows."""
    return 0x55555555 & ((mi.UInt32(1) << (2 * level)) - 1)


def texel_heights(heights: InverseDepthField, face, i, j, active=True):
    """Return the heights s00, s10, s01 and s11 of the texel in column `i` and row `j` of a face [1/m]."""
    texel = (face * heights.size + j) * heights.size + i
    return dr.gather(four_numbers(type(heights.texels)), heights.texels, texel, active)


def texel_walls(heights: InverseDepthField, face, i, j, active=True):
    """Return the walls of the texel in column `i` and row `j` of a face."""
    return dr.gather(mi.UInt32, heights.walls, (face * heights.size + j) * heights.size + i, active)


@dataclass
class Leaf:
    """The texels of a leaf, sorted by a height that divides them."""

    below: Any  #: largest height of those that lie below it [1/m]
    above: Any  #: least height of those that lie above it [1/m]
    low: Any  #: bit 4 row + column of each texel below it
    both: Any  #: and of each on both sides


def leaf_sides(heights: InverseDepthField, face, i, j, active=True) -> Leaf:
    """Return how the texels of the leaf in column `i` and row `j` of a face are sorted."""
    leaf = (((face << heights.finest) + j) << heights.finest) + i
    gap = dr.gather(two_numbers(type(heights.gaps)), heights.gaps, leaf, active)
    sides = dr.gather(mi.UInt32, heights.sides, leaf, active)
    return Leaf(gap.x, gap.y, sides & 0xFFFF, sides >> 16)


def _write_leaves(heights: InverseDepthField, corners, bounds):
    """Write the bounds of the leaves from the heights at all corners; return their gaps and sides."""
    side = 1 << heights.finest
    leaf = dr.arange(mi.UInt32, heights.faces * side * side)
    row = leaf // side
    face, i = row // side, leaf - row * side
    j = row - face * side
    Float = type(bounds)
    across = heights.size + 1
    first = (face * across + j * LEAF) * across + i * LEAF
    rows = [[dr.gather(Float, corners, first + (k * across + m)) for m in range(LEAF + 1)] for k in range(LEAF + 1)]
    least, largest = _of_texels(rows, dr.minimum), _of_texels(rows, dr.maximum)
    low, high = reduce(dr.minimum, least), reduce(dr.maximum, largest)
    divide = dr.fma(_DIVIDE, high - low, low)
    below, above, sides = low, high, mi.UInt32(0)
    for k, (lower, upper) in enumerate(zip(least, largest)):
        is_below, is_above = upper < divide, lower >= divide
        below = dr.select(is_below, dr.maximum(below, upper), below)
        above = dr.select(is_above, dr.minimum(above, lower), above)
        sides |= dr.select(is_below, mi.UInt32(1 << k), dr.select(is_above, mi.UInt32(0), mi.UInt32(1 << (16 + k))))
    gaps = dr.empty(Float, 2 * dr.width(leaf))
    node = face * heights.nodes + level_start(heights.finest) + j * side + i
    dr.scatter(bounds, two_numbers(Float)(low, high), node)
    dr.scatter(gaps, two_numbers(Float)(below, above), leaf)
    dr.eval(bounds, gaps, sides)
    return gaps, sides


def _of_texels(rows, smaller):
    """Return the least (or largest) of the four heights of each texel, from rows of heights at corners."""
    pairs = [[smaller(*pair) for pair in pairwise(row)] for row in rows]
    return [smaller(*pair) for two in pairwise(pairs) for pair in zip(*two)]


def _write_level(heights: InverseDepthField, bounds, level: int) -> None:
    """Write the bounds of the nodes of a level, from those of the next one."""
    step = dr.opaque(mi.UInt32, level)  # one kernel for all levels: to compile it takes longer than all its runs
    index = dr.arange(mi.UInt32, heights.faces << (2 * level))
    row = index >> step
    face = row >> step
    i, j = index - (row << step), row - (face << step)
    full = InverseDepthField(heights.size, heights.projection, heights.texels, bounds)
    four = [node_bounds(full, face, step + 1, 2 * i + k % 2, 2 * j + k // 2) for k in range(4)]
    low, high = four[0]
    for lower, higher in four[1:]:
        low, high = dr.minimum(low, lower), dr.maximum(high, higher)
    node = face * heights.nodes + _before(step) + (j << step) + i
    dr.eval(low, high)  # Dr.Jit would copy an array that one kernel both reads and writes
    dr.scatter(bounds, two_numbers(type(bounds))(low, high), node)
