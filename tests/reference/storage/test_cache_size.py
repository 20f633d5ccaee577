# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the cache keeps to its size; what was used longest ago goes first, and nothing but its own files goes."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from analytic.errors import InputError
from reference.storage.cache import load_arrays, store_arrays
from reference.storage.cache_size import DEFAULT_LIMIT, cache_entries, cache_limit, clear_cache, make_room

ROOT = Path(__file__).resolve().parents[3]
KB = {"a": np.zeros(1000, dtype=np.uint8)}


def key(kind, number):
    return f"{kind}-{number:032x}"


def used(path, seconds):
    os.utime(path, (seconds, seconds))


def fill(cache):
    """A file, a folder of two batches, a result of a report: used one after the other, 1 to 3 s after the epoch."""
    store_arrays(key("quadrature", 1), KB)
    for batch in ("000000", "000001"):
        store_arrays(f"{key('volpath', 2)}/{batch}", KB)
    store_arrays(f"report/{key('method', 3)}", KB)
    used(cache / f"{key('quadrature', 1)}.npz", 1)
    used(cache / key("volpath", 2) / "000000.npz", 0)
    used(cache / key("volpath", 2) / "000001.npz", 2)
    used(cache / "report" / f"{key('method', 3)}.npz", 3)


@pytest.mark.parametrize(
    ("text", "size"),
    [
        ("", DEFAULT_LIMIT),
        ("0", 0),
        ("1500", 1500),
        ("500MB", 500_000_000),
        ("500 mib", 500 * 2**20),
        ("1.5G", 1_500_000_000),
        ("4GiB", 4 * 2**30),
        ("2kB", 2000),
    ],
)
def test_a_size_is_a_number_with_a_unit(monkeypatch, text, size):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", text)
    assert cache_limit() == size


@pytest.mark.parametrize("text", ["much", "-1", "4 apples", "1e9", "GiB"])
def test_what_is_no_size_is_refused(monkeypatch, text):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", text)
    with pytest.raises(InputError, match=r"AIRLIGHT_CACHE_SIZE: got .*, wanted a size such as 500MB"):
        make_room()


def test_entries_have_kinds_and_come_by_last_use(own_cache):
    assert cache_entries() == []
    fill(own_cache)
    entries = cache_entries()
    assert [(entry.kind, len(entry.files), entry.used) for entry in entries] == [
        ("quadrature", 1, 1.0),
        ("volpath", 2, 2.0),
        ("method", 1, 3.0),
    ]
    assert sum(entry.size for entry in entries) == sum(path.stat().st_size for path in own_cache.rglob("*.npz"))


def test_the_least_recently_used_entry_is_dropped_first_and_whole(own_cache, monkeypatch):
    fill(own_cache)
    sizes = [entry.size for entry in cache_entries()]
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", str(sum(sizes)))
    assert make_room() == 0
    assert load_arrays(key("quadrature", 1)) is not None  # read: now it is the last that was used
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", str(sum(sizes) - 1))
    assert make_room() == sizes[1]
    assert [entry.kind for entry in cache_entries()] == ["method", "quadrature"]
    assert not (own_cache / key("volpath", 2)).exists()
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "0")
    assert make_room() == sizes[0] + sizes[2]
    assert cache_entries() == []


def test_a_damaged_file_is_an_entry_like_any_other(own_cache):
    fill(own_cache)
    path = own_cache / f"{key('quadrature', 1)}.npz"
    path.write_bytes(b"no archive")
    used(path, 1)
    assert load_arrays(key("quadrature", 1)) is None
    assert cache_entries()[0].path == path  # that it was tried is no use of it
    size = sum(_sizes(own_cache))
    assert clear_cache() == (3, size)


def _sizes(cache):
    return [path.stat().st_size for path in cache.rglob("*.npz")]


def test_clearing_leaves_what_is_not_of_the_cache(own_cache):
    fill(own_cache)
    kept = [
        own_cache / "thesis.npz",
        own_cache / "report" / "notes.txt",
        own_cache / "deep" / "er" / f"{key('page', 1)}.npz",
    ]
    for path in kept:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
    (own_cache / key("page", 9)).symlink_to(own_cache / "deep")
    half = own_cache / f".{key('page', 4)}-0a.npz"
    half.write_text("left by a killed run")
    used(half, 1)
    entries, freed = clear_cache()
    assert (entries, freed > 4000) == (3, True)
    assert all(path.read_text() == "mine" for path in kept)
    assert not half.exists()
    assert clear_cache() == (0, 0)


def test_what_cannot_be_removed_stays_and_is_not_counted(own_cache, monkeypatch):
    """A read-only folder: results are found in it as ever, and nothing is dropped."""
    fill(own_cache)

    def refuse(self, *args, **kwargs):
        raise PermissionError(13, "Permission denied", str(self))

    monkeypatch.setattr(Path, "unlink", refuse)
    monkeypatch.setattr(os, "utime", lambda path: refuse(path))
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "0")
    assert make_room() == 0
    assert clear_cache() == (0, 0)
    assert load_arrays(key("quadrature", 1)) is not None
    assert len(cache_entries()) == 3


_WRITER = """
import sys
import numpy as np
from reference.storage.cache import load_arrays, store_arrays
from reference.storage.cache_size import make_room
for number in range(60):
    make_room()
    name = f"volpath-{int(sys.argv[1]):016x}{number // 4:016x}/{number % 4:06d}"
    store_arrays(name, {"a": np.full(1000, number, dtype=np.uint8)})
    found = load_arrays(name)
    assert found is None or found["a"][0] == number
"""


def test_two_processes_keep_to_the_size_together(own_cache):
    environment = os.environ | {"AIRLIGHT_CACHE_SIZE": "20kB", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", _WRITER]
    writers = [
        subprocess.Popen([*command, name], cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True)
        for name in "12"
    ]
    for writer in writers:
        _, errors = writer.communicate(timeout=120)
        assert writer.returncode == 0, errors
    # Each of them exceeds the size by the file that it is about to write.
    assert 0 < sum(_sizes(own_cache)) <= 20_000 + 2 * 2_000
    assert not list(own_cache.rglob(".*.npz"))


def test_the_cache_is_read_without_mitsuba():
    """A page is drawn again where there is none."""
    code = "import sys, reference.storage.cache_size; print('mitsuba' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert ran.stdout == "False\n"
