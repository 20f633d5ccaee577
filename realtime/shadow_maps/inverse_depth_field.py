# SPDX-License-Identifier: BSD-3-Clause
"""The light volume as a height field: the inverse of the planar depth over
the texels of a shadow map.

Billeter, Sintorn, Assarsson 2010, section 4, displace a grid by the depths of a shadow map; what
lies between the light and the displaced grid is lit. A point has the projective coordinates (u, v,
s) of `realtime.shadow_maps.projection`: planes stay planes and lines stay lines. The triangles of
the displaced grid are therefore triangles over the texels of the map, linear in s; a camera ray is
a straight line; and a point is lit where its s is above the height field. Where nothing is hit s =
0: a vertex at infinity, or for parallel rays the end of the media; without sides it is far behind.

A texel is cut along the diagonal from its corner (0, 0) to (1, 1), into

    s00 + x (s10 - s00) + y (s11 - s10)   where x >= y,
    s00 + y (s01 - s00) + x (s11 - s01)   where y >= x.

The bounds of the heights over squares of texels form a pyramid: level 0 is the whole face, the last
level the texels. Its nodes stand level by level, row by row; 1 + 4 + ... + 4^(d - 1) = (4^d - 1) /
3 of them, in binary 0101...01, come before level d.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.numerics.array_types import four_numbers, two_numbers
from airlight.realtime.shadow_maps.projection import Projection
from airlight.realtime.shadow_maps.shadow_map import ShadowMap, inverse_depth


@dataclass(frozen=True)
class InverseDepthField:
    """Inverse planar depths over the faces of a shadow map, or heights for parallel
    rays, with their bounds.
    """

    size: int  #: texels on a side
    projection: Projection  #: of its faces
    texels: Any  #: the heights s00, s10, s01, s11 of every texel, face by face, row by row [1/m]
    bounds: Any  #: least and largest height of every node of the pyramid, face by face [1/m]
    #: by texel, where on its sides upright walls stand, see `jump_search`; None for none
    walls: Any = None

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return self.projection.faces

    @property
    def finest(self) -> int:
        """The last level of the pyramid, 2^finest texels across."""
        return self.size.bit_length() - 1

    @property
    def nodes(self) -> int:
        """Nodes of the pyramid of one face."""
        return level_start(self.finest + 1)


def level_start(level: int) -> int:
    """Return how many nodes of a face's pyramid come before a level."""
    return (4**level - 1) // 3


def inverse_depth_field(shadow_map: ShadowMap) -> InverseDepthField:
    """Return the height field of a shadow map, with its pyramid of bounds."""
    # The heights at the corners of the texels are read by four texels each.
    size = shadow_map.size
    height = inverse_depth(shadow_map)
    dr.eval(height)
    Float = type(height)
    index = dr.arange(mi.UInt32, shadow_map.faces * size * size)
    row = index // size
    # A face has one row and one column of corners more than of texels.
    corner = (row + row // size) * (size + 1) + (index - row * size)
    # Each texel with its four corners side by side: a march reads them at once.
    texels = dr.empty(Float, 4 * dr.width(index))
    four = [dr.gather(Float, height, corner + step) for step in (0, 1, size + 1, size + 2)]
    dr.scatter(texels, four_numbers(Float)(*four), index)
    dr.eval(texels)
    field = InverseDepthField(size, shadow_map.projection, texels, dr.empty(Float, 0))
    # The pyramid from its finest level, a node for each texel, up to the whole face.
    bounds = dr.empty(Float, 2 * field.faces * field.nodes)
    low, high = four[0], four[0]
    for corner_height in four[1:]:
        low, high = dr.minimum(low, corner_height), dr.maximum(high, corner_height)
    face, within = index // size**2, index % size**2
    dr.scatter(
        bounds,
        two_numbers(Float)(low, high),
        face * field.nodes + level_start(field.finest) + within,
    )
    dr.eval(bounds)
    for level in reversed(range(field.finest)):
        _write_level(field, bounds, level)
        dr.eval(bounds)
    return replace(field, bounds=bounds)


def node_bounds(heights: InverseDepthField, face, level, i, j):
    """Return the least and largest height over the node in column `i` and row `j` of
    a level of a face [1/m].
    """
    node = face * heights.nodes + _before(level) + (j << level) + i
    pair = dr.gather(two_numbers(type(heights.bounds)), heights.bounds, node)
    return pair.x, pair.y


def _before(level):
    """Return `level_start` of a level that only the device knows."""
    # (4^level - 1)/3 is 0101...01 in 2 level bits.
    return 0x55555555 & ((mi.UInt32(1) << (2 * level)) - 1)


def texel_heights(heights: InverseDepthField, face, i, j, active=True):
    """Return the heights s00, s10, s01 and s11 of the texel in column `i` and
    row `j` of a face [1/m].
    """
    texel = (face * heights.size + j) * heights.size + i
    return dr.gather(four_numbers(type(heights.texels)), heights.texels, texel, active)


def texel_walls(heights: InverseDepthField, face, i, j, active=True):
    """Return the walls of the texel in column `i` and row `j` of a face."""
    return dr.gather(mi.UInt32, heights.walls, (face * heights.size + j) * heights.size + i, active)


def _write_level(heights: InverseDepthField, bounds, level: int) -> None:
    """Write the bounds of the nodes of a level, from the bounds of the next one."""
    # one kernel for all levels: to compile it takes longer than all its runs
    step = dr.opaque(mi.UInt32, level)
    index = dr.arange(mi.UInt32, heights.faces << (2 * level))
    # Lanes count the nodes of all faces, row by row, 2^level nodes a row and rows a face.
    row = index >> step
    face = row >> step
    i, j = index - (row << step), row - (face << step)
    # A node has four children in the next level: two side by side in row 2 j, two in row 2 j + 1.
    first = face * heights.nodes + _before(step + 1) + (j << (step + 2)) + 2 * i
    places = first, first + 1, first + (mi.UInt32(2) << step), first + (mi.UInt32(2) << step) + 1
    low, high = _merged(dr.gather(two_numbers(type(bounds)), bounds, place) for place in places)
    node = face * heights.nodes + _before(step) + (j << step) + i
    dr.eval(low, high)  # Dr.Jit would copy an array that somebody still reads
    dr.scatter(bounds, two_numbers(type(bounds))(low, high), node)


def _merged(pairs):
    """Return the least of the lower and the largest of the upper bounds."""
    low, high = next(pairs)
    for lower, higher in pairs:
        low, high = dr.minimum(low, lower), dr.maximum(high, higher)
    return low, high
