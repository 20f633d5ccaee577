# SPDX-License-Identifier: BSD-3-Clause
"""Which planes of a body concern the rays of a tile of 4 x 4 pixels.

What `realtime.clipping` asks of a plane, g . v, is linear in v. If one plane is below another at all corners of a
convex set of v, it is so within, and the other never is the least there. The set is a tile's rays, or the legs from a
light to the part of them that lies in the body's ball, cut into ranges by slices across the tile: its corners are those
of the tile at the ends of a range. The planes that are least in the middle of the slices sort out most of the others.
For the way out, signs are turned.
"""

from dataclasses import dataclass
from typing import Any

from realtime.arrays import four_numbers

TILE = 16  #: rays of a tile, which follow one another
_CORNERS = (0, 3, 12, 15)  # lanes of a tile at its corners
_ROOM = 48  # planes in a list; a tile that needs more reads them all
_BEYOND = 1e-4  # rays between the corners are longer than the corners' hull by less


@dataclass(frozen=True)
class PlaneLists:
    """The planes of every tile, by ray."""

    first: Any  #: place of the first entry
    count: Any  #: entries
    whole: Any  #: all planes count, in their own order
    entries: Any  #: numbers of planes


def tile_corners(rays, width: int):
    """Return the directions at the corners of all tiles; `rays` is that of `realtime.view.View`."""
    import drjit as dr
    import mitsuba as mi

    first = dr.arange(mi.UInt32, width // TILE) * TILE
    return [rays(first + lane)[0] for lane in _CORNERS]


def ball_range(seen, corners):
    """Return by tile the distances between which its rays may be in the body's ball, and whether any is."""
    import drjit as dr

    middle = dr.normalize(corners[0] + corners[1] + corners[2] + corners[3])
    along = dr.dot(seen.toward, middle)
    spread = dr.norm(corners[0] - middle)
    for corner in corners[1:]:
        spread = dr.maximum(spread, dr.norm(corner - middle))
    reach = seen.body.radius * (1 + _BEYOND)
    off = dr.norm(seen.toward - middle * along) - 1.01 * spread * (dr.norm(seen.toward) + reach)
    half = dr.sqrt(dr.maximum(dr.square(reach) - dr.square(dr.maximum(off, 0)), 0)) + spread * reach
    return dr.maximum(along - half - spread * dr.abs(along), 0), along + half + spread * dr.abs(along), off < reach


def plane_lists(seen, slices, active, *, leaves: bool = True) -> PlaneLists:
    """Return the planes that concern each tile.

    Parameters
    ----------
    seen
        A body with planes, as the point sees it where the vectors start.
    slices
        Lists of vectors, by tile, to the corners of slices across the tile; the ranges are between them.
    active
        Tiles to look at; the others get no planes.
    leaves
        Whether the way out is wanted.
    """
    import drjit as dr
    import mitsuba as mi

    tiles = dr.width(active)
    entries = dr.zeros(mi.UInt32, tiles * _ROOM)
    start = dr.arange(mi.UInt32, tiles) * _ROOM
    rivals = [(side, _values(seen, slices, number)) for side, number in _least_planes(seen, slices, active, leaves)]

    def append(number, count):
        dr.scatter(entries, number, start + count, count < _ROOM)
        return count + 1

    def plane(number, count):
        side, values = _signed(seen, slices, number, active)
        needed = dr.mask_t(side)(False)
        for first, last in _ranges(len(slices)):
            of_range = dr.mask_t(side)(True)
            for of_side, others in rivals:
                below = side == of_side
                for k in (first, last):
                    for value, other in zip(values[k], others[k]):
                        below &= other < value
                of_range &= ~below
            needed |= of_range
        needed &= (side > 0) | leaves
        count = dr.if_stmt(
            args=(number, count),
            cond=needed & active,
            true_fn=append,
            false_fn=lambda number, count: count,
        )
        return number + 1, count

    _, count = dr.while_loop(
        state=(mi.UInt32(0), dr.zeros(mi.UInt32, tiles)),
        cond=lambda number, count: active & (number < seen.body.count),
        body=plane,
        labels=("number", "count"),
    )
    dr.eval(entries, count)
    count = dr.gather(mi.UInt32, count, dr.arange(mi.UInt32, tiles * TILE) // TILE)
    whole = count > _ROOM
    first = dr.arange(mi.UInt32, tiles * TILE) // TILE * _ROOM
    return PlaneLists(first, dr.select(whole, seen.body.count, count), whole, entries)


def plane_number(lists: PlaneLists | None, number, active):
    """Return which plane is the next to read."""
    import drjit as dr
    import mitsuba as mi

    if lists is None:
        return number
    listed = dr.gather(mi.UInt32, lists.entries, lists.first + number, active & ~lists.whole)
    return dr.select(lists.whole, number, listed)


def _ranges(slices: int):
    """Return the numbers of the slices at the ends of each range; one slice is a range of its own."""
    return [(k, k + 1) for k in range(slices - 1)] or [(0, 0)]


def _signed(seen, slices, number, active):
    """Return the side of a plane, 1 outside and -1 inside, and by slice g . v times that: the least counts."""
    import drjit as dr

    values = dr.gather(four_numbers(type(seen.planes)), seen.planes, number, active)
    side = dr.select(values.w > 0, type(values.w)(1), -1)
    g = values.xyz * side
    return side, [[dr.dot(g, corner) for corner in corners] for corners in slices]


def _values(seen, slices, number):
    """Return the values of a plane a tile, infinite where there is none."""
    import drjit as dr

    there = number < seen.body.count
    _, values = _signed(seen, slices, number, there)
    return [[dr.select(there, value, dr.inf) for value in corners] for corners in values]


def _least_planes(seen, slices, active, leaves: bool):
    """Return (side, number) of the planes that are least in the middle of each slice."""
    import drjit as dr
    import mitsuba as mi

    middles = [[sum(corners) * (1 / len(corners))] for corners in slices]
    Float, width, sides = type(slices[0][0].x), dr.width(active), (1, -1) if leaves else (1,)
    least = [dr.full(Float, dr.inf, width) for _ in sides for _ in slices]
    which = [dr.full(mi.UInt32, seen.body.count, width) for _ in least]

    def plane(number, least, which):
        side, values = _signed(seen, middles, number, active)
        found = [(side == wanted, value) for wanted in sides for (value,) in values]
        less = [of_side & (value < best) for (of_side, value), best in zip(found, least)]
        which = [dr.select(yes, number, before) for yes, before in zip(less, which)]
        least = [dr.select(yes, value, best) for yes, (_, value), best in zip(less, found, least)]
        return number + 1, least, which

    _, _, which = dr.while_loop(
        state=(mi.UInt32(0), least, which),
        cond=lambda number, least, which: active & (number < seen.body.count),
        body=plane,
        labels=("number", "least", "which"),
    )
    return list(zip([side for side in sides for _ in slices], which))
