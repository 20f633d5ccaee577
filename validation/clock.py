# SPDX-License-Identifier: BSD-3-Clause
"""The clock and the scales: what work takes, by the wall clock and of the processors, and how much memory it holds.

A time runs from the call until the arrays are ready on the device (`drjit.sync_thread`). It is that of the wall clock
on purpose: a user also waits for launch and replay. The processor time of all threads is beside it: other load on the
machine changes it least. Repeated times come after a warm-up, in which kernels are compiled and recorded, as medians
with quartiles.
"""

import ctypes
import gc
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, NamedTuple

import drjit as dr
import numpy as np

from validation.timing import Timing

_MIB = 1024  # of the numbers in `status` [KiB]
_FORGET = "5"  # what makes Linux forget the peak so far


class Took(NamedTuple):
    """The times of work."""

    ms: float  #: by the wall clock [ms]
    cpu_ms: float  #: of the processors, of all threads [ms]


class Run(NamedTuple):
    """The result of work, and its times."""

    value: Any
    ms: float  #: by the wall clock [ms]
    cpu_ms: float  #: of the processors, of all threads [ms]


def stopwatch() -> Callable[[], Took]:
    """Return a function that says what was taken since now, until all arrays are ready."""
    begin, spent = time.perf_counter(), time.process_time()

    def took() -> Took:
        dr.sync_thread()
        return Took(1e3 * (time.perf_counter() - begin), 1e3 * (time.process_time() - spent))

    return took


def timed(work: Callable[[], Any]) -> Run:
    """Do some work and return what it gave, with the times until its arrays are ready."""
    took = stopwatch()
    value = work()
    return Run(value, *took())


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
    turns: list[list[Run]] = []
    stop = time.perf_counter() + seconds
    while len(turns) < least or (time.perf_counter() < stop and len(turns) < most):
        turns.append([timed(work) for work in works])
    return [
        timing_of([run.ms for run in runs], cpu_ms=min(run.cpu_ms for run in runs)) for runs in zip(*turns, strict=True)
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
