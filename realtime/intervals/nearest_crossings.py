# SPDX-License-Identifier: BSD-3-Clause
"""A queue of the nearest crossings of a ray, in registers, nearest first.

A crossing has a key, which says how near it is, and may have a gain, which says what changes there. Every place of the
queue is compared at every insertion, without branches: two to five instructions a place. What has no place comes out,
so a caller knows that it must go over its crossings again for those that are farther.

Crossings of one key stay in the order in which they came.
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr


@dataclass
class Crossings:
    """Crossings, nearest first."""

    key: list[Any]
    gain: list[Any]  #: of each; empty where crossings have none


def filled(key: float, places: int, Float, width: int, *, gains: bool = True) -> Crossings:
    """Return a queue of so many places that holds one key in all of them, without gain, for `width` lanes."""
    return Crossings(
        [dr.full(Float, key, width) for _ in range(places)],
        [dr.zeros(Float, width) for _ in range(places if gains else 0)],
    )


def insert(queue: Crossings, key, gain=None, *, larger_is_nearer: bool):
    """Put a crossing in its place.

    Returns
    -------
    queue
        The nearest, as many as before.
    key, gain
        Of the crossing that is left without a place, the farthest of all.
    """
    nearer, farther = (dr.maximum, dr.minimum) if larger_is_nearer else (dr.minimum, dr.maximum)
    keys, gains, new = [], [], key
    for place, held in enumerate(queue.key):
        keys.append(nearer(held, key))
        key = farther(held, key)
        if queue.gain:
            # Compare with the new key, not with the one that it displaced: equal keys must keep their order.
            before = new > held if larger_is_nearer else new < held
            gains.append(dr.select(before, gain, queue.gain[place]))
            gain = dr.select(before, queue.gain[place], gain)
    return Crossings(keys, gains), key, gain


def exchange(queue: Crossings, key, gain, *, larger_is_nearer: bool):
    """Put a crossing in its place and take out the nearest of all: the queue, and the key and gain of that."""
    queue, last, last_gain = insert(queue, key, gain, larger_is_nearer=larger_is_nearer)
    return Crossings([*queue.key[1:], last], [*queue.gain[1:], last_gain]), queue.key[0], queue.gain[0]


def pop(queue: Crossings, none: float, active):
    """Take out the nearest crossing where `active`, and put the key `none` behind the last: as `exchange` does."""
    Float = type(queue.key[0])
    moved = Crossings([*queue.key[1:], Float(none)], [*queue.gain[1:], Float(0)])
    return dr.select(active, moved, queue), queue.key[0], queue.gain[0]
