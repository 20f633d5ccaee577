# SPDX-License-Identifier: BSD-3-Clause
"""The clock and the scales: what work on the device takes, and how much memory it holds.

A time runs from the call until the arrays are ready on the device (`drjit.sync_thread`), by `analytic.clock`: a user
also waits for launch and replay. Repeated times come after a warm-up, in which kernels are compiled and recorded, as
medians with quartiles.
"""

import ctypes
import gc
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, TypeVar

import drjit as dr
import numpy as np

from analytic.clock import Spent, stopwatch
from validation.timing import Timing

_MIB = 1024  # of the numbers in `status` [KiB]
_FORGET = "5"  # what makes Linux forget the peak so far

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, Spent]:
    """Do some work and return what it gave, and what it took until its arrays are ready."""
    took = stopwatch()
    value = work()
    dr.sync_thread()
    return value, took()


def time_repeated(
    work: Callable[[], Any], *, seconds: float = 0.6, least: int = 5, most: int = 200, warm_up: int = 2
) -> Timing:
    """Time a piece of work repeatedly.

    It takes about so many `seconds`, and `least` to `most` repetitions, after some runs of `warm_up`: the first
    compiles and records, the second is the first replay.
    """
    (timing,) = time_in_turns([work], seconds=seconds, least=least, most=most, warm_up=warm_up)
    return timing


def time_in_turns(
    works: Sequence[Callable[[], Any]], *, seconds: float = 3.0, least: int = 5, most: int = 200, warm_up: int = 2
) -> list[Timing]:
    """Time several pieces of work in turns, so that other load on the machine affects all of them alike.

    Parameters are those of `time_repeated`; `seconds`, `least` and `most` are of all turns together.
    """
    for _ in range(warm_up):
        for work in works:
            timed(work)
    turns: list[list[Spent]] = []
    so_far = stopwatch()
    while len(turns) < least or (so_far().seconds < seconds and len(turns) < most):
        turns.append([timed(work)[1] for work in works])
    return [
        timing_of([each.ms for each in spent], cpu_ms=min(each.cpu_ms for each in spent))
        for spent in zip(*turns, strict=True)
    ]


def timing_of(milliseconds: Iterable[float], *, cpu_ms: float | None = None) -> Timing:
    """Return median and quartiles of some times [ms]."""
    times = list(milliseconds)
    low, median, high = (float(value) for value in np.percentile(times, [25, 50, 75]))
    return Timing(median, low, high, len(times), cpu_ms)


def peak_memory(work: Callable[[], Any]) -> float | None:
    """Return how much more memory the process holds at the peak of `work` than before it [MiB].

    Memory that `work` frees before it ends counts; memory that was freed before does not. None where the system does
    not say: only Linux lets a process forget an earlier peak.
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


def _status(key: str) -> int:
    """Return a size that Linux knows of this process [KiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(f"{key}:"))
