# SPDX-License-Identifier: BSD-3-Clause
"""Whatever the boundaries, and whenever intervals are added, the sum is
that over the lit intervals.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from airlight.realtime.intervals import (
    add_waiting,
    close_interval,
    exchange,
    filled,
    insert,
    no_intervals,
    open_interval,
    sum_at_end,
)
from airlight.realtime.numerics.array_types import aligned_array

RAYS, STEPS = 24, 7
GAINS = arrays(np.int64, (RAYS, STEPS), elements=st.integers(-2, 2))
WAITS = arrays(np.bool_, (RAYS, STEPS))
PLACES = arrays(np.int64, (RAYS, STEPS + 2), elements=st.integers(0, 40)).map(
    lambda places: np.sort(places, axis=1)
)


def expected(layers, places, gains):
    """Sums of b - a and of b^2 - a^2 over the lit intervals of a ray, how many they are,
    and whether its end is lit.
    """
    length = square = count = 0
    opened = places[0] if layers <= 0 else None
    for place, gain in zip(places[1:-1], gains):
        layers += gain
        if opened is None and layers <= 0:
            opened = place
        elif opened is not None and layers > 0:
            length, square, count = (
                length + place - opened,
                square + place**2 - opened**2,
                count + 1,
            )
            opened = None
    if opened is not None:
        length, square, count = (
            length + places[-1] - opened,
            square + places[-1] ** 2 - opened**2,
            count + 1,
        )
    return length, square, count, opened is not None


def integral(a, b):
    return mi.Vector3f(b - a, b * b - a * a, 1)


def start(layers, places):
    columns = [aligned_array(mi.Float, column) for column in places.T]
    return (
        aligned_array(mi.Float, layers),
        columns,
        no_intervals(dr.zeros(mi.Vector3f, RAYS), columns[0]),
    )


def check(total, layers, places, gains):
    totals = np.array(total, dtype=np.float64).T
    wanted = [expected(*ray) for ray in zip(layers, places, gains)]
    np.testing.assert_array_equal(totals, [sums[:3] for sums in wanted])  # small integers: exact


@pytest.mark.claim("sum-over-lit-intervals", tolerance="none: whole numbers")
@settings(deadline=None, max_examples=50)
@given(
    layers=arrays(np.int64, RAYS, elements=st.integers(-1, 2)),
    places=PLACES,
    gains=GAINS,
    due=WAITS,
)
def test_intervals_that_wait_as_long_as_they_may(variant, layers, places, gains, due):
    """As shadow planes use it: until another one closes, or until it is due; the
    rest at the end of the ray.
    """
    over, columns, intervals = start(layers, places)
    opened = columns[0]
    for step in range(STEPS):
        behind = over + aligned_array(mi.Float, gains[:, step])
        opens, closes = (over > 0) & (behind <= 0), (over <= 0) & (behind > 0)
        intervals = add_waiting(intervals, integral, closes | aligned_array(mi.Bool, due[:, step]))
        intervals = close_interval(intervals, columns[step + 1], closes, begin=opened)
        over, opened = behind, dr.select(opens, columns[step + 1], opened)
    ends = {"opened": opened, "lit": over <= 0, "active": mi.Bool(True)}
    check(sum_at_end(intervals, integral, columns[-1], **ends), layers, places, gains)


@pytest.mark.claim("sum-over-lit-intervals", tolerance="none: whole numbers")
@settings(deadline=None, max_examples=50)
@given(layers=arrays(np.int64, RAYS, elements=st.integers(-1, 2)), places=PLACES, gains=GAINS)
def test_intervals_that_are_added_at_once(variant, layers, places, gains):
    """As min-max uses it: what is lit to the end closes there."""
    over, columns, intervals = start(layers, places)
    for step in range(STEPS):
        behind = over + aligned_array(mi.Float, gains[:, step])
        intervals = open_interval(intervals, columns[step + 1], (over > 0) & (behind <= 0))
        intervals = close_interval(intervals, columns[step + 1], (over <= 0) & (behind > 0))
        intervals, over = add_waiting(intervals, integral), behind
    intervals = close_interval(intervals, columns[-1], over <= 0)
    check(add_waiting(intervals, integral).total, layers, places, gains)


# The queue of the nearest crossings: ties, infinities, too many -----------------------------------


QUEUES, COUNT, LENGTH = 16, 9, 4
# Few values, so that many are equal; 0 and infinity stand for no crossing.
KEYS = arrays(
    np.float32, (QUEUES, COUNT), elements=st.sampled_from([0.0, 0.25, 1.5, 1.75, 2.0, 1e30, np.inf])
)


def in_order(keys):
    """Places of the keys of every ray, nearest first, those of one key as they came."""
    return np.argsort(-keys, axis=1, kind="stable")


def lanes(keys):
    return [aligned_array(mi.Float, column) for column in keys.T]


def rows(values):
    """Read arrays; all that a test reads is evaluated together before, in one kernel."""
    return np.stack([np.array(value) for value in values], axis=1)


@pytest.mark.claim("nearest-crossings-in-order", tolerance="none: the same bits")
@settings(deadline=None, max_examples=50)
@given(keys=KEYS)
def test_the_nearest_are_kept_in_order_and_the_others_come_out(variant, keys):
    none = 0.0
    queue, out = filled(none, LENGTH, mi.Float, QUEUES), []
    for number, key in enumerate(lanes(keys)):
        queue, *left = insert(queue, key, mi.Float(number + 1))
        out.append(left)
    dr.eval(queue, out)
    order = in_order(keys)
    wanted = np.take_along_axis(keys, order, axis=1)
    kept, gains = rows(queue.key), rows(queue.gain)
    np.testing.assert_array_equal(kept, wanted[:, :LENGTH])
    real = kept != none
    np.testing.assert_array_equal(gains[real], order[:, :LENGTH][real] + 1)
    # Nothing is lost in secret: what is not in the queue came out.
    others = np.sort(
        np.concatenate([rows(queue.key), rows([key for key, _ in out])], axis=1), axis=1
    )
    padding = np.full((QUEUES, LENGTH), none, dtype=np.float32)
    np.testing.assert_array_equal(others, np.sort(np.concatenate([keys, padding], axis=1), axis=1))


@pytest.mark.claim("nearest-crossings-in-order", tolerance="none: the same bits")
@settings(deadline=None, max_examples=50)
@given(keys=KEYS, shift=arrays(np.int64, (QUEUES, COUNT), elements=st.integers(0, LENGTH)))
def test_exchange_repairs_an_order_that_is_wrong_by_no_more_than_its_places(variant, keys, shift):
    keys = np.take_along_axis(keys, in_order(keys), axis=1)
    # Each comes at most LENGTH later than in order, so none waits for more than these.
    late = np.argsort(np.arange(COUNT) + shift, axis=1, kind="stable")
    assume((late != np.arange(COUNT)).any())
    first, last = np.inf, 0.0
    queue, out = filled(first, LENGTH, mi.Float, QUEUES), []
    for key in lanes(np.take_along_axis(keys, late, axis=1)) + [mi.Float(last)] * LENGTH:
        queue, nearest, _ = exchange(queue, key, mi.Float(0))
        out.append(nearest)
    dr.eval(out)
    np.testing.assert_array_equal(rows(out[LENGTH:]), keys)
