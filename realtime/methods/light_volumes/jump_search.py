# SPDX-License-Identifier: BSD-3-Clause
"""Upright walls of a light volume: where between two samples of a shadow map its depth jumps.

As published (Billeter, Sintorn, Assarsson 2010), a silhouette of what the light sees is joined to
what lies behind it by triangles across one texel: next to its occluder the shadow begins at the
occluder's last sample, far behind it at the first sample of the background. The real surface of the
shadow is upright there, in a plane through the light, and stands somewhere between the two samples.
The same error stands along the whole ray, so it does not average out.

Here the place is found. On every side of a texel whose two heights differ by more than `_JUMP` of
the larger one, rays from the light halve the interval between the samples six times, down to one of
`PLACES` parts, each time keeping the half with the larger change of height. The last interval holds
a small part of the change of a slope, and the side stays as it is; it holds the whole change of a
jump, and a wall is put in its middle. That is the idea of silhouette maps (Sen, Cammarano, Hanrahan
2003), for volumes; the map itself stays as it was.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.light_volumes.texel_walls import (
    BOTTOM,
    LEFT,
    PLACES,
    RIGHT,
    TOP,
    walled_heights,
)
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.inverse_depth_field import InverseDepthField, level_start
from airlight.realtime.shadow_maps.shadow_map import cast_map_rays

_JUMP = 0.05  # of the larger height: walls lower than that are left slanted
#: texels on a side of the nodes in which sides are looked for, those two levels above the texels
LEAF = 4
_SIDES = 2 * LEAF * (LEAF + 1)  # of the texels of a leaf


def with_walls(heights: InverseDepthField, scene, light: Light) -> InverseDepthField:
    """Return a height field with upright walls where the map of a light jumps.

    `heights`: the height field of the light's map; `scene`: the Mitsuba scene that the map was
    cast in; `light`: the light.
    """
    walls = dr.zeros(mi.UInt32, heights.faces * heights.size**2)
    leaf, side = _jumping_sides(heights)
    texels = _trace(heights, scene, light, (leaf, side), walls) if dr.width(leaf) else leaf
    return walled_heights(heights, walls, texels)


@dataclass
class _Edge:
    """A side of a texel in a face, from corner (i, j) on along u or along v."""

    face: Any
    i: Any
    j: Any
    upright: Any  #: whether it goes along v


def _edge_of(heights: InverseDepthField, leaf, side) -> _Edge:
    """Return a side by the number of its leaf and its own in there."""
    # Leaves are counted row by row, face by face; in a leaf the sides along u come first, then as
    # many along v, each kind in LEAF + 1 lines of LEAF sides.
    nodes = heights.size // LEAF
    row = leaf // nodes
    face = row // nodes
    upright = side >= _SIDES // 2
    within = side % (_SIDES // 2)
    across, along = within // LEAF, within % LEAF
    i, j = dr.select(upright, across, along), dr.select(upright, along, across)
    return _Edge(face, (leaf - row * nodes) * LEAF + i, (row - face * nodes) * LEAF + j, upright)


def _jumping_sides(heights: InverseDepthField):
    """Return the sides over which heights differ enough, by their leaves' numbers and their own."""
    # Heights differ by no more on a side than over its whole leaf: leaves with lower differences
    # are left out before any side is looked at.
    per_face = (heights.size // LEAF) ** 2
    leaf = dr.arange(mi.UInt32, heights.faces * per_face)
    face = leaf // per_face
    node = face * heights.nodes + level_start(heights.finest - 2) + (leaf - face * per_face)
    low, high = (
        dr.gather(type(heights.bounds), heights.bounds, 2 * node + which) for which in (0, 1)
    )
    leaf = dr.compress(high - low > _JUMP * high)
    if not dr.width(leaf):
        return leaf, leaf
    # Then all sides of the leaves that remain, by the heights at their own ends.
    lane = dr.arange(mi.UInt32, dr.width(leaf) * _SIDES)
    of_leaf, side = dr.gather(mi.UInt32, leaf, lane // _SIDES), lane % _SIDES
    edge = _edge_of(heights, of_leaf, side)
    begin_height, end_height = _ends(heights, edge)
    # The far border of a leaf belongs to the next one, except for the last.
    outer = dr.select(edge.upright, edge.i, edge.j)
    belongs = (side % (_SIDES // 2) < LEAF * LEAF) | (outer == heights.size)
    some = dr.compress(
        belongs & (dr.abs(begin_height - end_height) > _JUMP * dr.maximum(begin_height, end_height))
    )
    return dr.gather(mi.UInt32, of_leaf, some), dr.gather(mi.UInt32, side, some)


def _ends(heights: InverseDepthField, edge: _Edge):
    """Return the heights at both ends of sides."""
    size = heights.size
    i, j = dr.minimum(edge.i, size - 1), dr.minimum(edge.j, size - 1)
    texel = (edge.face * size + j) * size + i
    # The corners of a texel: 0, 1, 2 and 3 at (0, 0), (1, 0), (0, 1) and (1, 1).
    first = 4 * texel + (edge.i - i) + 2 * (edge.j - j)
    step = dr.select(edge.upright, mi.UInt32(2), mi.UInt32(1))
    return tuple(
        dr.gather(type(heights.texels), heights.texels, place) for place in (first, first + step)
    )


def _trace(heights: InverseDepthField, scene, light: Light, sides, walls):
    """Find the walls on sides and write them to both texels of each; return the
    numbers of these texels.
    """
    edge = _edge_of(heights, *sides)
    begin_height, end_height = _ends(heights, edge)
    Double, size = mi.Float64, heights.size

    def halve(step, number, begin_height, end_height):
        # The middle of interval `number` of the 2^step intervals of the side.
        middle = (2 * Double(number) + 1) / Double(2 << step)
        column, row = Double(edge.i), Double(edge.j)
        u = dr.fma(dr.select(edge.upright, column, column + middle), 2.0 / size, -1.0)
        v = dr.fma(dr.select(edge.upright, row + middle, row), 2.0 / size, -1.0)
        distance = cast_map_rays(scene, light, (edge.face, u, v))
        height = heights.projection.inverse_depth(
            (type(begin_height)(u), type(begin_height)(v)), distance
        )
        # The half with the larger change of height is kept: the far one if the middle is nearer in
        # height to the beginning.
        far = dr.abs(height - begin_height) < dr.abs(height - end_height)
        number = (number << 1) + dr.select(far, mi.UInt32(1), mi.UInt32(0))
        return (
            step + 1,
            number,
            dr.select(far, height, begin_height),
            dr.select(far, end_height, height),
        )

    halvings = PLACES.bit_length() - 1
    step = dr.zeros(mi.UInt32, dr.width(begin_height))
    _, number, low, high = dr.while_loop(
        state=(step, step + 0, begin_height + 0, end_height + 0),
        cond=lambda step, *_: step < halvings,
        body=halve,
        labels=("step", "number", "begin_height", "end_height"),
    )
    # A jump keeps at least half the change between the samples in the last interval; a slope keeps
    # 1/64 of it.
    jumps = dr.abs(low - high) > 0.5 * dr.abs(begin_height - end_height)
    # Both texels of a side get its byte: it is the bottom or left side of the one behind it and the
    # top or right side of the one before it. At the border of a face one of the two is missing.
    behind = (edge.face * size + edge.j) * size + edge.i
    before = behind - dr.select(edge.upright, mi.UInt32(1), mi.UInt32(size))
    place = dr.select(edge.upright, edge.i, edge.j)
    for shifts, texel, active in (
        ((BOTTOM, LEFT), behind, place < size),
        ((TOP, RIGHT), before, place > 0),
    ):
        level, upright = (mi.UInt32(8 * side) for side in shifts)
        number_there = (number + 1) << dr.select(edge.upright, upright, level)
        dr.scatter_reduce(dr.ReduceOp.Or, walls, number_there, texel, jumps & active)
    # A missing texel is replaced by the other one, which then is in the list twice.
    pair = dr.select(place < size, behind, before), dr.select(place > 0, before, behind)
    dr.eval(walls, pair)
    # Not `dr.concat`: it would put the number of sides into a kernel, which each light that
    # moves would compile again.
    lane = dr.arange(mi.UInt32, 2 * dr.width(place))
    first, second = (dr.gather(mi.UInt32, texels, lane >> 1) for texels in pair)
    return dr.select((lane & 1) == 0, first, second)
