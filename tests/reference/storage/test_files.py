# SPDX-License-Identifier: BSD-3-Clause
import os
import resource
import subprocess
import sys

import pytest

from analytic.errors import InputError
from reference.storage.files import (
    atomic_path,
    ensure_folder,
    write_bytes,
    write_text,
)


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


def test_refuses_a_folder_that_is_a_file(tmp_path):
    write_text(tmp_path / "file", "x")
    for folder in (tmp_path / "file", tmp_path / "file" / "below" / "it"):
        with pytest.raises(InputError, match=r"file is not a folder; give another place"):
            ensure_folder(folder)
    assert (tmp_path / "file").read_text() == "x"


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
