# SPDX-License-Identifier: BSD-3-Clause
"""The lit segments of a camera ray between shadow planes: a walk along the planes of its tile.

`realtime.plane_index` has the mathematics. With D the distance from the light to the camera and w the direction of the
ray in the frame of the light, a plane is crossed at the distance x with D/x = A wx + B wy - wz, where 0 < D/x <
D (P wx + Q wy). The walk works with that quotient, which falls from the camera on, and divides twice a segment.

A count holds how many layers lie between the light and the point: it starts with those between light and camera, and
the point is lit where it is zero. Planes come in the order in which the middle ray of the tile crosses them. Two that
cross within the tile can come in the wrong order for a ray; the ray notices, since its quotients must fall, and starts
again by selection: each time the nearest of the crossings beyond the last. That needs a walk over the list for each
crossing and is right for any order.
"""

from dataclasses import dataclass
from typing import Any

from realtime.diamond import diamond_angle
from realtime.plane_index import FULL, GAIN_SHIFT, GAIN_ZERO, NUMBER, PlaneIndex
from realtime.plane_tiles import TILE, Lists, Source, entry_at


@dataclass(frozen=True)
class RayPlanes:
    """A camera ray in the frame of an index of planes."""

    span: Any  #: D [m]
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


def ray_planes(index: PlaneIndex, lists: Lists, direction, low) -> RayPlanes:
    """Return camera rays in the frame of a light, with the planes of their tiles."""
    import drjit as dr
    import mitsuba as mi

    x, y, z = in_light_frame(index, direction, low)
    tile = dr.arange(mi.UInt32, dr.width(direction)) // TILE
    source = Source(*(dr.gather(mi.UInt32, getattr(lists.source, name), tile) for name in Source.__annotations__))
    return RayPlanes(index.distance, x, y, z, diamond_angle(x, y), source, dr.gather(mi.Bool, lists.sorted, tile))


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
    a, b = (dr.gather(Float, index.lines, number * 4 + n, counts) for n in range(2))
    quotient = dr.fma(a, ray.x, dr.fma(b, ray.y, -ray.z))

    def looked_up(number, x, y, azimuth, quotient, unsure):
        p, q = (dr.gather(Float, index.lines, number * 4 + n, unsure) for n in (2, 3))
        first, last = (dr.gather(Float, index.spans, number * 4 + n, unsure) for n in (0, 1))
        beyond = quotient < index.distance * dr.fma(p, x, q * y)
        return (azimuth >= first) & (azimuth < last) & beyond & (quotient > 0)

    unsure = counts & ((entry & FULL) == 0)
    crossed = dr.if_stmt(
        args=(number, ray.x, ray.y, ray.azimuth, quotient, unsure),
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
    ray_end = ray.span / x1

    def body(total, walk):
        (walk,) = dr.while_loop(
            state=(walk,),
            cond=lambda walk: ~walk.ready & ~walk.done & ~walk.selecting,
            body=lambda walk: (_step(index, lists, ray, ray_end, walk),),
            labels=("walk",),
        )
        again = walk.selecting & ~walk.started
        walk = _selected(index, lists, ray, ray_end, walk)
        begin = dr.maximum(ray.span / walk.opened, x0)
        value = integral(begin, dr.maximum(dr.minimum(ray.span / walk.closed, x1), begin))
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
    next: Any  #: the nearest of two crossings that wait, because the order is not quite right
    next_gain: Any
    after: Any  #: the other one
    after_gain: Any
    opened: Any  #: where the light came back
    closed: Any  #: where it ended
    ready: Any  #: a segment has ended
    done: Any  #: there are no more
    selecting: Any  #: the bin is not in order for this ray
    started: Any  #: selecting has begun


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
        next=dr.full(Float, dr.inf, width),
        next_gain=dr.zeros(Float, width),
        after=dr.full(Float, dr.inf, width),
        after_gain=dr.zeros(Float, width),
        opened=dr.full(Float, dr.inf, width),
        closed=dr.zeros(Float, width),
        ready=alone & (index.layers <= 0),
        done=~(segment[1] > segment[0]) | (alone & (index.layers > 0)),
        selecting=~ray.sorted,
        started=dr.full(mi.Bool, False, width),
    )


def _step(index: PlaneIndex, lists: Lists, ray: RayPlanes, ray_end, walk: _Walk) -> _Walk:
    """Read the next plane; of it and the two that wait, the nearest happens."""
    import drjit as dr

    left = walk.place < ray.source.count
    quotient, crossed, gain, _ = read_plane(index, lists, ray, walk.place, left)
    crossed &= quotient > ray_end
    quotient, gain = dr.select(crossed, quotient, 0), dr.select(crossed, gain, 0)
    moves = crossed | ~left
    # Behind the last plane two of quotient 0 drive out those that wait.
    overtakes = quotient > walk.next
    at, gained = dr.select(overtakes, quotient, walk.next), dr.select(overtakes, gain, walk.next_gain)
    later, later_gain = dr.select(overtakes, walk.next, quotient), dr.select(overtakes, walk.next_gain, gain)
    first = later > walk.after
    disorder = moves & (at > walk.quotient)
    event = moves & ~disorder
    layers = walk.layers + dr.select(event, gained, 0)
    closes = event & (walk.layers <= 0) & (layers > 0)
    opens = event & (walk.layers > 0) & (layers <= 0)
    done = walk.place >= ray.source.count + 2
    return _Walk(
        place=walk.place + 1,
        layers=layers,
        quotient=dr.select(event, at, walk.quotient),
        next=dr.select(moves, dr.select(first, later, walk.after), walk.next),
        next_gain=dr.select(moves, dr.select(first, later_gain, walk.after_gain), walk.next_gain),
        after=dr.select(moves, dr.select(first, walk.after, later), walk.after),
        after_gain=dr.select(moves, dr.select(first, walk.after_gain, later_gain), walk.after_gain),
        opened=dr.select(opens, at, walk.opened),
        closed=dr.select(done, ray_end, at),
        ready=closes | (done & (layers <= 0)),
        done=done,
        selecting=disorder,
        started=walk.started,
    )


def _selected(index: PlaneIndex, lists: Lists, ray: RayPlanes, ray_end, walk: _Walk) -> _Walk:
    """Go on by selection to the end of the next lit segment, for rays whose bin is not in order."""
    import drjit as dr

    fresh = walk.selecting & ~walk.started
    Float = type(ray.x)
    state = _Walk(
        place=dr.select(fresh, 0, walk.place),
        layers=dr.select(fresh, Float(index.layers), walk.layers),
        quotient=dr.select(fresh, dr.inf, walk.quotient),
        next=walk.next,
        next_gain=walk.next_gain,
        after=walk.after,
        after_gain=walk.after_gain,
        opened=dr.select(fresh, dr.inf, walk.opened),
        closed=walk.closed,
        ready=walk.ready,
        done=walk.done,
        selecting=walk.selecting,
        started=walk.selecting,
    )

    def step(walk, best, best_gain):
        left = walk.place < ray.source.count
        quotient, crossed, gain, _ = read_plane(index, lists, ray, walk.place, left)
        candidate = crossed & (quotient > ray_end) & (quotient < walk.quotient)
        # Crossings at one place count together.
        best_gain = dr.select(
            candidate & (quotient > best), gain, best_gain + dr.select(candidate & (quotient == best), gain, 0)
        )
        best = dr.select(candidate, dr.maximum(quotient, best), best)
        event = ~left & (best > 0)
        finished = ~left & ~event
        layers = walk.layers + dr.select(event, best_gain, 0)
        closes = event & (walk.layers <= 0) & (layers > 0)
        opens = event & (walk.layers > 0) & (layers <= 0)
        next_walk = _Walk(
            place=dr.select(left, walk.place + 1, 0),
            layers=layers,
            quotient=dr.select(event, best, walk.quotient),
            next=walk.next,
            next_gain=walk.next_gain,
            after=walk.after,
            after_gain=walk.after_gain,
            opened=dr.select(opens, best, walk.opened),
            closed=dr.select(event, best, ray_end),
            ready=closes | (finished & (layers <= 0)),
            done=finished,
            selecting=walk.selecting,
            started=walk.started,
        )
        return next_walk, dr.select(left, best, 0), best_gain

    zero = dr.zeros(Float, dr.width(ray.x))
    state, _, _ = dr.while_loop(
        state=(state, zero, Float(zero)),
        cond=lambda walk, best, best_gain: walk.selecting & ~walk.ready & ~walk.done,
        body=step,
        labels=("walk", "best", "best_gain"),
    )
    return state
