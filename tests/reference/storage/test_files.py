# SPDX-License-Identifier: BSD-3-Clause
import os
import resource
import subprocess
import sys
import tempfile

import pytest

from analytic.errors import InputError
from reference.storage.files import (
    atomic_path,
    ensure_folder,
    ensure_writable,
    temporary_folder,
    write_bytes,
    write_text,
)


def test_writes_text_and_bytes(tmp_path):
    write_text(tmp_path / "a.txt", "Å\nb")
    write_bytes(tmp_path / "a.bin", b"\x00\xff")
    assert (tmp_path / "a.txt").read_bytes() == b"\xc3\x85\nb"
    assert (tmp_path / "a.bin").read_bytes() == b"\x00\xff"
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.bin", "a.txt"]


def test_temporary_file_has_the_suffix_and_the_folder_of_the_final_one(tmp_path):
    with atomic_path(tmp_path / "picture.exr") as temporary:
        assert temporary.suffix == ".exr"
        assert temporary.parent == tmp_path.resolve()
        assert temporary.name.startswith(".")
        temporary.write_bytes(b"x")
        assert not (tmp_path / "picture.exr").exists()
    assert (tmp_path / "picture.exr").read_bytes() == b"x"


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


@pytest.mark.claim("files-whole-or-not-at-all")
def test_a_killed_process_leaves_the_old_file_and_what_it_left_is_swept(tmp_path):
    path = tmp_path / "old.txt"
    write_text(path, "old")
    script = (
        "import os, signal, sys\n"
        "from reference.storage.files import atomic_path\n"
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


def test_a_block_that_writes_nothing_fails(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_path(tmp_path / "a.txt"):
        pass
    assert not (tmp_path / "a.txt").exists()


def test_permissions_follow_the_umask(tmp_path):
    old = os.umask(0o022)
    try:
        write_text(tmp_path / "a.txt", "")
    finally:
        os.umask(old)
    assert (tmp_path / "a.txt").stat().st_mode & 0o777 == 0o644


def test_a_link_stays_a_link(tmp_path):
    write_text(tmp_path / "real.txt", "old")
    (tmp_path / "link.txt").symlink_to("real.txt")
    write_text(tmp_path / "link.txt", "new")
    assert (tmp_path / "link.txt").is_symlink()
    assert (tmp_path / "real.txt").read_text() == "new"


def test_makes_missing_folders(tmp_path):
    assert ensure_folder(tmp_path / "a" / "b") == tmp_path / "a" / "b"
    write_text(tmp_path / "c" / "d.txt", "x")
    assert (tmp_path / "a" / "b").is_dir()
    assert list((tmp_path / "a" / "b").iterdir()) == []
    assert (tmp_path / "c" / "d.txt").read_text() == "x"


def test_refuses_a_folder_that_is_a_file(tmp_path):
    write_text(tmp_path / "file", "x")
    for folder in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(InputError, match=r"file is not a folder; give another place"):
            ensure_folder(folder)
    assert (tmp_path / "file").read_text() == "x"


def test_refuses_a_folder_that_cannot_be_written():
    # /proc refuses new files whoever asks, the superuser too.
    if not os.path.isdir("/proc/self"):
        pytest.skip("needs the /proc of Linux")
    for folder in ("/proc/self", "/proc/new-folder"):
        with pytest.raises(InputError, match=r"cannot write into the folder /proc.*; give a folder") as caught:
            ensure_folder(folder)
        assert "\n" not in str(caught.value)


def test_refuses_targets_that_are_no_files(tmp_path):
    with pytest.raises(InputError, match="it is a folder"):
        ensure_writable(tmp_path)
    # Moving a file over a device replaces the device.
    with pytest.raises(InputError, match="not a regular file"):
        write_text("/dev/null", "x")
    assert not os.path.isfile("/dev/null")
    with pytest.raises(InputError, match="cannot write"):
        write_text("a\0b/c", "x")


@pytest.mark.claim("files-whole-or-not-at-all")
def test_a_full_disk_names_the_file_and_leaves_it(tmp_path):
    """A limit on the size of a file stands for the disk; a failed write does not name a file by itself."""
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


def test_temporary_folders_of_killed_processes_are_removed_after_a_day(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "airlight-report").mkdir()
    with temporary_folder() as first:
        os.utime(first, (1, 1))
        os.utime(tmp_path / "airlight-report", (1, 1))
        with temporary_folder() as second:
            assert [first.exists(), second.exists()] == [False, True]
        first.mkdir()  # its own block removes it too
    assert [path.name for path in tmp_path.iterdir()] == ["airlight-report"]
