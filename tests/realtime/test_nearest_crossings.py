# SPDX-License-Identifier: BSD-3-Clause
"""The queue holds the nearest crossings in order, whatever comes: ties, infinities, too many."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from realtime.intervals import exchange, filled, insert
from realtime.numerics.array_types import aligned_array

RAYS, COUNT, PLACES = 16, 9, 4
# Few values, so that many are equal; 0 and infinity stand for no crossing.
KEYS = arrays(np.float32, (RAYS, COUNT), elements=st.sampled_from([0.0, 0.25, 1.5, 1.75, 2.0, 1e30, np.inf]))


def in_order(keys):
    """Places of the keys of every ray, nearest first, those of one key as they came."""
    return np.argsort(-keys, axis=1, kind="stable")


def columns(keys):
    return [aligned_array(mi.Float, column) for column in keys.T]


def rows(values):
    """Read arrays; all that a test reads is evaluated together before, in one kernel."""
    return np.stack([np.array(value) for value in values], axis=1)


@pytest.mark.claim("nearest-crossings-in-order", tolerance="none: the same bits")
@settings(deadline=None, max_examples=50)
@given(keys=KEYS)
def test_the_nearest_are_kept_in_order_and_the_others_come_out(variant, keys):
    none = 0.0
    queue, out = filled(none, PLACES, mi.Float, RAYS), []
    for number, key in enumerate(columns(keys)):
        queue, *left = insert(queue, key, mi.Float(number + 1))
        out.append(left)
    dr.eval(queue, out)
    order = in_order(keys)
    wanted = np.take_along_axis(keys, order, axis=1)
    kept, gains = rows(queue.key), rows(queue.gain)
    np.testing.assert_array_equal(kept, wanted[:, :PLACES])
    real = kept != none
    np.testing.assert_array_equal(gains[real], order[:, :PLACES][real] + 1)
    # Nothing is lost in secret: what is not in the queue came out.
    others = np.sort(np.concatenate([rows(queue.key), rows([key for key, _ in out])], axis=1), axis=1)
    padding = np.full((RAYS, PLACES), none, dtype=np.float32)
    np.testing.assert_array_equal(others, np.sort(np.concatenate([keys, padding], axis=1), axis=1))


@pytest.mark.claim("nearest-crossings-in-order", tolerance="none: the same bits")
@settings(deadline=None, max_examples=50)
@given(keys=KEYS, shift=arrays(np.int64, (RAYS, COUNT), elements=st.integers(0, PLACES)))
def test_exchange_mends_an_order_that_is_wrong_by_no_more_than_its_places(variant, keys, shift):
    keys = np.take_along_axis(keys, in_order(keys), axis=1)
    # Each comes at most PLACES later than in order, so none waits for more than these.
    late = np.argsort(np.arange(COUNT) + shift, axis=1, kind="stable")
    assume((late != np.arange(COUNT)).any())
    first, last = np.inf, 0.0
    queue, out = filled(first, PLACES, mi.Float, RAYS), []
    for key in columns(np.take_along_axis(keys, late, axis=1)) + [mi.Float(last)] * PLACES:
        queue, nearest, _ = exchange(queue, key, mi.Float(0))
        out.append(nearest)
    dr.eval(out)
    np.testing.assert_array_equal(rows(out[PLACES:]), keys)
