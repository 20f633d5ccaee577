# SPDX-License-Identifier: BSD-3-Clause
"""Which shadow planes can concern a tile of the image: lists of candidates (`realtime.tiles.candidate_lists`).

A plane stays on the list of a tile or block if some direction of its box could cross it
(`realtime.methods.shadow_planes.tile_boxes`). Blocks draw on the bins of azimuth, tiles on their block. Lists are
counted, their places added up, then written; one that has no room gives way to that which it would have been drawn on.
The planes of a tile are put in the order in which its middle ray crosses them, or in that of the paper.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.shadow_planes.plane_entries import BINS, FIRST, FULL, NUMBER, ROOM, Source, entry_at
from realtime.methods.shadow_planes.plane_table import PlaneIndex
from realtime.methods.shadow_planes.tile_boxes import Box, block_boxes, tile_boxes, touches
from realtime.numerics.array_types import four_numbers
from realtime.numerics.diamond_angle import TURN
from realtime.tiles.candidate_lists import over_lists
from realtime.tiles.layout import TILE

LEAST = 1 << 18  #: entries for all tiles, and for all blocks: tiles of small images see more


def tile_lists(index: PlaneIndex, rays, distance, *, order: str, square: bool) -> "Lists":
    """Return the lists of the tiles, each in order.

    Parameters
    ----------
    index
        The planes.
    rays, distance, square
        See `tile_boxes` [m].
    order
        See `listed`.
    """
    tiles = tile_boxes(index, rays, distance, square=square)
    dr.eval(tiles)
    blocks = block_boxes(tiles)
    dr.eval(blocks)
    room = max(LEAST, 4 * ROOM * dr.width(blocks.x))
    # Blocks are few and their bins long: as many lanes as a tile has share each, or most processors would idle.
    of_block = listed(index, blocks, index.entries, bin_source(index, blocks), room=room, lanes=TILE)
    dr.eval(of_block)
    block = dr.arange(mi.UInt32, dr.width(tiles.x)) // TILE
    source = dr.gather(Source, of_block.source, block)
    room = max(LEAST, ROOM * dr.width(tiles.x))
    of_tile = listed(index, tiles, of_block.entries, source, room=room, order=order)
    dr.eval(of_tile)
    return of_tile


def bin_source(index: PlaneIndex, box: Box) -> Source:
    """Return where the bins of a box's azimuths are."""
    everything = box.azimuth_half > TURN / 2
    low, high = box.azimuth - box.azimuth_half, box.azimuth + box.azimuth_half
    turned = dr.select(low < 0, TURN, 0)
    # The upper bound is one of whole numbers: what is no number would pass `dr.clip` and become 2^32 - 1.
    first, last = (mi.UInt32(dr.maximum((azimuth + turned) * (BINS / TURN), 0)) for azimuth in (low, high))
    begin = dr.select(everything, 0, dr.minimum(first, BINS - 1))
    end = dr.select(everything, BINS - 1, dr.minimum(last, 2 * BINS - 1))

    def start(number):
        return dr.gather(mi.UInt32, index.start, number)

    first = start(begin)
    return Source(first, start(end + 1) - first, start(begin + 1))


@dataclass
class Lists:
    """The planes that concern each box.

    An entry is marked `FULL` where every ray of the box crosses the plane.
    """

    entries: Any  #: what the sources read
    source: Source
    sorted: Any  #: whether a box has a list of its own, in the order that was asked for
    by_wedge = False  #: see `realtime.methods.shadow_planes.wedges.Wedges`

    def of_rays(self, tile, azimuth, way, ray_end) -> tuple[Source, Any]:
        """Return which entries the rays of tiles have to look at, and whether they are in order."""
        return dr.gather(Source, self.source, tile), dr.gather(mi.Bool, self.sorted, tile)


def listed(
    index: PlaneIndex, box: Box, entries, source: Source, *, room: int, order: str | None = None, lanes: int = 1
) -> Lists:
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
    lanes
        How many lanes share the work of a box; only without an order.
    """
    count = _visit(index, box, entries, source, None, lanes=lanes)
    dr.eval(count)
    # Keys are compared four at a time: lists that are put in order begin at every fourth place.
    offset = dr.prefix_sum(count if order is None else (count + 3) & 0xFFFFFFFC) + 0
    # Lists stand behind what they were drawn from, so that a box without one reads on from there in the same array.
    behind = dr.width(entries)
    pool = dr.empty(mi.UInt32, behind + room)
    dr.scatter(pool, entries, dr.arange(mi.UInt32, behind))
    first, end = _of_box(offset, lanes, 0), _of_box(offset + count, lanes, lanes - 1)
    fits = end <= room
    source_of_list = dr.select(fits, Source(first + behind, end - first, end + behind), source)
    dr.eval(pool, count, offset, source_of_list, fits)
    if order is None:
        has_room = dr.repeat(fits, lanes)

        def write(place, entry, key, active):
            dr.scatter(pool, entry, offset + place + behind, active & has_room)

        _visit(index, box, entries, source, write, lanes=lanes)
        dr.eval(pool)
        return Lists(pool, source_of_list, fits)

    fours = (room + 3) // 4
    unsorted = _Unsorted(dr.empty(mi.UInt32, room), dr.empty(type(box.x), 4 * fours), dr.empty(mi.UInt32, fours))
    dr.eval(unsorted)

    def write_unsorted(place, entry, key, active):
        active &= fits
        if order == "paper":
            key = -dr.gather(type(box.x), index.spans, (entry & NUMBER) * 4 + 3, active)
        dr.scatter(unsorted.entry, entry, offset + place, active)
        dr.scatter(unsorted.key, key, offset + place, active)
        dr.scatter(unsorted.owner, dr.arange(mi.UInt32, dr.width(box.x)), (offset + place) >> 2, active)

    _visit(index, box, entries, source, write_unsorted)
    dr.eval(unsorted)
    _write_sorted(pool, unsorted, source_of_list, behind, dr.max(dr.select(fits, offset + count, 0)))
    return Lists(pool, source_of_list, fits)


@dataclass
class _Unsorted:
    """Entries of lists that are not in order yet, list after list."""

    entry: Any
    key: Any  #: larger first
    owner: Any  #: of every fourth place, the box whose list it belongs to


def _of_box(values, lanes: int, number: int):
    """Return for every box the value of one of the lanes that share it."""
    if lanes == 1:
        return values
    return dr.gather(type(values), values, dr.arange(mi.UInt32, dr.width(values) // lanes) * lanes + number)


def _visit(index: PlaneIndex, box: Box, entries, source: Source, write, *, lanes: int = 1):
    """Count, and write if wanted, the planes of a source that touch the boxes; by lane, if several share a box."""
    width = dr.width(box.x) * lanes
    if lanes > 1:
        # Each takes a run of the places, in their order: the list is the same as one lane would write.
        lane = dr.arange(mi.UInt32, width)
        box, source = dr.gather(Box, box, lane // lanes), dr.gather(Source, source, lane // lanes)
        run = (source.count + lanes - 1) // lanes
        begin = dr.minimum(lane % lanes * run, source.count)
        source = Source(source.first + begin, dr.minimum(run, source.count - begin), source.all_before)

    def look(k, drawn):
        entry, counts = entry_at(entries, source, k, dr.full(mi.Bool, True, width))
        hit, full, quotient = touches(index, box, entry, counts)
        if write is not None:
            marked = (entry & (FULL - 1)) | FIRST | dr.select(full, mi.UInt32(FULL), 0)
            write(drawn, marked, quotient, hit)
        return drawn + dr.select(hit, mi.UInt32(1), mi.UInt32(0))

    return over_lists(source.count, look, dr.zeros(mi.UInt32, width))


def _write_sorted(pool, unsorted: _Unsorted, source: Source, behind: int, total) -> None:
    """Write every list in order: the rank of an entry is the number of entries of its list that come before it."""
    Four = four_numbers(type(unsorted.key))

    def placed(place):
        box = dr.gather(mi.UInt32, unsorted.owner, place >> 2)
        first = dr.gather(mi.UInt32, source.first, box) - behind
        count = dr.gather(mi.UInt32, source.count, box)
        own = dr.gather(type(unsorted.key), unsorted.key, place)

        def body(k, rank):
            four = dr.gather(Four, unsorted.key, (first + k) >> 2)
            for step, other in enumerate(four):
                before = (other > own) | ((other == own) & (first + (k + step) < place))
                rank += dr.select(before & (k + step < count), mi.UInt32(1), mi.UInt32(0))
            return k + 4, rank

        _, rank = dr.while_loop(
            state=(dr.zeros(mi.UInt32, dr.width(place)), dr.zeros(mi.UInt32, dr.width(place))),
            cond=lambda k, rank: k < count,
            body=body,
            labels=("k", "rank"),
        )
        dr.scatter(pool, dr.gather(mi.UInt32, unsorted.entry, place), first + rank + behind, place < first + count)
        return place

    place = dr.arange(mi.UInt32, dr.width(unsorted.entry))
    # Most places are empty: a branch skips them without reading.
    dr.if_stmt(args=(place,), cond=place < total, true_fn=placed, false_fn=lambda place: place)
    dr.eval(pool)
