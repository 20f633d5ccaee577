# SPDX-License-Identifier: BSD-3-Clause
"""The light volume as a height field: the inverse of the planar depth over the texels of a shadow map.

Billeter, Sintorn, Assarsson 2010, section 4, displace a grid by the depths of a shadow map; what lies between the light
and the displaced grid is lit. A point beyond (u, v) of a face is

    P = light + (axis + u across + v up) / s,      s = 1 / planar depth,

and (u, v, s) are projective coordinates of P: planes stay planes and lines stay lines. So the triangles of the
displaced grid are triangles over the texels of the map, linear in s; a camera ray is a straight line; and a point is
lit where its s is above the height field. Where nothing is hit s = 0: a vertex at infinity.

A texel is cut along the diagonal from its corner (0, 0) to (1, 1), into

    s00 + x (s10 - s00) + y (s11 - s10)   where x >= y,
    s00 + y (s01 - s00) + x (s11 - s01)   where y >= x.

The bounds of the heights over squares of 2^k x 2^k texels, k >= 1, form a pyramid, level 0 the whole face. Its nodes
stand level by level, row by row; 1 + 4 + ... + 4^(d - 1) = (4^d - 1) / 3 of them, in binary 0101...01, come before
level d.
"""

from dataclasses import dataclass
from typing import Any

from realtime.shadow_map import ShadowMap


@dataclass(frozen=True)
class LightHeights:
    """Inverse planar depths over the faces of a shadow map, with their bounds."""

    size: int  #: texels on a side
    frame: tuple[Any, Any, Any] | None  #: of a spot's face, see `realtime.shadow_map`; None for a cube
    texels: Any  #: the heights s00, s10, s01, s11 of every texel, face by face, row by row [1/m]
    bounds: Any  #: least and largest height of every node of the pyramid, face by face [1/m]

    @property
    def faces(self) -> int:
        """How many faces the map has."""
        return 1 if self.frame else 6

    @property
    def levels(self) -> int:
        """Levels of the pyramid; the last has nodes of 2 x 2 texels."""
        return self.size.bit_length() - 1

    @property
    def nodes(self) -> int:
        """Nodes of the pyramid of one face."""
        return level_start(self.levels)


def level_start(level: int) -> int:
    """Return how many nodes of a face's pyramid come before a level."""
    return (4**level - 1) // 3


def inverse_depth(shadow_map: ShadowMap):
    """Return the inverse planar depth at every corner of the texels, in the order of the map [1/m]."""
    import drjit as dr
    import mitsuba as mi

    size, distance = shadow_map.size, shadow_map.distance
    Float = type(distance)
    index = dr.arange(mi.UInt32, dr.width(distance))
    row = index // (size + 1)
    u = dr.fma(Float(index - row * (size + 1)), 2.0 / size, -1.0)
    v = dr.fma(Float(row % (size + 1)), 2.0 / size, -1.0)
    across = dr.squared_norm(shadow_map.frame[0]) if shadow_map.frame else Float(1)
    return dr.sqrt(dr.fma(across, dr.square(u) + dr.square(v), 1)) / distance


def light_heights(shadow_map: ShadowMap) -> LightHeights:
    """Return the height field of a shadow map, with its pyramid of bounds."""
    import drjit as dr
    import mitsuba as mi

    size = shadow_map.size
    height = inverse_depth(shadow_map)
    dr.eval(height)
    Float = type(height)
    index = dr.arange(mi.UInt32, shadow_map.faces * size * size)
    row = index // size
    # A face has one row and one column of corners more than of texels.
    corner = (row + row // size) * (size + 1) + (index - row * size)
    texels = dr.empty(Float, 4 * dr.width(index))
    dr.scatter(texels, _four(*(dr.gather(Float, height, corner + k) for k in (0, 1, size + 1, size + 2))), index)
    dr.eval(texels)
    found = LightHeights(size, shadow_map.frame, texels, dr.empty(Float, 0))
    bounds = dr.empty(Float, 2 * found.faces * found.nodes)
    for level in reversed(range(found.levels)):
        _write_level(found, bounds, level)
        dr.eval(bounds)
    return LightHeights(size, shadow_map.frame, texels, bounds)


def _write_level(heights: LightHeights, bounds, level: int) -> None:
    """Write the bounds of the nodes of a level, from those of the next one, or from the texels."""
    import drjit as dr
    import mitsuba as mi

    Float = type(bounds)
    side = 1 << level
    index = dr.arange(mi.UInt32, heights.faces * side * side)
    row = index // side
    face = row // side
    below = 2 * (row * 2 * side + (index - row * side))  # the first of the four squares below, row by row
    low, high = [], []
    for step in (0, 1, 2 * side, 2 * side + 1):
        if level == heights.levels - 1:
            four = dr.gather(type(_four(bounds)), heights.texels, below + step)
            low.append(dr.min(four))
            high.append(dr.max(four))
        else:
            node = face * (heights.nodes - 4 * side * side) + level_start(level + 1) + below + step
            pair = dr.gather(type(_two(bounds)), bounds, node)
            low.append(pair.x)
            high.append(pair.y)
    lowest = dr.minimum(dr.minimum(low[0], low[1]), dr.minimum(low[2], low[3]))
    highest = dr.maximum(dr.maximum(high[0], high[1]), dr.maximum(high[2], high[3]))
    node = face * (heights.nodes - side * side) + level_start(level) + index
    dr.scatter(bounds, _two(Float(lowest), highest), node)


def _two(*values):
    import mitsuba as mi

    single = type(values[0]) is mi.Float
    return (mi.Vector2f if single else mi.Vector2d)(*values)


def _four(*values):
    import mitsuba as mi

    single = type(values[0]) is mi.Float
    return (mi.Vector4f if single else mi.Vector4d)(*values)
