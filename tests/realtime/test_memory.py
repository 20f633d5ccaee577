# SPDX-License-Identifier: BSD-3-Clause
"""Work may use the least of the machine's memory and its containers' limits,
and with CUDA the GPU's.
"""

import os

import pytest

import airlight.realtime.memory
from airlight.errors import InputError
from airlight.realtime.memory import Memory, check_memory, usable_memory

MACHINE = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")


@pytest.fixture
def limits(variant, tmp_path, monkeypatch):
    """A function that sets what /proc/self/cgroup says, and the files of /sys/fs/cgroup."""

    def write(own, files):
        (tmp_path / "self").write_text(own)
        for name, text in files.items():
            (tmp_path / "cgroup" / name).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / "cgroup" / name).write_text(text)

    monkeypatch.setattr(airlight.realtime.memory, "_OWN_CGROUPS", tmp_path / "self")
    monkeypatch.setattr(airlight.realtime.memory, "_CGROUPS", tmp_path / "cgroup")
    monkeypatch.setattr(airlight.realtime.memory.mi, "variant", lambda: "llvm_ad_rgb")
    return write


@pytest.mark.parametrize(
    ("own", "files", "least"),
    [
        (
            "0::/a/b\n",
            {"a/b/memory.max": "max\n", "a/memory.max": "2000000\n", "memory.max": "max"},
            2 * 10**6,
        ),
        # Docker without a namespace of its own: the path is the machine's, and is not there.
        ("0::/docker/0123\n", {"memory.max": "3000000\n"}, 3 * 10**6),
        (
            "5:cpu:/a\n4:memory:/a\n0::/\n",
            {"memory/a/memory.limit_in_bytes": "4000000\n"},
            4 * 10**6,
        ),
        ("0::/\n", {"memory.max": "max\n"}, MACHINE),
    ],
)
def test_the_least_limit_counts(limits, own, files, least):
    limits(own, files)
    assert usable_memory() == Memory(
        least, "this machine has" if least == MACHINE else "this container may use"
    )


def test_the_message_names_the_container(limits):
    limits("0::/\n", {"memory.max": "2000000000"})
    check_memory("map: 9", 2 * 10**9, "use a smaller map")
    message = r"^map: 9: needs 3 GB of memory, this container may use 2 GB; use a smaller map$"
    with pytest.raises(InputError, match=message):
        check_memory("map: 9", 3 * 10**9, "use a smaller map")
