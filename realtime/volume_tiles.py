# SPDX-License-Identifier: BSD-3-Clause
"""Which texels of a shadow map concern a tile of the image: short lists, so that a ray looks at little else.

A tile is sixteen rays that follow one another (4 x 4 pixels), a block sixteen tiles. Where a beam of rays (see
`realtime.beams`) misses the box of a node of the pyramid of heights, no ray of it meets the height field there: all of
the node that they pass is lit, or all is dark. Blocks walk the pyramid from its top down to squares of some leaves,
tiles from those of their block down to leaves, the last level, which a ray then looks at one by one. Lists have a fixed
length: a tile whose leaves do not fit takes larger ones, and the whole face if need be.

The walk needs no stack: the node after (i, j) at some level is its first child, or the next of its parent's four
children, or what follows the parent.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

from realtime.arrays import is_single
from realtime.beams import Beam, BeamPlanes, beam_planes, make_beam, may_meet
from realtime.light_heights import LightHeights, node_bounds
from realtime.shadow_map import face_products

TILE = 16  #: rays in a tile, and tiles in a block
COARSE = 1  #: levels above the leaves of what a block lists
_BLOCK_ROOM = 256  # entries of the list of a block and face
_TILE_ROOM = 96  # of a tile, for all faces together
_CORNERS = (0, 3, 12, 15)  # lanes of a square tile at its corners


@dataclass
class Leaves:
    """The leaves that concern each tile, face by face."""

    entries: Any  #: level, row and column of a node
    first: Any  #: by tile and face, the place of the first entry
    last: Any  #: the place behind the last one


@dataclass
class Node:
    """Squares of texels: those of level 0 are whole faces."""

    level: Any
    i: Any  #: column
    j: Any  #: row


def packed(node: Node):
    """Return a node as one number."""
    return (node.level << 26) | (node.j << 13) | node.i


def unpacked(entry) -> Node:
    """Return the node that `packed` made a number of."""
    return Node(entry >> 26, entry & 0x1FFF, (entry >> 13) & 0x1FFF)


def tile_leaves(heights: LightHeights, rays, distance, *, light, square: bool) -> Leaves:
    """Return the leaves that concern each tile.

    Parameters
    ----------
    heights
        The height field of a light.
    rays
        (lane) -> unit directions.
    distance
        At which every ray ends, infinite where it does not [m].
    light
        The light less the camera [m].
    square
        Whether every tile is a square of 4 x 4 pixels: then its corners bound it.
    """
    import drjit as dr
    import mitsuba as mi

    Float, Vector = type(distance), type(light)
    count = dr.width(distance)
    tiles = -(-count // TILE)
    blocks = -(-tiles // TILE)
    tile = dr.arange(mi.UInt32, tiles)
    lanes = [dr.minimum(tile * TILE + k, count - 1) for k in range(TILE)]
    directions = [rays(lanes[k]) for k in (_CORNERS if square else range(TILE))]
    ends = dr.gather(Float, distance, lanes[0])
    for lane in lanes[1:]:
        ends = dr.maximum(ends, dr.gather(Float, distance, lane))
    dr.eval(directions, ends)

    lane = dr.arange(mi.UInt32, blocks * heights.faces)
    block, face = lane // heights.faces, lane % heights.faces
    members = [dr.minimum(block * TILE + k, tiles - 1) for k in range(TILE)]
    about = [dr.gather(Vector, direction, member) for direction in directions for member in members]
    end = dr.gather(Float, ends, members[0])
    for member in members[1:]:
        end = dr.maximum(end, dr.gather(Float, ends, member))
    beam = make_beam(about, end, light, heights.axis)
    return _tile_lists(heights, make_beam(directions, ends, light, heights.axis), *_block_lists(heights, beam, face))


def _block_lists(heights: LightHeights, beam: Beam, face):
    """Return the nodes of level `finest - COARSE` that beams may meet, `_BLOCK_ROOM` places each, and how many."""
    import drjit as dr
    import mitsuba as mi

    lane = dr.arange(mi.UInt32, dr.width(face))
    entries = dr.empty(mi.UInt32, dr.width(face) * _BLOCK_ROOM)
    planes = beam_planes(beam, partial(face_products, heights.frame, face))
    write = _writer(entries, lane * _BLOCK_ROOM, _BLOCK_ROOM)
    level = mi.UInt32(max(0, heights.finest - COARSE))
    count = _descend(heights, planes, face, _root(), level, dr.zeros(mi.UInt32, dr.width(face)), write, True)
    dr.eval(entries, count)
    return entries, count


def _tile_lists(heights: LightHeights, beam: Beam, entries, found) -> Leaves:
    """Return the leaves that beams may meet, drawn from the lists of their blocks."""
    import drjit as dr
    import mitsuba as mi

    tiles = dr.width(beam.end)
    tile = dr.arange(mi.UInt32, tiles)
    faces = heights.faces
    leaves = dr.empty(mi.UInt32, tiles * _TILE_ROOM)
    first, last = dr.empty(mi.UInt32, tiles * faces), dr.empty(mi.UInt32, tiles * faces)

    def of_face(face, total):
        planes = beam_planes(beam, partial(face_products, heights.frame, face))
        source = (tile // TILE) * faces + face
        listed = dr.gather(mi.UInt32, found, source)
        whole = listed > _BLOCK_ROOM  # the block has no list
        listed = dr.select(whole, 1, listed)
        room = _TILE_ROOM - (faces - 1 - face)  # a place is left for every face to come
        write = _writer(leaves, tile * _TILE_ROOM, room)

        def of_entry(k, count, level):
            entry = dr.gather(mi.UInt32, entries, source * _BLOCK_ROOM + k, k < listed)
            start = unpacked(dr.select(whole, 0, entry))
            count = _descend(heights, planes, face, start, level, count, write, k < listed)
            # No room: again from the first entry, with leaves of twice the size.
            again = (k + 1 == listed) & (count > room) & (level > start.level)
            return dr.select(again, 0, k + 1), dr.select(again, total, count), dr.select(again, level - 1, level)

        _, count, _ = dr.while_loop(
            state=(dr.zeros(mi.UInt32, tiles), total + 0, dr.full(mi.UInt32, heights.finest, tiles)),
            cond=lambda k, count, level: k < listed,
            body=of_entry,
            labels=("k", "count", "level"),
        )
        full = count > room
        dr.scatter(leaves, packed(_root()), tile * _TILE_ROOM + total, full)
        count = dr.select(full, total + 1, count)
        dr.scatter(first, tile * _TILE_ROOM + total, tile * faces + face)
        dr.scatter(last, tile * _TILE_ROOM + count, tile * faces + face)
        return face + 1, count

    zero = dr.zeros(mi.UInt32, tiles)
    dr.while_loop(state=(zero, zero + 0), cond=lambda face, total: face < faces, body=of_face, labels=("face", "total"))
    dr.eval(leaves, first, last)
    return Leaves(leaves, first, last)


def _root() -> Node:
    import mitsuba as mi

    return Node(mi.UInt32(0), mi.UInt32(0), mi.UInt32(0))


def _writer(target, first, room):
    """Return the function that writes a node to its place in a list, if there is room."""
    import drjit as dr

    def write(node: Node, count, active):
        def store(entry, place):
            dr.scatter(target, entry, place)
            return entry

        # A branch: most steps of a walk write nothing, and a scatter costs much even so.
        args = (packed(node), first + count)
        dr.if_stmt(args=args, cond=active & (count < room), true_fn=store, false_fn=lambda entry, place: entry)

    return write


def _descend(heights: LightHeights, planes: BeamPlanes, face, start: Node, leaf, count, write, active):
    """Count and write the nodes of level `leaf` below a node that beams may meet."""
    import drjit as dr
    import mitsuba as mi

    def body(node: Node, count, going):
        met = going & _meets(heights, planes, face, node, going)
        at_leaf = met & (node.level == leaf)
        write(node, count, at_leaf)
        count += dr.select(at_leaf, mi.UInt32(1), 0)
        down = met & ~at_leaf
        # The last of four children, of which the parent is the last of four, and so on: back to the first that is not.
        back = dr.select(down, 0, dr.tzcnt(~(node.i & node.j)))
        level = node.level - back
        i, j = node.i >> back, node.j >> back
        going &= down | (level > start.level)
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
            Node(*(part + dr.zeros(mi.UInt32, width) for part in (start.level, start.i, start.j))),
            count,
            dr.full(mi.Bool, True, width) & active,
        ),
        cond=lambda node, count, going: going,
        body=body,
        labels=("node", "count", "going"),
    )
    return count


def _meets(heights: LightHeights, planes: BeamPlanes, face, node: Node, active):
    """Return whether a beam may meet the height field over a node."""
    import drjit as dr

    low, high = node_bounds(heights, face, node.level, node.i, node.j, active)
    half = _half(type(low), node.level)
    u = dr.fma(dr.fma(2.0, type(low)(node.i), 1.0), half, -1.0)
    v = dr.fma(dr.fma(2.0, type(low)(node.j), 1.0), half, -1.0)
    return may_meet(planes, (u, v), half, low, high)


def _half(Float, level):
    """Return half the side of a node, where a face goes from -1 to 1: 2^-level."""
    import drjit as dr
    import mitsuba as mi

    if is_single(Float):
        return dr.reinterpret_array(Float, (127 - level) << 23)
    return 1 / Float(mi.UInt32(1) << level)
