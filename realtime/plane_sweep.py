# SPDX-License-Identifier: BSD-3-Clause
"""The lit segments of a camera ray between shadow planes: a walk along the planes of its tile.

`realtime.plane_index` has the mathematics. With D the distance from the light to the camera and w the direction of the
ray in the frame of the light, a plane is crossed at the distance x with D/x = A wx + B wy - wz, where 0 < D/x <
D (P wx + Q wy). The walk works with that quotient, which falls from the camera on, and divides twice a segment.

A count holds how many layers lie between the light and the point: it starts with those between light and camera, and
the point is lit where it is zero. Planes come in the order in which the middle ray of the tile crosses them. Two that
cross within the tile can come in the wrong order for a ray, so a crossing waits in a queue of eight until eight more
have been read. Where that is not enough the ray notices, since its quotients must fall, and starts again: it collects
the eight nearest crossings from the whole list, goes over them, collects the next eight, and so on. That is right for
any order.
"""

from dataclasses import dataclass, replace
from typing import Any

from realtime.arrays import four_numbers, two_numbers
from realtime.crossing_queue import Queue, filled, inserted, popped, pushed
from realtime.diamond import diamond_angle
from realtime.plane_index import FULL, GAIN_SHIFT, GAIN_ZERO, NUMBER, PlaneIndex
from realtime.plane_tiles import TILE, Lists, Source, entry_at


@dataclass(frozen=True)
class RayPlanes:
    """A camera ray in the frame of an index of planes."""

    x: Any  #: direction
    y: Any
    z: Any
    azimuth: Any  #: diamond angle
    source: Source  #: the planes of its tile
    sorted: Any  #: whether they are in order


def in_light_frame(index: PlaneIndex, direction, low):
    """Return the components of directions in the frame of a light; `low` is what rounding took from them."""
    import drjit as dr

    return tuple(dr.dot(axis, direction) + dr.dot(axis, low) for axis in (index.x_axis, index.y_axis, index.z_axis))


def ray_planes(lists: Lists, x, y, z) -> RayPlanes:
    """Return camera rays, directions in the frame of a light, with the planes of their tiles."""
    import drjit as dr
    import mitsuba as mi

    tile = dr.arange(mi.UInt32, dr.width(x)) // TILE
    source = dr.gather(Source, lists.source, tile)
    return RayPlanes(x, y, z, diamond_angle(x, y), source, dr.gather(mi.Bool, lists.sorted, tile))


def read_plane(index: PlaneIndex, lists: Lists, ray: RayPlanes, k, active):
    """Return the quotient D/x of a plane, whether the ray crosses it, the layers gained, and the plane's number.

    Parameters
    ----------
    index, lists, ray
        The planes and the rays.
    k
        Which plane of the list.
    active
        Lanes to read for.
    """
    import drjit as dr
    import mitsuba as mi

    entry, counts = entry_at(lists.entries, ray.source, k, active)
    number = entry & NUMBER
    Float = type(ray.x)
    a, b, p, q = dr.gather(four_numbers(Float), index.lines, number, counts)
    quotient = dr.fma(a, ray.x, dr.fma(b, ray.y, -ray.z))
    beyond = quotient < index.distance * dr.fma(p, ray.x, q * ray.y)

    def looked_up(number, azimuth, quotient, beyond, unsure):
        first, last = dr.gather(two_numbers(Float), index.spans, 2 * number, unsure)
        return (azimuth >= first) & (azimuth < last) & beyond & (quotient > 0)

    unsure = counts & ((entry & FULL) == 0)
    crossed = dr.if_stmt(
        args=(number, ray.azimuth, quotient, beyond, unsure),
        cond=unsure,
        true_fn=looked_up,
        false_fn=lambda *_: mi.Bool(True),
    )
    gain = Float(mi.Int32((entry >> GAIN_SHIFT) & 63) - GAIN_ZERO)
    return quotient, counts & crossed, gain, number


def sum_lit_segments(index: PlaneIndex, lists: Lists, ray: RayPlanes, segment, integral, zero):
    """Add up an integral over the lit segments of every ray.

    Parameters
    ----------
    index, lists, ray
        The planes and the rays.
    segment
        Distances (x0, x1) between which to look; `x1` may be infinite.
    integral
        Function (x0, x1) -> value of one segment.
    zero
        The value of no segment.

    Returns
    -------
    total
        Sum over the lit segments.
    lit
        Whether the light reaches the end of the segment.
    """
    import drjit as dr
    import mitsuba as mi

    x0, x1 = segment
    ray_end = index.distance / x1

    def loop(walk, cond, step):
        (walk,) = dr.while_loop(state=(walk,), cond=cond, body=lambda walk: (step(walk),), labels=("walk",))
        return walk

    def body(total, walk):
        walk = loop(
            walk,
            lambda walk: (walk.place < ray.source.count) & ~walk.ready & ~walk.done & ~walk.selecting,
            lambda walk: _read(index, lists, ray, ray_end, walk),
        )
        walk = loop(
            walk,
            lambda walk: ~walk.ready & ~walk.done & ~walk.selecting,
            lambda walk: _drained(ray_end, walk),
        )
        again = walk.selecting & ~walk.started
        walk = loop(
            _from_the_start(index, walk),
            lambda walk: walk.selecting & ~walk.ready & ~walk.done,
            lambda walk: _collected(index, lists, ray, ray_end, walk),
        )
        begin = dr.maximum(index.distance / walk.opened, x0)
        value = integral(begin, dr.maximum(dr.minimum(index.distance / walk.closed, x1), begin))
        total = dr.select(again, zero, total) + dr.select(walk.ready, value, zero)
        walk.ready = mi.Bool(False)
        walk.done |= (ray.source.count == 0) & ray.sorted
        return total, walk

    total, walk = dr.while_loop(
        state=(zero, _started(index, ray, segment)),
        cond=lambda total, walk: ~walk.done,
        body=body,
        labels=("total", "walk"),
    )
    return total, walk.layers <= 0


@dataclass
class _Walk:
    """Where a ray is on its walk; distances as quotients D/x."""

    place: Any  #: next entry to read
    layers: Any  #: layers over the point
    quotient: Any  #: of the last crossing
    queue: Queue  #: crossings that wait
    more: Any  #: collecting: the queue may have been too short
    opened: Any  #: where the light came back
    closed: Any  #: where it ended
    ready: Any  #: a segment has ended
    done: Any  #: there are no more
    selecting: Any  #: the list is too far from being in order for this ray: collect from the whole of it
    started: Any  #: collecting has begun


def _started(index: PlaneIndex, ray: RayPlanes, segment) -> _Walk:
    import drjit as dr
    import mitsuba as mi

    Float, width = type(ray.x), dr.width(ray.x)
    # Without planes the ray is lit as a whole, or dark.
    alone = (ray.source.count == 0) & ray.sorted
    return _Walk(
        place=dr.zeros(mi.UInt32, width),
        layers=dr.zeros(Float, width) + Float(index.layers),
        quotient=dr.full(Float, dr.inf, width),
        # What comes out first has no place and no gain: nothing happens there.
        queue=filled(dr.inf, Float, width),
        more=dr.full(mi.Bool, False, width),
        opened=dr.full(Float, dr.inf, width),
        closed=dr.zeros(Float, width),
        ready=alone & (index.layers <= 0),
        done=~(segment[1] > segment[0]) | (alone & (index.layers > 0)),
        selecting=~ray.sorted,
        started=dr.full(mi.Bool, False, width),
    )


def _happened(walk: _Walk, quotient, gain, event) -> _Walk:
    """Go over a crossing where `event` is true."""
    import drjit as dr

    layers = walk.layers + dr.select(event, gain, 0)
    closes = event & (walk.layers <= 0) & (layers > 0)
    opens = event & (walk.layers > 0) & (layers <= 0)
    return replace(
        walk,
        layers=layers,
        quotient=dr.select(event, quotient, walk.quotient),
        opened=dr.select(opens, quotient, walk.opened),
        closed=dr.select(closes, quotient, walk.closed),
        ready=closes,
    )


def _ended(walk: _Walk, ray_end, ends) -> _Walk:
    """End the walk where `ends` is true."""
    import drjit as dr

    lit = ends & (walk.layers <= 0)
    return replace(walk, closed=dr.select(lit, ray_end, walk.closed), ready=walk.ready | lit, done=walk.done | ends)


def _read(index: PlaneIndex, lists: Lists, ray: RayPlanes, ray_end, walk: _Walk) -> _Walk:
    """Read the next plane; of it and those that wait, the nearest happens."""
    quotient, crossed, gain, _ = read_plane(index, lists, ray, walk.place, walk.place < ray.source.count)
    crossed &= quotient > ray_end
    queue, at, gained = pushed(walk.queue, quotient, gain, crossed)
    disorder = crossed & (at > walk.quotient)
    walk = _happened(walk, at, gained, crossed & ~disorder)
    return replace(walk, place=walk.place + 1, queue=queue, selecting=disorder)


def _drained(ray_end, walk: _Walk) -> _Walk:
    """Behind the last plane: the next of those that wait happens."""
    import mitsuba as mi

    queue, at, gained = popped(walk.queue, mi.Bool(True))
    walk = _happened(replace(walk, queue=queue), at, gained, at > 0)
    return _ended(walk, ray_end, at <= 0)


def _from_the_start(index: PlaneIndex, walk: _Walk) -> _Walk:
    """Begin to collect, where a ray has just found that its list is not in order."""
    import drjit as dr

    Float = type(walk.layers)
    fresh = walk.selecting & ~walk.started
    return replace(
        walk,
        place=dr.select(fresh, 0, walk.place),
        layers=dr.select(fresh, Float(index.layers), walk.layers),
        quotient=dr.select(fresh, dr.inf, walk.quotient),
        queue=dr.select(fresh, filled(0, Float, dr.width(fresh)), walk.queue),
        opened=dr.select(fresh, dr.inf, walk.opened),
        started=walk.selecting,
    )


def _collected(index: PlaneIndex, lists: Lists, ray: RayPlanes, ray_end, walk: _Walk) -> _Walk:
    """Collect the nearest crossings beyond the last one from the whole list; behind its end they happen, one by one."""
    import drjit as dr

    reading = walk.place < ray.source.count
    quotient, crossed, gain, _ = read_plane(index, lists, ray, walk.place, reading)
    found = crossed & (quotient > ray_end) & (quotient < walk.quotient)
    queue = inserted(walk.queue, quotient, gain, found)
    more = walk.more | (queue.quotient[-1] > 0)
    queue, at, gained = popped(queue, ~reading)
    event = ~reading & (at > 0)
    walk = _happened(replace(walk, queue=queue), at, gained, event)
    empty = ~reading & (at <= 0)
    walk = _ended(walk, ray_end, empty & ~walk.more)
    again = empty & walk.more
    return replace(walk, place=dr.select(reading, walk.place + 1, dr.select(again, 0, walk.place)), more=more & ~again)
