# SPDX-License-Identifier: BSD-3-Clause
"""Which shadow planes can concern a tile of the image: short lists, so that a ray reads what it crosses and little
else.

A tile is sixteen rays that follow one another (4 x 4 pixels), a block sixteen tiles. Each has a box about the
directions of its rays in the frame of the light, and the least quotient 1/x at which one of them ends. What decides
whether a ray crosses a plane, D/x = A wx + B wy - wz and its like (`realtime.plane_index`), is linear in the direction,
so its largest value over the box is the value at the centre plus |A| ex + |B| ey + ez. A plane stays on the list if
some direction of the box could cross it; whether a ray does, the ray finds out.

Blocks draw on the bins of azimuth, tiles on their block. Lists are counted, their places added up, then written; where
the room for all of them is used up, a block or tile keeps the longer list that it drew on. The planes of a tile are put
in the order in which its middle ray crosses them, or in that of the paper.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

from realtime.arrays import four_numbers, two_numbers
from realtime.diamond import diamond_angle
from realtime.plane_index import BINS, FIRST, FULL, NUMBER, TURN, PlaneIndex

TILE = 16  #: rays in a tile, and tiles in a block
SIDE = 4  #: of a tile [pixels], where it is a square
ROOM = 32  #: entries for each tile and, fourfold, for each block, on average

_SLACK = 1e-5  # of the terms of a sum: float32 rounding, with room to spare


@dataclass
class Box:
    """Boxes about directions, in the frame of the light."""

    x: Any  #: centre
    y: Any
    z: Any
    x_half: Any  #: half the width
    y_half: Any
    z_half: Any
    ray_end: Any  #: least D/x at which a ray ends
    azimuth: Any  #: of the centre, diamond angle
    azimuth_half: Any


@dataclass
class Source:
    """Where to read entries: a run of places."""

    first: Any
    count: Any
    all_before: Any  #: places below this one count even where the entry is not the first of its plane


def entry_at(entries, source: Source, k, active):
    """Return the k-th entry of a source and whether it counts there."""
    import drjit as dr
    import mitsuba as mi

    place = source.first + k
    active = active & (k < source.count)
    entry = dr.gather(mi.UInt32, entries, place, active)
    return entry, active & (((entry & FIRST) != 0) | (place < source.all_before))


def tile_lists(index: PlaneIndex, rays, distance, *, order: str, square: bool) -> "Lists":
    """Return the lists of the tiles, each in order.

    Parameters
    ----------
    index
        The planes.
    rays, distance, square
        See `tile_boxes`.
    order
        See `listed`.
    """
    import drjit as dr
    import mitsuba as mi

    tiles = tile_boxes(index, rays, distance, square=square)
    dr.eval(tiles)
    blocks = block_boxes(tiles)
    dr.eval(blocks)
    room = 4 * ROOM * dr.width(blocks.x)
    of_block = listed(index, blocks, index.entries, bin_source(index, blocks), room=room)
    dr.eval(of_block)
    block = dr.arange(mi.UInt32, dr.width(tiles.x)) // TILE
    source = dr.gather(Source, of_block.source, block)
    of_tile = listed(index, tiles, of_block.entries, source, room=ROOM * dr.width(tiles.x), order=order)
    dr.eval(of_tile)
    return of_tile


def tile_boxes(index: PlaneIndex, rays: Callable[[Any], tuple[Any, Any, Any]], distance, *, square: bool) -> Box:
    """Return the boxes of the tiles.

    Parameters
    ----------
    index
        The planes, for the frame of the light.
    rays
        (lane) -> direction in that frame, three arrays.
    distance
        At which every ray ends [m].
    square
        Whether every tile is a square of 4 x 4 pixels: then its corners bound it, but for the curvature of the sphere
        of directions, a share of 2e-6 that the slack of `touches` covers.
    """
    import drjit as dr
    import mitsuba as mi

    count = dr.width(distance)
    tiles = -(-count // TILE)
    tile = dr.arange(mi.UInt32, tiles)

    def lane(k):
        # Beyond the last ray: the first of the tile again.
        lane = tile * TILE + k
        return dr.select(lane < count, lane, tile * TILE)

    corners = (0, SIDE - 1, TILE - SIDE, TILE - 1) if square else range(TILE)
    directions = [rays(lane(k)) for k in corners]
    ends = [dr.gather(type(distance), distance, lane(k)) for k in range(TILE)]
    low = [reduce(dr.minimum, [w[axis] for w in directions]) for axis in range(3)]
    high = [reduce(dr.maximum, [w[axis] for w in directions]) for axis in range(3)]
    return _box(low, high, index.distance / reduce(dr.maximum, ends))


def block_boxes(tile: Box) -> Box:
    """Return the boxes of the blocks of tiles."""
    import drjit as dr
    import mitsuba as mi

    count = dr.width(tile.x)
    block = dr.arange(mi.UInt32, -(-count // TILE))

    def bounds(k):
        number = block * TILE + k
        number = dr.select(number < count, number, block * TILE)
        box = dr.gather(Box, tile, number)
        centre, half = (box.x, box.y, box.z), (box.x_half, box.y_half, box.z_half)
        low, high = [c - h for c, h in zip(centre, half)], [c + h for c, h in zip(centre, half)]
        return low, high, box.ray_end

    members = [bounds(k) for k in range(TILE)]
    low = [reduce(dr.minimum, [member[0][axis] for member in members]) for axis in range(3)]
    high = [reduce(dr.maximum, [member[1][axis] for member in members]) for axis in range(3)]
    return _box(low, high, reduce(dr.minimum, [member[2] for member in members]))


def _box(low, high, ray_end) -> Box:
    """Return the box between two corners."""
    x, y, z = (0.5 * (a + b) for a, b in zip(low, high))
    x_half, y_half, z_half = (0.5 * (b - a) for a, b in zip(low, high))
    azimuth, azimuth_half = _azimuths((x, y), (x_half, y_half))
    return Box(x, y, z, x_half, y_half, z_half, ray_end, azimuth, azimuth_half)


def _azimuths(centre, half):
    """Return the azimuth of the centres and how far the corners are from it; a full turn where that is unclear."""
    import drjit as dr

    (x, y), (x_half, y_half) = centre, half
    azimuth = diamond_angle(x, y)
    widest = type(x)(0)
    for side_x in (-1, 1):
        for side_y in (-1, 1):
            turn = diamond_angle(x + side_x * x_half, y + side_y * y_half) - azimuth
            turn = dr.abs(turn)
            widest = dr.maximum(widest, dr.minimum(turn, TURN - turn))
    holds_axis = (dr.abs(x) <= x_half) & (dr.abs(y) <= y_half)
    return azimuth, dr.select(holds_axis | (widest > 1), TURN, widest + 1e-6)


def touches(index: PlaneIndex, box: Box, entry, active):
    """Return whether a ray of the box could cross a plane, whether all that reach it do, and D/x at the centre."""
    import drjit as dr

    Float = type(box.x)
    number = entry & NUMBER
    a, b, p, q = dr.gather(four_numbers(Float), index.lines, number, active)
    first, last = dr.gather(two_numbers(Float), index.spans, 2 * number, active)
    quotient = dr.fma(a, box.x, dr.fma(b, box.y, -box.z))
    reach = dr.fma(dr.abs(a), box.x_half, dr.fma(dr.abs(b), box.y_half, box.z_half))
    reach += _SLACK * (dr.abs(a * box.x) + dr.abs(b * box.y) + 1)
    pd, qd = p * index.distance, q * index.distance
    margin = dr.fma(pd, box.x, qd * box.y) - quotient
    margin_reach = dr.fma(dr.abs(pd - a), box.x_half, dr.fma(dr.abs(qd - b), box.y_half, box.z_half))
    margin_reach += _SLACK * (dr.abs(a * box.x) + dr.abs(b * box.y) + dr.abs(pd * box.x) + dr.abs(qd * box.y) + 1)
    low, high = box.azimuth - box.azimuth_half, box.azimuth + box.azimuth_half
    overlaps = (first <= high) & (last >= low)
    overlaps |= (first <= high - TURN) & (last >= low - TURN)
    overlaps |= (first <= high + TURN) & (last >= low + TURN)
    largest = quotient + reach
    could = (largest > 0) & (largest >= box.ray_end) & (margin + margin_reach > 0)
    full = (quotient > reach) & (margin > margin_reach) & (first <= low) & (high < last) & (low >= 0) & (high < TURN)
    return active & overlaps & could, full, quotient


def bin_source(index: PlaneIndex, box: Box) -> Source:
    """Return where the bins of a box's azimuths are."""
    import drjit as dr
    import mitsuba as mi

    everything = box.azimuth_half > TURN / 2
    low, high = box.azimuth - box.azimuth_half, box.azimuth + box.azimuth_half
    turned = dr.select(low < 0, TURN, 0)
    begin = dr.select(everything, 0, mi.UInt32(dr.clip((low + turned) * (BINS / TURN), 0, BINS - 1)))
    end = dr.select(everything, BINS - 1, mi.UInt32(dr.clip((high + turned) * (BINS / TURN), 0, 2 * BINS - 1)))

    def start(number):
        return dr.gather(mi.UInt32, index.start, number)

    first = start(begin)
    return Source(first, start(end + 1) - first, start(begin + 1))


@dataclass
class Lists:
    """The planes that concern each box."""

    entries: Any  #: what the sources read
    source: Source
    sorted: Any  #: whether a box has a list of its own, in the order that was asked for


def listed(index: PlaneIndex, box: Box, entries, source: Source, *, room: int, order: str | None = None) -> Lists:
    """Return the lists of boxes, drawn from longer ones.

    Parameters
    ----------
    index
        The planes.
    box
        The boxes.
    entries, source
        Where each box finds the planes that may concern it.
    room
        Entries to make room for, for all boxes together.
    order
        'paper': towards the camera by the cosine of the middle of the edge; 'exact' and 'none': as the middle ray
        crosses them; None: not sorted.
    """
    import drjit as dr
    import mitsuba as mi

    count = _visit(index, box, entries, source, None)
    offset = dr.prefix_sum(count) + 0
    fits = offset + count <= room
    # Lists stand behind what they were drawn from, so that a box without one reads on from there in the same array.
    behind = dr.width(entries)
    pool = dr.empty(mi.UInt32, behind + room)
    dr.scatter(pool, entries, dr.arange(mi.UInt32, behind))
    found = Source(
        dr.select(fits, offset + behind, source.first),
        dr.select(fits, count, source.count),
        dr.select(fits, offset + count + behind, source.all_before),
    )
    dr.eval(pool, count, offset, found)
    if order is None:

        def write(place, entry, key, active):
            dr.scatter(pool, entry, offset + place + behind, active & fits)

        _visit(index, box, entries, source, write)
        dr.eval(pool)
        return Lists(pool, found, fits)

    unsorted = _Unsorted(dr.empty(mi.UInt32, room), dr.empty(type(box.x), room), dr.empty(mi.UInt32, room))
    dr.eval(unsorted)

    def write_unsorted(place, entry, key, active):
        active &= fits
        if order == "paper":
            key = -dr.gather(type(box.x), index.spans, (entry & NUMBER) * 4 + 3, active)
        dr.scatter(unsorted.entry, entry, offset + place, active)
        dr.scatter(unsorted.key, key, offset + place, active)
        dr.scatter(unsorted.owner, dr.arange(mi.UInt32, dr.width(box.x)), offset + place, active)

    _visit(index, box, entries, source, write_unsorted)
    dr.eval(unsorted)
    _write_sorted(pool, unsorted, found, behind, dr.sum(dr.select(fits, count, 0)))
    return Lists(pool, found, fits)


@dataclass
class _Unsorted:
    """Entries of lists that are not in order yet, list after list."""

    entry: Any
    key: Any  #: larger first
    owner: Any  #: the box whose list it belongs to


def _visit(index: PlaneIndex, box: Box, entries, source: Source, write):
    """Count, and write if wanted, the planes of a source that touch the boxes."""
    import drjit as dr
    import mitsuba as mi

    width = dr.width(box.x)

    def body(k, found):
        entry, counts = entry_at(entries, source, k, dr.full(mi.Bool, True, width))
        hit, full, quotient = touches(index, box, entry, counts)
        if write is not None:
            marked = (entry & (FULL - 1)) | FIRST | dr.select(full, mi.UInt32(FULL), 0)
            write(found, marked, quotient, hit)
        return k + 1, found + dr.select(hit, mi.UInt32(1), mi.UInt32(0))

    _, found = dr.while_loop(
        state=(dr.zeros(mi.UInt32, width), dr.zeros(mi.UInt32, width)),
        cond=lambda k, found: k < source.count,
        body=body,
        labels=("k", "found"),
    )
    return found


def _write_sorted(pool, unsorted: _Unsorted, source: Source, behind: int, total) -> None:
    """Write every list in order: the rank of an entry is the number of entries of its list that come before it."""
    import drjit as dr
    import mitsuba as mi

    def placed(place):
        box = dr.gather(mi.UInt32, unsorted.owner, place)
        first = dr.gather(mi.UInt32, source.first, box) - behind
        count = dr.gather(mi.UInt32, source.count, box)
        own = dr.gather(type(unsorted.key), unsorted.key, place)

        def body(k, rank):
            other = dr.gather(type(own), unsorted.key, first + k)
            before = (other > own) | ((other == own) & (first + k < place))
            return k + 1, rank + dr.select(before, mi.UInt32(1), mi.UInt32(0))

        _, rank = dr.while_loop(
            state=(dr.zeros(mi.UInt32, dr.width(place)), dr.zeros(mi.UInt32, dr.width(place))),
            cond=lambda k, rank: k < count,
            body=body,
            labels=("k", "rank"),
        )
        dr.scatter(pool, dr.gather(mi.UInt32, unsorted.entry, place), first + rank + behind)
        return place

    place = dr.arange(mi.UInt32, dr.width(unsorted.entry))
    # Most of the room is empty: a branch steps over it without reading.
    dr.if_stmt(args=(place,), cond=place < total, true_fn=placed, false_fn=lambda place: place)
    dr.eval(pool)
