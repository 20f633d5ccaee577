# SPDX-License-Identifier: BSD-3-Clause
"""Where legs from a light enter a polyhedral medium on their way to the points of a ray within it.

Of the planes that the light is outside of, the leg to the point v(x) = v_0 + x d from the light enters through the one
with the least

    u_k(x) = g_k . v(x) = c_k + s_k x

(`realtime.bounded_media.convex_clip`), a line along the ray. The least of lines is concave, with *bends* where the leg
passes from one facet to the next, which shares an edge with it. So from the plane k the next bend is the first of

    (c_j - c_k)/(s_k - s_j)

over the few neighbours j with s_j < s_k. Every bend makes s less: a walk along the ray never goes round in circles.

The first plane is found in the same way: while a neighbour has a less u at the start, go to the least. Seen from the
light the facets tile the convex image of the medium, and v(x) lies in it. On the straight way from a point of the facet
k to v(x) the neighbour beyond the edge where k is left has a less u from there on, since the difference is linear:
where no neighbour has less, none of all planes has.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.bounded_media.convex_clip import Seen
from realtime.numerics.array_types import four_numbers, packed

_CELLS = 8  # of the image of a medium along a side, for planes to begin at
_UNROLLED = 4  # neighbours, as many as facets of boxes have


@dataclass(frozen=True)
class EntryPlanes:
    """The planes that a light is outside of, each with its neighbours among them."""

    sides: int  #: neighbours of a plane
    count: int  #: planes
    side: int  #: 1 for planes where legs enter, -1 for those where they leave
    frame: tuple[Any, Any, Any]  #: axes of the image of the medium: across, up, and towards its middle
    starts: Any  #: by cell of that image the number of a plane to begin at, `count` where there is none
    within: Any  #: whether the light is in the medium: it is outside of no plane
    planes: Any  #: of `Seen`
    entries: Any  #: four numbers a neighbour: its g [1/m] and its number; where there is none those of the plane itself
    across: Any  #: four numbers a neighbour on the other side of the medium: its g [1/m]; 0 where there is none


@dataclass
class Entry:
    """The plane through which a leg enters: 1/f = constant + slope x."""

    number: Any
    constant: Any
    slope: Any  #: [1/m]


def entry_planes(seen: Seen) -> EntryPlanes | None:
    """Return the planes where legs enter a medium, as the light sees it; None for a sphere."""
    return _facing_planes(seen, 1)


def exit_planes(seen: Seen) -> EntryPlanes | None:
    """Return the planes where legs leave a medium: the light is inside of them, with -g for g; None for a sphere."""
    return _facing_planes(seen, -1)


def _facing_planes(seen: Seen, side: int) -> EntryPlanes | None:
    bounded_medium = seen.bounded_medium
    if bounded_medium.planes is None:
        return None
    Four = four_numbers(type(seen.planes))
    own = dr.arange(mi.UInt32, bounded_medium.count * bounded_medium.sides) // bounded_medium.sides
    there = dr.gather(Four, seen.planes, bounded_medium.neighbours)
    facing = (there.w > 0) == (side > 0)
    number = dr.select(facing, bounded_medium.neighbours, own)
    entries = dr.gather(Four, seen.planes, number)
    entries = packed(Four(*dr.select((entries.w > 0) == (side > 0), entries.xyz * side, 0), number))
    across = packed(Four(*dr.select(facing, 0, there.xyz * side), 0))
    starts = _nearest_planes(seen, side)
    within = dr.gather(mi.UInt32, starts, mi.UInt32(0)) >= bounded_medium.count
    dr.eval(entries, across, starts)
    return EntryPlanes(
        bounded_medium.sides,
        bounded_medium.count,
        side,
        _image_frame(seen),
        starts,
        within,
        seen.planes,
        entries,
        across,
    )


def _image_frame(seen: Seen):
    """Return axes in which the medium's sphere is seen between -1 and 1: (v . across, v . up)/(v . middle)."""
    toward, radius = seen.toward, seen.bounded_medium.radius
    distance = dr.maximum(dr.norm(toward), 1e-6 * radius)
    # A point within the sphere sees no such image; the walk can begin at any plane.
    beside = dr.sqrt(dr.maximum((distance - radius) * (distance + radius), 0.01 * radius * radius))
    middle = toward / distance
    Vector = type(toward)
    across = dr.normalize(dr.cross(middle, dr.select(dr.abs(middle.x) < 0.6, Vector(1, 0, 0), Vector(0, 1, 0))))
    up = dr.cross(across, middle)
    return across * (beside / radius), up * (beside / radius), middle


def _nearest_planes(seen: Seen, side: int):
    """Return by cell of the image the plane that the line through its middle meets first; `count` if there is none."""
    Float = type(seen.planes)
    Four = four_numbers(Float)
    cell = dr.arange(mi.UInt32, _CELLS * _CELLS)
    across, up, middle = _image_frame(seen)
    scale = dr.rcp(dr.squared_norm(across))
    first, second = (Float(part) * (2 / _CELLS) + (1 / _CELLS - 1) for part in (cell % _CELLS, cell // _CELLS))
    v = middle + across * (first * scale) + up * (second * scale)

    def nearer(number, least, nearest):
        values = dr.gather(Four, seen.planes, number)
        value = dr.dot(values.xyz * side, v)
        less = ((values.w > 0) == (side > 0)) & (value < least)
        return number + 1, dr.select(less, value, least), dr.select(less, number, nearest)

    width = dr.width(v)
    _, _, nearest = dr.while_loop(
        state=(mi.UInt32(0), dr.full(Float, dr.inf, width), dr.full(mi.UInt32, seen.bounded_medium.count, width)),
        cond=lambda number, least, nearest: number < seen.bounded_medium.count,
        body=nearer,
        labels=("number", "least", "nearest"),
    )
    return nearest


def _start(planes: EntryPlanes, v):
    """Return a plane to begin at for lines along v."""
    across, up, middle = planes.frame
    scale = 0.5 * _CELLS / dr.maximum(dr.dot(v, middle), 1e-30)
    places = (dr.clip(dr.fma(dr.dot(v, axis), scale, 0.5 * _CELLS), 0, _CELLS - 1) for axis in (across, up))
    column, row = (mi.UInt32(place) for place in places)
    return dr.minimum(dr.gather(mi.UInt32, planes.starts, row * _CELLS + column), planes.count - 1)


def first_entry(planes: EntryPlanes, start, direction, x, active=True) -> Entry:
    """Return the plane through which the legs to the points start + x direction enter.

    Parameters
    ----------
    planes
        As the light sees them.
    start, direction
        From the light to the camera, and of the rays [m].
    x
        Distances of points within the medium [m].
    active
        Lanes to search in.

    Notes
    -----
    Valid for points within the medium. Where the light itself is, there is no such plane, and 0 for u.
    """

    def step(turn, number, constant, slope, searches):
        def nearer(best, other, line):
            at, least = dr.fma(best[2], x, best[1]), dr.fma(line[1], x, line[0])
            less = least < at
            return tuple(dr.select(less, new, old) for new, old in zip((other, *line), best))

        least_plane = _over_neighbours(planes, number, (number, constant, slope), start, direction, nearer)
        return turn + 1, *least_plane, searches & (least_plane[0] != number)

    width = dr.width(start, direction, x, active)
    number = _start(planes, dr.fma(direction, x, start))
    g = dr.gather(four_numbers(type(x)), planes.planes, number, active).xyz
    g = dr.select(planes.within, 0, g * planes.side)
    _, number, constant, slope, _ = dr.while_loop(
        state=(
            dr.zeros(mi.UInt32, width),
            dr.zeros(mi.UInt32, width) + number,
            dr.dot(g, start) + dr.zeros(type(x), width),
            dr.dot(g, direction) + dr.zeros(type(x), width),
            dr.full(mi.Bool, True, width) & active,
        ),
        cond=lambda turn, number, constant, slope, searches: searches & (turn < planes.count),
        body=step,
        labels=("turn", "number", "constant", "slope", "searches"),
    )
    return Entry(number, constant, slope)


def line_crossings(planes: tuple[EntryPlanes, EntryPlanes], v):
    """Return 1/f_in and 1/f_out for lines from the light along v, see `realtime.bounded_media.convex_clip`.

    Parameters
    ----------
    planes
        Those where legs enter the medium, and those where they leave it.
    v
        Vectors from the light [m].

    Returns
    -------
    enter, leave
        As from `realtime.bounded_media.convex_clip.inverse_crossings`: the line misses the medium where enter is 0 or
        less.

    Notes
    -----
    Where no plane next to the one that is found has less, the line enters by it if it meets its facet: if it is within
    the planes next to it on the other side of the medium, too.
    """
    entering, leaving = planes
    still, zero = dr.zeros(type(v)), type(v.x)(0)
    entry = first_entry(entering, v, still, zero)
    u = entry.constant
    for side in range(entering.sides):
        u = dr.select(dr.dot(_across(entering, entry.number, side), v) > u, -1, u)
    u = dr.select(entering.within, dr.inf, u)
    return u, -first_entry(leaving, v, still, zero, u > 0).constant


def _across(planes: EntryPlanes, number, side: int):
    return dr.gather(four_numbers(type(planes.across)), planes.across, number * planes.sides + side).xyz


def clear_of(planes: tuple[EntryPlanes, EntryPlanes], start, direction, x0, x1):
    """Return whether no leg to a segment meets the medium whose entry and exit planes are given.

    The answer is conservative: where it is False, legs may still miss the medium.

    With u the entering plane's and -w the leaving one's, legs that meet the medium have u > 1 and u > -w. Both are
    linear along the ray: where u - max(1, -w) is below 0 at both ends with the planes of one point between, no leg
    does. Rays lead from `start`, the camera less the light [m], along `direction`; `x0` and `x1` are the segment [m].
    """
    clear = dr.mask_t(x0)(False)
    for x in (0.5 * (x0 + x1), x0, x1):
        enter, leave = (first_entry(facing, start, direction, x) for facing in planes)
        short, beside = dr.mask_t(x)(True), dr.mask_t(x)(True)
        for end in (x0, x1):
            u = dr.fma(enter.slope, end, enter.constant)
            short &= u < 1
            beside &= u + dr.fma(leave.slope, end, leave.constant) < 0
        clear |= short | beside
    return clear & ~planes[0].within


def next_facet_change(planes: EntryPlanes, start, direction, entry: Entry):
    """Return where legs pass to another plane next [m], infinite where they do not, and that plane.

    Rounding can place the change behind the point; it is returned as it is, and the walk continues from its own place.
    `start` and `direction` as for `first_entry`.
    """

    def sooner(best, other, line):
        closing = entry.slope - line[1]
        at = dr.select(closing > 0, (line[0] - entry.constant) / closing, dr.inf)
        less = at < best[0]
        return tuple(dr.select(less, new, old) for new, old in zip((at, other, *line), best))

    none = (type(entry.constant)(dr.inf), entry.number, entry.constant, entry.slope)
    until, *next_plane = _over_neighbours(planes, entry.number, none, start, direction, sooner)
    return until, Entry(*next_plane)


def _over_neighbours(planes: EntryPlanes, number, state, start, direction, function):
    """Go over the neighbours of a plane: state = function(state, number, (constant, slope))."""
    Four = four_numbers(type(start.x))
    place = number * planes.sides

    def at(side, state):
        values = dr.gather(Four, planes.entries, place + side)
        g = values.xyz
        return function(state, mi.UInt32(values.w), (dr.dot(g, start), dr.dot(g, direction)))

    if planes.sides <= _UNROLLED:
        for side in range(planes.sides):
            state = at(side, state)
        return state
    _, state = dr.while_loop(
        state=(mi.UInt32(0), state),
        cond=lambda side, state: side < planes.sides,
        body=lambda side, state: (side + 1, at(side, state)),
        labels=("side", "state"),
    )
    return state
