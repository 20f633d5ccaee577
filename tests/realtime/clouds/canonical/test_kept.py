# SPDX-License-Identifier: BSD-3-Clause
"""Claim: numbers of a slab come from the disk only for the medium that they were made of: no image
depends on what was rendered before."""

import numpy as np
import pytest

from airlight.realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase

MEDIUM = medium_numbers(HenyeyGreensteinPhase(0.5), 0.95)


@pytest.mark.claim("clouds-look-up")
def test_numbers_are_those_of_the_medium_itself(own_cache):
    keep("made", MEDIUM, {"number": np.array([1.0, 2.0])})
    np.testing.assert_array_equal(load_kept("made", MEDIUM)["number"], [1.0, 2.0])
    near = HenyeyGreensteinPhase(np.nextafter(0.5, 1))
    for digest, other in (
        ("made", medium_numbers(near, 0.95)),
        ("made", medium_numbers(HenyeyGreensteinPhase(0.5), np.nextafter(0.95, 1))),
        ("made otherwise", MEDIUM),
    ):
        assert load_kept(digest, other) is None


def test_a_damaged_file_counts_as_none(own_cache):
    keep("made", MEDIUM, {"number": np.ones(999)})
    (path,) = own_cache.glob("canonical-*.npz")
    path.write_bytes(path.read_bytes()[:-500])
    assert load_kept("made", MEDIUM) is None


def test_without_a_cache_nothing_is_read(own_cache, monkeypatch):
    keep("made", MEDIUM, {"number": np.ones(3)})
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "0")
    assert load_kept("made", MEDIUM) is None
