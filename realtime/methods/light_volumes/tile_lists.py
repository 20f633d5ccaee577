# SPDX-License-Identifier: BSD-3-Clause
"""Which texels of a shadow map concern a tile of the image: lists of candidates (`realtime.tiles.candidate_lists`).

Where a beam of rays (see `realtime.methods.light_volumes.tile_beams`) misses the box of a node of the pyramid of
heights, no ray of it meets the height field there: all of the node that they pass is lit, or all is dark. Blocks walk
the pyramid from its top down to leaves, the last level, and tiles choose from those of their block. Of a leaf they list
only the texels that the beam passes, and of those below or above the gap in the leaf's heights (see
`realtime.shadow_maps.inverse_depth_field`) only what it may meet. Lists have a fixed length: a tile whose leaves have
no room, or whose block has none, takes nodes of twice the size, without telling texels apart, and the whole face if
need be.
"""

from dataclasses import dataclass
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.light_volumes.cube_faces import faces_in_order, faces_passed
from realtime.methods.light_volumes.pyramid import Box, Node, descend, meets, packed, unpacked
from realtime.methods.light_volumes.ray_lines import face_ray, in_face
from realtime.methods.light_volumes.texel_lines import line_of
from realtime.methods.light_volumes.tile_beams import Beam, BeamPlanes, beam_planes, make_beam, may_meet, parts_within
from realtime.shadow_maps.inverse_depth_field import InverseDepthField, leaf_sides
from realtime.tiles.candidate_lists import bounding, farthest, members, over_lists
from realtime.tiles.layout import TILE

CHUNK = 4  #: leaves that a ray looks at together
LARGER = 1 << 31  #: added to the first place of a list of nodes that are no leaves
LIT = 1 << 30  #: added to that of an empty list where all is lit that the tile's rays pass of the face
_BLOCK_ROOM = 256  # entries of the list of a block and face
_TILE_ROOM = 96  # of a tile, for all faces together


@dataclass
class Leaves:
    """The leaves that concern each tile, face by face."""

    entries: Any  #: level, row and column of a node
    texels: Any  #: of a leaf, bit 4 row + column of each texel that the tile's rays may cross
    first: Any  #: by tile and face, the place of the first entry
    last: Any  #: the place behind the last one
    faces: Any  #: by tile, the faces that its rays may pass, see `faces_in_order`; `first`, `last` are of these alone


def tile_leaves(heights: InverseDepthField, rays, distance, *, light, square: bool) -> Leaves:
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
    lanes = members(dr.width(distance))
    directions = [rays(lane) for lane in bounding(lanes, square=square)]
    ends = farthest(distance, lanes)
    dr.eval(directions, ends)

    tiles = dr.width(ends)
    blocks = -(-tiles // TILE)
    lane = dr.arange(mi.UInt32, blocks * heights.faces)
    face, block = lane // blocks, lane % blocks  # neighbours look at one face
    of_block = [dr.minimum(block * TILE + k, tiles - 1) for k in range(TILE)]
    about = [dr.gather(type(light), direction, tile) for direction in directions for tile in of_block]
    axis = heights.projection.parallel_axis
    lists = _block_lists(heights, make_beam(about, farthest(ends, of_block), light, axis), face)
    beam = make_beam(directions, ends, light, axis)
    faces = mi.UInt32(1) if heights.faces == 1 else faces_passed(directions, beam.middle, ends, -light)
    return _tile_lists(heights, beam, faces, *lists)


def _block_lists(heights: InverseDepthField, beam: Beam, face):
    """Return the leaves that beams may meet, `_BLOCK_ROOM` places each, and how many; more than these are not there."""
    lane = dr.arange(mi.UInt32, dr.width(face))
    entries = dr.empty(mi.UInt32, dr.width(face) * _BLOCK_ROOM)
    planes = beam_planes(beam, partial(heights.projection.products, face))
    write = _writer(entries, lane * _BLOCK_ROOM, _BLOCK_ROOM)
    zero = dr.zeros(mi.UInt32, dr.width(face))
    count = descend(heights, planes, face, mi.UInt32(heights.finest), zero, write, True)
    dr.eval(entries, count)
    return entries, count


def _tile_lists(heights: InverseDepthField, beam: Beam, passed, entries, of_block) -> Leaves:
    """Return the leaves that beams may meet, drawn from the lists of their blocks, and which of their texels."""
    tiles = dr.width(beam.end)
    tile = dr.arange(mi.UInt32, tiles)
    faces = heights.faces
    blocks = dr.width(of_block) // faces
    leaves, texels = (dr.empty(mi.UInt32, tiles * _TILE_ROOM + CHUNK) for _ in range(2))
    first, last = dr.empty(mi.UInt32, tiles * faces), dr.empty(mi.UInt32, tiles * faces)

    def of_face(to_come, total):
        face = mi.UInt32(dr.tzcnt(to_come))
        planes = beam_planes(beam, partial(heights.projection.products, face))
        room = _TILE_ROOM - (faces - 1 - face)  # a place is left for every face to come
        write = _leaf_writer(heights, planes, face, (leaves, texels), tile * _TILE_ROOM, room)
        source = face * blocks + tile // TILE
        listed = dr.gather(mi.UInt32, of_block, source)
        whole = listed > _BLOCK_ROOM  # the block has no list
        listed = dr.select(whole, 0, listed)

        def look(k, count):
            node = unpacked(dr.gather(mi.UInt32, entries, source * _BLOCK_ROOM + k))
            met, box = meets(heights, planes, face, node, k < listed)
            return write(node, box, count, met)

        count = over_lists(listed, look, total + 0)

        def of_level(level, count, again):
            count = dr.select(again, total, count)
            count = descend(heights, planes, face, level, count, write, again)
            again &= (count > room) & (level > 0)
            return dr.select(again, level - 1, level), count, again

        # Tiles without a list or room walk down from the top, to leaves of twice the size or more.
        full = count > room
        level = dr.select(full, mi.UInt32(max(0, heights.finest - 1)), heights.finest)
        level, count, _ = dr.while_loop(
            state=(level, count, full | whole),
            cond=lambda level, count, again: again,
            body=of_level,
            labels=("level", "count", "again"),
        )
        marks = dr.select(level < heights.finest, mi.UInt32(LARGER), 0)
        marks |= dr.select(_is_lit(heights, face, beam, count == total), mi.UInt32(LIT), 0)
        dr.scatter(first, (tile * _TILE_ROOM + total) | marks, tile * faces + face)
        dr.scatter(last, tile * _TILE_ROOM + count, tile * faces + face)
        return to_come & (to_come - 1), count

    passed = passed + dr.zeros(mi.UInt32, tiles)
    dr.while_loop(
        state=(passed + 0, dr.zeros(mi.UInt32, tiles)),
        cond=lambda to_come, total: to_come != 0,
        body=of_face,
        labels=("to_come", "total"),
    )
    if faces > 1:
        segment = type(beam.end)(0), beam.end
        begins = [in_face(heights, mi.UInt32(face), -beam.light, beam.middle, segment) for face in range(faces)]
        passed = faces_in_order(passed, [dr.select(begin < end, begin, dr.inf) for begin, end in begins])
    dr.eval(leaves, texels, first, last, passed)
    return Leaves(leaves, texels, first, last, passed)


def _is_lit(heights: InverseDepthField, face, beam: Beam, active):
    """Return whether all of a face is lit that beams pass which meet nothing there: whether their middle rays are."""

    def looked_up(middle, end):
        begin, end = in_face(heights, face, -beam.light, middle, (type(end)(0), end))
        ray = face_ray(heights, face, -beam.light, middle, (begin, end))
        return (begin < end) & (~ray.walks | (line_of(heights, face, ray).excess[0] > 0))

    return dr.if_stmt(
        args=(beam.middle, beam.end),
        cond=active,
        true_fn=looked_up,
        false_fn=lambda middle, end: dr.mask_t(end)(False),
    )


def _writer(target, first, room):
    """Return the function that writes a node to its place in a list, if there is room, and counts it."""

    def write(node: Node, box: Box, count, active):
        def store(entry, place):
            dr.scatter(target, entry, place)
            return entry

        # Branch: most steps of a walk write nothing, and a masked scatter still costs much.
        args = packed(node), first + count
        dr.if_stmt(args=args, cond=active & (count < room), true_fn=store, false_fn=lambda entry, place: entry)
        return dr.select(active, count + 1, count)

    return write


def _leaf_writer(heights: InverseDepthField, planes: BeamPlanes, face, targets, first, room):
    """Return the function that writes a leaf, if any of its texels matters and there is room, and counts it."""

    def write(node: Node, box: Box, count, active):
        def store(node, box, count):
            texels = _texels_met(heights, planes, face, node, box)
            some = texels != 0
            for target, value in zip(targets, (packed(node), texels)):
                dr.scatter(target, value, first + count, some & (count < room))
            return dr.select(some, count + 1, count)

        return dr.if_stmt(args=(node, box, count), cond=active, true_fn=store, false_fn=lambda node, box, count: count)

    return write


def _texels_met(heights: InverseDepthField, planes: BeamPlanes, face, node: Node, box: Box):
    """Return bit 4 row + column of each texel of a leaf that the beam may meet; 1 for larger nodes."""
    fine = node.level == heights.finest
    leaf = leaf_sides(heights, face, node.i, node.j, fine)
    met = leaf.both
    met |= dr.select(may_meet(planes, box.values, box.low, leaf.below), leaf.low, 0)
    met |= dr.select(may_meet(planes, box.values, leaf.above, box.high), ~(leaf.low | leaf.both), 0)
    met &= parts_within(planes, box.values, 2.0**-heights.finest, box.low, box.high)
    return dr.select(fine, met, 1)
