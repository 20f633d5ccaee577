# SPDX-License-Identifier: BSD-3-Clause
"""Claim: files are whole or not at all; arrays come back bit by bit or not at all, and the
cache keeps to its size.
"""

import os
import resource
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from airlight.errors import InputError
from airlight.reference.storage.cache import (
    DEFAULT_LIMIT,
    cache_entries,
    cache_folder,
    cache_limit,
    clear_cache,
    drop_arrays,
    is_stored,
    load_arrays,
    remove_oldest,
    store_arrays,
)
from airlight.reference.storage.files import (
    atomic_path,
    ensure_folder,
    write_bytes,
    write_text,
)

pytestmark = pytest.mark.usefixtures("own_cache")


def test_a_user_without_a_home_is_told_to_name_a_folder(monkeypatch):
    def homeless():
        raise RuntimeError("Could not determine home directory.")

    monkeypatch.setattr(Path, "home", homeless)
    for name in ("AIRLIGHT_CACHE_DIR", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    with pytest.raises(InputError, match="expected AIRLIGHT_CACHE_DIR to name a folder"):
        cache_folder()


@pytest.mark.claim("files-whole-or-not-at-all")
@pytest.mark.parametrize("kind", [ValueError, KeyboardInterrupt, SystemExit])
def test_an_exception_leaves_the_old_file_and_nothing_else(tmp_path, kind):
    path = tmp_path / "old.txt"
    write_text(path, "old")

    def interrupted():
        with atomic_path(path) as temporary:
            temporary.write_text("half")
            raise kind

    with pytest.raises(kind):
        interrupted()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_name_may_have_as_many_bytes_as_the_system_allows(tmp_path):
    path = tmp_path / f"{chr(0x96FE) * 80}.txt"  # three bytes each
    write_text(path, "fog")
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.claim("files-whole-or-not-at-all")
def test_a_killed_process_leaves_the_old_file_and_what_it_left_is_swept(tmp_path):
    path = tmp_path / "old.txt"
    write_text(path, "old")
    script = (
        "import os, signal, sys\n"
        "from airlight.reference.storage.files import atomic_path\n"
        "with atomic_path(sys.argv[1]) as temporary:\n"
        "    temporary.write_text('half')\n"
        "    os.kill(os.getpid(), signal.SIGKILL)\n"
    )
    done = subprocess.run([sys.executable, "-c", script, str(path)], check=False)
    assert done.returncode != 0
    assert path.read_text() == "old"
    (half,) = (each for each in tmp_path.iterdir() if each != path)
    mine = tmp_path / ".mine-0123.txt"
    mine.write_text("")
    os.utime(mine, (1, 1))
    write_text(path, "new")
    assert half.exists()  # another process may be writing it
    os.utime(half, (1, 1))
    write_text(path, "newer")
    assert sorted(tmp_path.iterdir()) == [mine, path]


def test_refuses_a_folder_that_is_a_file(tmp_path):
    write_text(tmp_path / "file", "x")
    for folder in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(InputError, match=r"file is not a folder; give another place"):
            ensure_folder(folder)
    assert (tmp_path / "file").read_text() == "x"


@pytest.mark.claim("files-whole-or-not-at-all")
def test_a_full_disk_names_the_file_and_leaves_it(tmp_path):
    """A limit on the size of a file stands for the disk; a failed write does
    not name a file by itself.
    """
    write_bytes(tmp_path / "a.bin", b"old")
    old = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, old[1]))
    try:
        with pytest.raises(OSError, match="File too large") as caught:
            write_bytes(tmp_path / "a.bin", bytes(2000))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, old)
    assert caught.value.filename == str(tmp_path / "a.bin")
    assert [path.name for path in tmp_path.iterdir()] == ["a.bin"]
    assert (tmp_path / "a.bin").read_bytes() == b"old"


# The cache ----------------------------------------------------------------------------------------


ROOT = Path(__file__).resolve().parents[3]
KB = {"a": np.zeros(1000, dtype=np.uint8)}


def test_arrays_come_back_bit_by_bit_and_the_last_ones_stored():
    store_arrays("twice", {"old": np.zeros(3)})
    given = {
        "image": np.array([[1 / 3, -0.0], [np.inf, np.nan]]),
        "count": np.int64(7),
        "word": "fog",
    }
    store_arrays("twice", given)
    loaded = load_arrays("twice")
    assert loaded is not None
    assert set(loaded) == set(given)
    assert loaded["image"].tobytes() == given["image"].tobytes()
    assert (int(loaded["count"]), str(loaded["word"])) == (7, "fog")
    drop_arrays("twice")
    assert (load_arrays("twice"), is_stored("twice")) == (None, False)


def archive(path, change):
    """Write what was stored with a change, by NumPy: whole as an archive."""
    with np.load(path) as stored:
        arrays = {name: stored[name] for name in stored.files}
    change(arrays)
    np.savez(path, **arrays)


def flip(path, place, bits):
    """Flip bits of the last entry in an archive's list of its files."""
    content = bytearray(path.read_bytes())
    content[content.rindex(b"PK\x01\x02") + place] ^= bits
    path.write_bytes(bytes(content))


DAMAGES = {
    "empty": lambda path: path.write_bytes(b""),
    "cut in the middle": lambda path: path.write_bytes(path.read_bytes()[:4000]),
    "cut at the end": lambda path: path.write_bytes(path.read_bytes()[:-1]),
    "a flipped bit": lambda path: path.write_bytes(
        bytes(b ^ (k == 4000) for k, b in enumerate(path.read_bytes()))
    ),
    # The words of the archive about its last array, by their places from the mark of its entry on.
    "another compression": lambda path: flip(path, 10, 1),
    "a newer version": lambda path: flip(path, 6, 64),
    "as if encrypted": lambda path: flip(path, 8, 1),
    "text": lambda path: path.write_text("no archive\n" * 100),
    # Loading a pickle would run what a stranger wrote into the cache.
    "a pickle": lambda path: np.savez(path, a=np.array([{"code": 1}], dtype=object)),
    "a number": lambda path: archive(path, lambda arrays: arrays["a"].__setitem__(2, 2 + 1e-12)),
    "a name": lambda path: archive(path, lambda arrays: arrays.update(c=arrays.pop("b"))),
    "a shape": lambda path: archive(
        path, lambda arrays: arrays.update(a=arrays["a"].reshape(10, 100))
    ),
    "a type": lambda path: archive(
        path, lambda arrays: arrays.update(a=arrays["a"].view(np.int64))
    ),
    "no digest": lambda path: archive(path, lambda arrays: arrays.pop("digest")),
}


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", DAMAGES)
def test_what_is_not_what_was_stored_counts_as_missing(damage):
    store_arrays("damaged", {"a": np.arange(1000.0), "b": np.int64(3)})
    DAMAGES[damage](cache_folder() / "damaged.npz")
    assert load_arrays("damaged") is None
    assert is_stored("damaged")


def test_the_folder_is_where_the_environment_says_and_made_when_needed(monkeypatch, tmp_path):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "deep" / "er"))
    assert load_arrays("x") is None
    assert not (tmp_path / "deep").exists()
    store_arrays("x", {"a": 1})
    assert (tmp_path / "deep" / "er" / "x.npz").exists()
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "file"))
    assert load_arrays("x") is None
    monkeypatch.delenv("AIRLIGHT_CACHE_DIR")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "xdg"))
    assert cache_folder() == tmp_path / "xdg" / "airlight"
    monkeypatch.setenv("XDG_CACHE_HOME", "")
    monkeypatch.setenv("HOME", str(tmp_path))
    assert cache_folder() == tmp_path / ".cache" / "airlight"


SIZES = {
    "": DEFAULT_LIMIT,
    "0": 0,
    "1500": 1500,
    "500MB": 500_000_000,
    "500 mib": 500 * 2**20,
    "1.5G": 1_500_000_000,
}


@pytest.mark.parametrize("words", SIZES)
def test_a_size_is_bytes_or_a_number_with_a_unit(monkeypatch, words):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", words)
    assert cache_limit() == SIZES[words]


@pytest.mark.parametrize("words", ["-1", "1e9", "inf", "2 XB", "9" * 400, "9" * 308 + "T"])
def test_other_sizes_are_refused(monkeypatch, words):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", words)
    with pytest.raises(InputError, match="expected a size such as 500MB"):
        cache_limit()


def key(kind, number):
    return f"{kind}-{number:032x}"


def fill(cache):
    """A file and a folder of two batches, used 1 to 3 s after the epoch."""
    names = key("quadrature", 1), f"{key('volpath', 2)}/000000", f"{key('volpath', 2)}/000001"
    for seconds, name in enumerate(names, 1):
        store_arrays(name, KB)
        os.utime(cache / f"{name}.npz", (seconds, seconds))
    return names


def test_the_files_that_were_used_longest_ago_are_removed_first(own_cache):
    names = fill(own_cache)
    assert [(entry.kind, entry.used) for entry in cache_entries()] == [
        ("quadrature", 1.0),
        ("volpath", 2.0),
        ("volpath", 3.0),
    ]
    size = sum(path.stat().st_size for path in own_cache.rglob("*.npz"))
    assert sum(entry.size for entry in cache_entries()) == size
    assert remove_oldest(size) == (0, 0)
    assert load_arrays(names[0]) is not None  # now it is the last that was used
    assert remove_oldest(size - 1)[0] == 1
    assert [is_stored(name) for name in names] == [True, False, True]
    assert remove_oldest(0)[0] == 2
    assert not list(own_cache.iterdir())


def test_storing_keeps_to_the_limit(own_cache, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "25kB")
    for number in range(5):
        store_arrays(key("page", number), {"a": np.zeros(10_000, dtype=np.uint8)})
    assert [is_stored(key("page", number)) for number in range(5)] == [
        False,
        False,
        False,
        True,
        True,
    ]


@pytest.mark.parametrize("size", ["0", "0MB"])
def test_a_cache_of_size_0_is_neither_read_nor_written(own_cache, monkeypatch, size):
    names = fill(own_cache)
    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", size)
    assert (load_arrays(names[0]), load_arrays(names[0], ["a"]), is_stored(names[0])) == (
        None,
        None,
        False,
    )
    store_arrays(key("page", 9), KB)
    monkeypatch.delenv("AIRLIGHT_CACHE_SIZE")
    assert not is_stored(key("page", 9))
    assert load_arrays(names[0]) is not None


def test_a_folder_that_cannot_be_written_is_noted_once_by_its_name_and_ends_nothing(
    monkeypatch, tmp_path, caplog
):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "file"))
    for number in range(2):
        store_arrays(key("page", number), KB)
    (record,) = caplog.records
    assert f"the cache folder {tmp_path / 'file'} cannot be written" in record.getMessage()
    assert load_arrays(key("page", 0)) is None


def test_clearing_leaves_what_is_not_of_the_cache(own_cache):
    fill(own_cache)
    others = [
        own_cache / name
        for name in ("thesis.npz", "report/notes.txt", f"deep/{key('page', 1)}.npz")
    ]
    for path in others:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text("mine")
    (own_cache / key("page", 9)).symlink_to(own_cache / "deep")
    half = own_cache / f".{key('page', 4)}-{4:032x}.npz"
    half.write_text("left by a killed run")
    os.utime(half, (1, 1))
    files, freed = clear_cache()
    assert (files, freed > 3000) == (3, True)
    assert all(path.read_text() == "mine" for path in others)
    assert not half.exists()
    assert clear_cache() == (0, 0)


_WRITER = """
import sys
import numpy as np
from airlight.reference.storage.cache import load_arrays, store_arrays
for number in range(60):
    name = f"volpath-{int(sys.argv[1]):016x}{number // 4:016x}/{number % 4:06d}"
    store_arrays(name, {"a": np.full(1000, number, dtype=np.uint8)})
    found = load_arrays(name)
    assert found is None or found["a"][0] == number
assert "mitsuba" not in sys.modules  # a page is drawn again where there is none
"""


def test_two_processes_keep_to_the_size_together(own_cache):
    environment = os.environ | {"AIRLIGHT_CACHE_SIZE": "20kB", "PYTHONPATH": str(ROOT)}
    command = [sys.executable, "-c", _WRITER]
    writers = [
        subprocess.Popen(
            [*command, name], cwd=ROOT, env=environment, stderr=subprocess.PIPE, text=True
        )
        for name in "12"
    ]
    for writer in writers:
        _, errors = writer.communicate(timeout=120)
        assert writer.returncode == 0, errors
    # Each of them exceeds the size by the file that it is about to write.
    assert 0 < sum(path.stat().st_size for path in own_cache.rglob("*.npz")) <= 20_000 + 2 * 2_000
    assert not list(own_cache.rglob(".*.npz"))
