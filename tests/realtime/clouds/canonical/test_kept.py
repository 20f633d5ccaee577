# SPDX-License-Identifier: BSD-3-Clause
"""Claim: numbers of a slab come from the disk only for the medium that they were made of: no image
depends on what was rendered before."""

from io import BytesIO

import numpy as np
import pytest

from airlight.realtime.clouds.canonical.kept import keep, load_kept, medium_numbers
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.reference.storage.cache import cache_entries, clear_cache

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


def _encrypted(data):
    """Return an archive whose list of files says that they are encrypted."""
    place = data.index(b"PK\x01\x02") + 8
    return data[:place] + bytes([data[place] | 1]) + data[place + 1 :]


def _array(data):
    buffer = BytesIO()
    np.save(buffer, np.ones(3))
    return buffer.getvalue()


@pytest.mark.parametrize("damage", [lambda data: data[:-500], _encrypted, _array])
def test_a_damaged_file_counts_as_none(own_cache, damage):
    keep("made", MEDIUM, {"number": np.ones(999)})
    (path,) = own_cache.glob("canonical-*.npz")
    path.write_bytes(damage(path.read_bytes()))
    assert load_kept("made", MEDIUM) is None


def test_the_cache_lists_and_removes_what_is_kept(own_cache):
    """The reference's rule for names decides which files have a limit, and which `doctor` knows."""
    keep("made", MEDIUM, {"number": np.ones(3)})
    assert [entry.kind for entry in cache_entries()] == ["canonical"]
    assert clear_cache()[0] == 1
    assert load_kept("made", MEDIUM) is None


@pytest.mark.parametrize("size", ["0", "0MB", "0.0 GiB"])
def test_without_a_cache_nothing_is_read(own_cache, monkeypatch, size):
    keep("made", MEDIUM, {"number": np.ones(3)})
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", size)
    assert load_kept("made", MEDIUM) is None
