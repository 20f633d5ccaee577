# SPDX-License-Identifier: BSD-3-Clause
"""Refuses work that needs more memory than there is for it, before it allocates any."""

import ctypes
import os
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

import mitsuba as mi

from airlight.errors import InputError

_CGROUPS = Path("/sys/fs/cgroup")
_OWN_CGROUPS = Path("/proc/self/cgroup")


@dataclass(frozen=True)
class Memory:
    """The memory in which work must fit."""

    size: int  #: bytes
    words: str  #: whose it is, as in '..., this machine has 8 GB'

    def __str__(self) -> str:
        return f"{self.words} {self.size / 1e9:.3g} GB"


def usable_memory() -> Memory | None:
    """Return the GPU's memory with a CUDA variant, else the machine's or what its
    container may use of it.

    None if the system does not tell.
    """
    if (mi.variant() or "").startswith("cuda"):
        size = _gpu_memory()
        return None if size is None else Memory(size, "the GPU has")
    # The least of the machine and the groups counts: a container sees all of the machine.
    sizes = []
    with suppress(AttributeError, ValueError, OSError):
        sizes.append(
            Memory(os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE"), "this machine has")
        )
    sizes += [Memory(size, "this container may use") for size in _cgroup_limits()]
    return min(sizes, key=lambda memory: memory.size, default=None)


def check_memory(what: str, needed: int, advice: str) -> None:
    """Raise an error if work needs more memory than there is.

    Parameters
    ----------
    what
        The work that the user asked for, as the message begins.
    needed
        Memory that the work needs [bytes].
    advice
        A way out for the user, as the message ends.

    Raises
    ------
    InputError
        If there is less memory.
    """
    memory = usable_memory()
    if memory is not None and needed > memory.size:
        raise InputError(f"{what}: needs {needed / 1e9:.3g} GB of memory, {memory}; {advice}")


def _cgroup_limits() -> list[int]:
    """Return the limits of this process's control groups and of those above them
    [bytes]: versions 1 and 2.
    """
    limits = []
    with suppress(OSError):
        for line in _OWN_CGROUPS.read_text().splitlines():
            # "hierarchy:controllers:path"; version 2 has one hierarchy, which names no controllers.
            _, controllers, path = line.split(":", 2)
            if controllers == "":
                root, name = _CGROUPS, "memory.max"
            elif "memory" in controllers.split(","):
                root, name = _CGROUPS / "memory", "memory.limit_in_bytes"
            else:
                continue
            # In a container the path may be the machine's, and the container sees its root alone.
            for group in (PurePosixPath(path), *PurePosixPath(path).parents):
                with suppress(OSError, ValueError):  # no such file; 'max'
                    limits.append(int((root / str(group).lstrip("/") / name).read_text()))
    return limits


def _gpu_memory() -> int | None:
    """Return the memory of the GPU that Dr.Jit uses [bytes], as its driver
    tells; None if it does not.
    """
    with suppress(OSError, AttributeError):
        cuda = ctypes.CDLL(os.environ.get("DRJIT_LIBCUDA_PATH") or "libcuda.so.1")
        device, size = ctypes.c_int(), ctypes.c_size_t()
        failed = cuda.cuInit(0) or cuda.cuDeviceGet(ctypes.byref(device), 0)
        if not failed and not cuda.cuDeviceTotalMem_v2(ctypes.byref(size), device):
            return size.value
    return None
