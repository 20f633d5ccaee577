# SPDX-License-Identifier: BSD-3-Clause
"""The time and memory of a command, estimated from counts before it starts, so that they are not a surprise.

The costs are those of one processor thread, measured on two threads of an AMD EPYC on 22 November 2026 and rounded; a
scene can be some times cheaper or costlier, and a machine faster or slower. That is enough to share a progress bar out
among its parts. A command is refused for its time only where it would take longer than an hour on threads that are
`_FASTER` times as fast, too. Whether one frame keeps a limit is another question: the code of a user's method cannot be
counted, and `validation.study.run` times a small frame instead.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from analytic.errors import InputError
from realtime.memory import usable_memory

LONGEST = 3600.0  #: seconds that a command may take at least without being forced

_STEP = 40e-9  # of a marched ray [s]
_RAY = 2e-6  # of any other method, by light [s]
_REFERENCE = 100e-6  # of the quadrature, by ray [s]
_SAMPLE = 1e-6  # of single-scatter and volpath [s]
_PATH = 20e-6  # of a path through a cloud [s]
_GPU = 100.0  # threads that a GPU replaces
#: The fastest thread against the measured one, with twice its clock, twice the width of its vectors, and a scene that
#: is two and a half times cheaper than most.
_FASTER = 10.0
TIMED = 8  #: frames that timing takes where they are slow
_FRAME_BYTES, _REFERENCE_BYTES, _SAMPLED_BYTES = 200, 1500, 500  # by pixel


@dataclass(frozen=True)
class Work:
    """The estimated cost of some work."""

    seconds: float  #: on one thread
    memory: float = 0.0  #: at most at once [bytes]


def frame_work(size: tuple[int, int], *, lights: int = 1, steps: float = 0, frames: float = TIMED) -> Work:
    """Return the work of some frames of a size [pixels] by a method that marches with so many steps, or with none."""
    pixels = float(size[0]) * size[1]
    return Work(frames * pixels * max(lights, 1) * max(steps * _STEP, _RAY), pixels * _FRAME_BYTES)


def reference_work(size: tuple[int, int], *, lights: int = 1, images: float = 1) -> Work:
    """Return the work of some images of the quadrature reference."""
    pixels = float(size[0]) * size[1]
    return Work(images * pixels * max(lights, 1) * _REFERENCE, pixels * _REFERENCE_BYTES)


def sampled_work(size: tuple[int, int], samples: float, *, clouds: bool = False) -> Work:
    """Return the work of an image by random samples, so many in each pixel, each a path through clouds or one step."""
    pixels = float(size[0]) * size[1]
    return Work(pixels * samples * (_PATH if clouds else _SAMPLE), pixels * _SAMPLED_BYTES)


def check_work(what: str, works: Iterable[Work]) -> None:
    """Refuse what would take more than an hour on any machine, or more memory than there is, unless it is forced.

    `what` is asked for, as the message begins, which gives the least time, the memory and what to do.
    """
    works = list(works)
    if os.environ.get("AIRLIGHT_FORCE", "0") not in ("", "0") or not works:
        return
    threads = _GPU if (mi.variant() or "").startswith("cuda") else max(1, dr.thread_count())
    seconds = sum(work.seconds for work in works) / (threads * _FASTER)
    memory = max(work.memory for work in works)
    usable = usable_memory()
    reasons = []
    if seconds > LONGEST:
        reasons.append(f"would take {_duration(seconds)} at least")
    if usable is not None and memory > usable.size:
        reasons.append(f"needs about {memory / 1e9:.3g} GB of memory, of which {usable}")
    if reasons:
        raise InputError(f"{what}: {' and '.join(reasons)}; ask for less, or set AIRLIGHT_FORCE=1 to start it")


def _duration(seconds: float) -> str:
    hours = seconds / 3600
    if hours < 48:
        return f"{hours:.2g} hours"
    days = hours / 24
    return f"{days:.0f} days" if days < 730 else f"{days / 365:.3g} years"
