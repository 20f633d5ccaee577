# SPDX-License-Identifier: BSD-3-Clause
"""A short queue of crossings in registers, nearest first.

A crossing is a quotient D/x (larger is nearer) with the layers that it gains; a quotient of 0 is no crossing. All
places of the queue are compared at every operation, without branches: a dozen instructions a place.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr


@dataclass
class Queue:
    """Crossings, nearest first."""

    quotient: list[Any]
    gain: list[Any]


def filled(quotient: float, places: int, Float, width: int) -> Queue:
    """Return a queue that holds one quotient in all places, without gain."""
    return Queue(
        [dr.full(Float, quotient, width) for _ in range(places)], [dr.zeros(Float, width) for _ in range(places)]
    )


def pushed(queue: Queue, quotient, gain, active):
    """Put a crossing into the queue and take out the nearest of all.

    Returns
    -------
    queue
        The queue after that; as it was where `active` is false.
    quotient, gain
        The crossing that was taken out; an infinite quotient where `active` is false.
    """
    # What is nearer than all comes out at once.
    carried, carried_gain = dr.select(active, quotient, dr.inf), dr.select(active, gain, 0)
    quotients, gains = [], []
    for q, g in zip(queue.quotient, queue.gain):
        before = carried > q
        quotients.append(dr.maximum(carried, q))
        gains.append(dr.select(before, carried_gain, g))
        carried, carried_gain = dr.minimum(carried, q), dr.select(before, g, carried_gain)
    return Queue([*quotients[1:], carried], [*gains[1:], carried_gain]), quotients[0], gains[0]


def inserted(queue: Queue, quotient, gain, active) -> Queue:
    """Put a crossing into the queue; crossings of one quotient become one, and the farthest of too many is lost."""
    carried = quotient, gain
    quotients, gains = [], []
    for place in range(len(queue.quotient)):
        q, g = queue.quotient[place], queue.gain[place]
        same, before = carried[0] == q, carried[0] > q
        quotients.append(dr.select(before, carried[0], q))
        gains.append(dr.select(before, carried[1], g + dr.select(same, carried[1], 0)))
        carried = (
            dr.select(before, q, dr.select(same, 0, carried[0])),
            dr.select(before, g, dr.select(same, 0, carried[1])),
        )
    return dr.select(active, Queue(quotients, gains), queue)


def popped(queue: Queue, active):
    """Take the nearest crossing out; see `pushed`."""
    zero = dr.zeros(type(queue.quotient[0]), 1)
    moved = Queue([*queue.quotient[1:], zero], [*queue.gain[1:], zero])
    return dr.select(active, moved, queue), queue.quotient[0], queue.gain[0]
