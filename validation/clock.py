# SPDX-License-Identifier: BSD-3-Clause
"""The clock and the scales: what work on the device takes, and how much memory it holds.

A time runs from the call until the arrays are ready on the device (`drjit.sync_thread`), by
`analytic.clock`: a user also waits for launch and replay. Repeated times come after a warm-up, in
which kernels are compiled and recorded, as medians with quartiles.
"""

import ctypes
import gc
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path
from typing import Generic, TypeVar

import drjit as dr
import numpy as np

from airlight.analytic.clock import Spent, stopwatch
from airlight.validation.timing import Timing

#: In which pieces of work take turns: five ends of rounds show a change of the machine that lasts a
#: fifth of a run, and the median of five is not moved by two that it spoiled.
ROUNDS = 5

_MIB = 1024  # of the numbers in `status` [KiB]
_FORGET = "5"  # what makes Linux forget the peak so far

T = TypeVar("T")


def timed(work: Callable[[], T]) -> tuple[T, Spent]:
    """Do some work; return its result, and the time until its arrays are ready."""
    took = stopwatch()
    value = work()
    dr.sync_thread()
    return value, took()


def time_repeated(
    work: Callable[[], object],
    *,
    seconds: float = 0.6,
    least: int = 5,
    most: int = 200,
) -> Timing:
    """Time a piece of work repeatedly: for about so many `seconds`, and `least` to `most` times."""
    (timing,) = time_in_turns([work], seconds=seconds, least=least, most=most)
    return timing


def time_in_turns(
    works: Sequence[Callable[[], object]],
    *,
    seconds: float = 3.0,
    least: int = 5,
    most: int = 200,
    warm_up: int = 2,
) -> list[Timing]:
    """Time several pieces of work in turns, so that other load on the machine
    affects all of them alike.

    `seconds` are of all works together, `least` and `most` the repetitions of each. The first
    `warm_up` runs do not count: the first compiles and records, the second is the first replay.
    """
    for _ in range(warm_up):
        for work in works:
            timed(work)
    share = seconds / max(len(works), 1)
    pieces = [Piece(partial(_spent, work), share) for work in works]
    return [timing_of(list(chain(*rounds))) for rounds in in_turns(pieces, rounds=least, most=most)]


@dataclass(frozen=True)
class Piece(Generic[T]):
    """A piece of work that takes turns with others."""

    work: Callable[[], T]  #: does it once, and returns the time that it took
    seconds: float  #: for all rounds together; it is done once a round at least
    rounds: int | None = None  #: the number of rounds in which it takes part, None for all


def in_turns(
    pieces: Sequence[Piece[T]], *, rounds: int = ROUNDS, most: int = 200
) -> list[list[list[T]]]:
    """Do pieces of work in turns and return their results: by piece, by round in which the piece
    takes part, by repetition.

    In each round a piece is repeated until its part of its seconds is over: the caches of the
    machine then hold its data, as in an animation. The rounds of a piece that takes part in few of
    them are spread evenly. `most` is the largest number of repetitions in all rounds together.
    """
    results: list[list[list[T]]] = [[] for _ in pieces]
    for number in range(rounds):
        for piece, of_rounds in zip(pieces, results, strict=True):
            share = rounds if piece.rounds is None else piece.rounds
            if (number + 1) * share // rounds == number * share // rounds:
                continue
            # By the end of this round it may have been done so often.
            largest = most * (number + 1) // rounds - sum(map(len, of_rounds))
            took, repetitions = stopwatch(), [piece.work()]
            while len(repetitions) < largest and took().seconds < piece.seconds / rounds:
                repetitions.append(piece.work())
            of_rounds.append(repetitions)
    return results


def _spent(work: Callable[[], object]) -> Spent:
    return timed(work)[1]


def timing_of(spent: Sequence[Spent]) -> Timing:
    """Return median and quartiles of the times of repetitions, and their least processor time."""
    low, median, high = (
        float(value) for value in np.percentile([each.ms for each in spent], [25, 50, 75])
    )
    return Timing(median, low, high, len(spent), min(each.cpu_ms for each in spent) or None)


def peak_memory(work: Callable[[], object]) -> float | None:
    """Return how much more memory the process holds at the peak of `work` than before it [MiB].

    Memory that `work` frees before it ends counts; memory that was freed before does not. None
    where the system does not say: only Linux lets a process forget an earlier peak.
    """
    dr.sync_thread()
    gc.collect()
    dr.flush_malloc_cache()
    # what the allocator keeps free would hide what small frames take
    with suppress(OSError, AttributeError):
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
