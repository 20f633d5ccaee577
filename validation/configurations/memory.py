# SPDX-License-Identifier: BSD-3-Clause
"""The peak of the memory of this process while something is done."""

import ctypes
import gc
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import drjit as dr

_MIB = 1024  # of the numbers in `status` [KiB]
_FORGET = "5"  # what makes Linux forget the peak so far


def peak_memory(work: Callable[[], Any]) -> float | None:
    """Return how much more memory the process holds at the peak of `work` than before it [MiB].

    What it frees before it ends counts, what was freed before it began does not. None where the system does not say:
    only Linux lets a process forget an earlier peak.
    """
    dr.sync_thread()
    gc.collect()
    dr.flush_malloc_cache()
    with suppress(OSError, AttributeError):  # what the allocator keeps free would hide what small frames take
        ctypes.CDLL(None).malloc_trim(0)
    try:
        Path("/proc/self/clear_refs").write_text(_FORGET)
        before = _status("VmRSS")
    except OSError:
        return None
    work()
    dr.sync_thread()
    return (_status("VmHWM") - before) / _MIB


def largest_memory() -> float | None:
    """Return the most memory that the process has held so far [MiB]; None where the system does not say."""
    try:
        return _status("VmHWM") / _MIB
    except OSError:
        return None


def _status(key: str) -> int:
    """Return a size that Linux knows of this process [KiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{key}:"))
