# SPDX-License-Identifier: BSD-3-Clause
"""The nodes of a pyramid of heights, and which of them a beam of rays may meet.

The walk over a pyramid needs no stack: the node after (i, j) at some level is its first child, or the next of its
parent's four children, or what follows the parent.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.light_volumes.tile_beams import BeamPlanes, may_meet, over_square
from realtime.numerics.array_types import is_single
from realtime.shadow_maps.inverse_depth_field import InverseDepthField, node_bounds


@dataclass
class Node:
    """Squares of texels: those of level 0 are whole faces."""

    level: Any
    i: Any  #: column
    j: Any  #: row


@dataclass
class Box:
    """A node as a beam meets it."""

    low: Any  #: its bounds
    high: Any
    values: list[Any]  #: see `over_square`


def packed(node: Node):
    """Return a node as one number."""
    return (node.level << 26) | (node.j << 13) | node.i


def unpacked(entry) -> Node:
    """Return the node that `packed` made the number `entry` of."""
    return Node(entry >> 26, entry & 0x1FFF, (entry >> 13) & 0x1FFF)


def descend(heights: InverseDepthField, planes: BeamPlanes, face, leaf, count, write, active):
    """Count, from `count` on, and `write` the nodes of level `leaf` of a face that beams may meet."""

    def body(node: Node, count, going):
        met, box = meets(heights, planes, face, node, going)
        at_leaf = met & (node.level == leaf)
        count = write(node, box, count, at_leaf)
        down = met & ~at_leaf
        # The last of four children, of which the parent is the last of four, and so on: back to the first that is not.
        back = dr.select(down, 0, dr.tzcnt(~(node.i & node.j)))
        going &= down | (node.level > back)
        level, i, j = node.level - back, node.i >> back, node.j >> back
        odd = (i & 1) != 0
        node = Node(
            dr.select(down, level + 1, level),
            dr.select(down, i << 1, dr.select(odd, i - 1, i + 1)),
            dr.select(down, j << 1, dr.select(odd, j + 1, j)),
        )
        return node, count, going

    width = dr.width(face, planes.slack[0])
    _, count, _ = dr.while_loop(
        state=(
            Node(*(dr.zeros(mi.UInt32, width) for _ in range(3))),
            count,
            dr.full(mi.Bool, True, width) & active,
        ),
        cond=lambda node, count, going: going,
        body=body,
        labels=("node", "count", "going"),
    )
    return count


def meets(heights: InverseDepthField, planes: BeamPlanes, face, node: Node, active):
    """Return whether a beam may meet the height field over a node of a face, and what that was decided from."""
    low, high = node_bounds(heights, face, node.level, node.i, node.j, active)
    half = _half(type(low), node.level)
    u = dr.fma(dr.fma(2.0, type(low)(node.i), 1.0), half, -1.0)
    v = dr.fma(dr.fma(2.0, type(low)(node.j), 1.0), half, -1.0)
    box = Box(low, high, over_square(planes, (u, v), half))
    return active & may_meet(planes, box.values, low, high), box


def _half(Float, level):
    """Return half the side of a node, where a face goes from -1 to 1: 2^-level."""
    if is_single(Float):
        return dr.reinterpret_array(Float, (127 - level) << 23)
    return 1 / Float(mi.UInt32(1) << level)
