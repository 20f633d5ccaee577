# SPDX-License-Identifier: BSD-3-Clause
r"""Sums over the lit intervals of rays, as a walk along them finds their ends.

A walk meets the boundaries of shadows in the order in which they lie along a ray. At each boundary
the light comes back, or ends, or nothing changes (two shadows overlap). With :math:`[a_i, b_i]` the
intervals between, the sum is

.. math:: \sum_i \int_{a_i}^{b_i} f(x) dx :

of positive terms, one for each interval, where a sum of :math:`\pm F(x_n)` over the
boundaries loses digits.

Each ray holds its last interval, from `begin` to `end`, and whether it
`waits` to be added to the sum:

- the light comes back: the interval opens here (`open_interval`), and nothing may wait;
- the light ends: the interval closes here and waits (`close_interval`), and
  no other may have waited;
- the ray ends: the waiting interval is added, and the one that is lit up to there (`sum_at_end`).

A walk that lets an interval wait until the next one closes has to remember
where the next one opened.

Waiting makes walks fast. Sixteen rays or more go in step, and all wait for each of them; an
integral costs as much as many steps. Each method therefore chooses when to call `add_waiting`, and
rays whose intervals end a few steps apart are served at once:
`realtime.methods.shadow_planes.sweep` does it at every fourth plane,
`realtime.methods.epipolar.walk` when every ray has an interval or is at its end, and
`realtime.methods.light_volumes.walk` when an interval does not go on in the next face of the map.

A place may be any number that rises or falls along a ray, a distance or a quotient D/x;
`integral` takes places as they are.

**A queue of the nearest crossings** puts boundaries in order where a walk meets them out of order,
in registers, with the nearest first. A crossing has a key, which says how near it is, and may have
a gain, which says what changes there. Every place of the queue is compared at every insertion,
without branches: two to five instructions a place. A crossing that finds no place is returned,
which tells the caller to go over its crossings again for the farther ones. Crossings of one key
stay in the order in which they came.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi


@dataclass
class LitIntervals:
    """The sum over the lit intervals of rays, and the last one of each."""

    total: Any  #: the sum
    begin: Any  #: of the last interval [m]
    end: Any  #: of the last interval [m]
    waits: Any  #: whether it has ended and is not in the sum yet


def no_intervals(zero, start) -> LitIntervals:
    """Return the state of rays at their start.

    Parameters
    ----------
    zero
        The sum of nothing, one for each ray.
    start
        Where rays start, one for each [m]: an interval opens there if they are lit.
    """
    return LitIntervals(zero, start, +start, dr.full(mi.Bool, False, dr.width(zero)))


def open_interval(intervals: LitIntervals, begin, opens) -> LitIntervals:
    """Return intervals behind the place `begin` [m] where the light comes back if it `opens` one.

    Valid where nothing waits.
    """
    # Only `begin` changes: the end of an interval that is already in the sum is never read again.
    return replace(intervals, begin=dr.select(opens, begin, intervals.begin))


def close_interval(intervals: LitIntervals, end, closes, *, begin=None) -> LitIntervals:
    """Return intervals behind the place `end` [m] where the light ends if it `closes` one;
    no other may have waited.

    Parameters
    ----------
    intervals
        The state of the rays.
    end
        The place where the light ends [m].
    closes
        Rays whose interval ends there.
    begin
        Where the interval began [m]; None: where `open_interval` put it.
    """
    if begin is not None:
        intervals = open_interval(intervals, begin, closes)
    # The interval is not integrated here: it waits, so that many rays are served by one call.
    return replace(
        intervals, end=dr.select(closes, end, intervals.end), waits=intervals.waits | closes
    )


def add_waiting(
    intervals: LitIntervals, integral: Callable[[Any, Any], Any], due=True
) -> LitIntervals:
    """Return intervals with what waits added to the sum where it is `due`.

    Parameters
    ----------
    intervals
        The state of the rays.
    integral
        A function (begin, end) -> value of one interval [m]; rays that add nothing step over it.
    due
        Rays whose waiting interval is added.
    """
    # A branch, not a mask: the integral costs as much as many steps, and a packet of rays in which
    # none waits leaves it out.
    total = dr.if_stmt(
        args=(intervals.total, intervals.begin, intervals.end),
        cond=intervals.waits & due,
        true_fn=lambda total, begin, end: total + integral(begin, end),
        false_fn=lambda total, begin, end: total,
    )
    return replace(intervals, total=total, waits=intervals.waits & ~mi.Bool(due))


def sum_at_end(
    intervals: LitIntervals, integral: Callable[[Any, Any], Any], end, *, opened, lit, active
):
    """Return the sum at the end of rays, with the waiting interval and the open one.

    A loop, not two branches: most rays have one of the two intervals and are served at once.

    Parameters
    ----------
    intervals
        The state of the rays.
    integral
        A function (begin, end) -> value of one interval [m].
    end
        The ends of the rays [m].
    opened
        Where the open intervals began [m].
    lit
        Rays that are lit up to their end, so that their last interval is open.
    active
        Rays to compute.
    """

    def body(total, waits, lit):
        # The interval that waits first; in the next turn the one that is lit up to the end.
        begin, until = (
            dr.select(waits, intervals.begin, opened),
            dr.select(waits, intervals.end, end),
        )
        return total + integral(begin, until), waits & False, waits & lit

    total, _, _ = dr.while_loop(
        state=(intervals.total, intervals.waits & active, lit & active),
        cond=lambda total, waits, lit: waits | lit,
        body=body,
        labels=("total", "waits", "lit"),
    )
    return total


@dataclass
class Crossings:
    """Crossings, nearest first."""

    key: list[Any]
    gain: list[Any]  #: of each


def filled(key: float, places: int, Float, width: int) -> Crossings:
    """Return a queue of so many places that holds one key in all of them, without
    gain, for `width` lanes.
    """
    keys, gains = ([dr.full(Float, value, width) for _ in range(places)] for value in (key, 0))
    return Crossings(keys, gains)


def insert(queue: Crossings, key, gain):
    """Put a crossing in its place: the larger its key, the nearer it is.

    Returns
    -------
    queue
        The nearest crossings, as many as before.
    key, gain
        The crossing without a place, the farthest of all.
    """
    keys, gains, new = [], [], key
    for place_key, place_gain in zip(queue.key, queue.gain, strict=True):
        # The nearer of two crossings stays in this place, the farther one goes on to the next.
        keys.append(dr.maximum(place_key, key))
        key = dr.minimum(place_key, key)
        # Compare with the new key, not with the one that it displaced: equal
        # keys must keep their order.
        before = new > place_key
        gains.append(dr.select(before, gain, place_gain))
        gain = dr.select(before, place_gain, gain)
    return Crossings(keys, gains), key, gain


def exchange(queue: Crossings, key, gain):
    """Put a crossing in its place and take out the nearest of all: the queue, and
    the key and gain of that.
    """
    # The queue moves up by one place, and the crossing that found none takes the last one.
    queue, farthest, farthest_gain = insert(queue, key, gain)
    return (
        Crossings([*queue.key[1:], farthest], [*queue.gain[1:], farthest_gain]),
        queue.key[0],
        queue.gain[0],
    )


def pop(queue: Crossings, none: float, active):
    """Take out the nearest crossing where `active`, and put the key `none` behind the
    last: as `exchange` does.
    """
    Float = type(queue.key[0])
    moved = Crossings([*queue.key[1:], Float(none)], [*queue.gain[1:], Float(0)])
    return dr.select(active, moved, queue), queue.key[0], queue.gain[0]
