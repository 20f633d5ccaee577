# SPDX-License-Identifier: BSD-3-Clause
"""The time and memory of a command, estimated from counts before it starts, so that
they are not a surprise.

The costs are those of one processor thread, measured on two threads of an AMD EPYC on 22 November
2026 and rounded; a scene can be some times cheaper or costlier, and a machine faster or slower.
That is enough to share a progress bar out among its parts, and for a note where a command may take
minutes. A command is refused for its time only where the least that it needs takes longer than an
hour on threads that are ten times as fast, too. Whether one frame keeps a limit is another
question: the code of a user's method cannot be counted, and `validation.study.run` times a small
frame instead.
"""

import os
from collections.abc import Iterable
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi

from airlight.errors import InputError
from airlight.realtime.memory import usable_memory
from airlight.reference.quadrature.image import light_samples_of_ray, rays_of_pixel

TIMED = 8  #: frames that timing takes where they are slow


@dataclass(frozen=True)
class Work:
    """The estimated cost of some work."""

    seconds: float  #: on one thread; the least where errors decide how much there is to do
    memory: float = 0.0  #: at most at once [bytes]
    #: seconds on one thread where errors ask for the most; None if that is the same
    most: float | None = None


def frame_work(
    size: tuple[int, int], *, lights: int = 1, steps: float = 0, frames: float = TIMED
) -> Work:
    """Return the work of some frames of a size [pixels] by a method that marches with so
    many steps, or with none.
    """
    pixels = float(size[0]) * size[1]
    # A step of a marched ray; a ray of any other method, by light [s]; memory by pixel [bytes].
    step, ray, frame_bytes = 40e-9, 2e-6, 200
    return Work(frames * pixels * max(lights, 1) * max(steps * step, ray), pixels * frame_bytes)


def reference_work(
    size: tuple[int, int], *, lights: int = 1, area_lights: int = 0, pixel: str = "centre"
) -> Work:
    """Return the work of an image of the quadrature reference, at pixel centres or of
    means over areas of pixels.
    """
    pixels = float(size[0]) * size[1]
    # By ray and light at a place or in a direction, and by ray and sample of an area light: 6 to
    # 19 us in four scenes on 29 November 2026 [s]. Errors decide how many rays and samples there
    # are: the least and the most.
    of_light, of_sample, reference_bytes = 100e-6, 10e-6, 1500
    least, most = (
        pixels * rays * (max(lights, 1) * of_light + area_lights * samples * of_sample)
        for rays, samples in zip(rays_of_pixel(pixel), light_samples_of_ray(pixel))
    )
    return Work(least, pixels * reference_bytes, most)


def sampled_work(
    size: tuple[int, int], samples: float, *, lights: int = 1, clouds: bool = False
) -> Work:
    """Return the work of an image by random samples, so many in each pixel for each light, each a
    path through clouds or one step.
    """
    pixels = float(size[0]) * size[1]
    # A sample of single-scatter and volpath, and a path through a cloud [s].
    of_sample, of_path, sampled_bytes = 1e-6, 20e-6, 500
    count = pixels * samples * max(lights, 1)
    return Work(count * (of_path if clouds else of_sample), pixels * sampled_bytes)


def check_work(what: str, works: Iterable[Work]) -> tuple[str, ...]:
    """Refuse what would take more than an hour on any machine, or more memory than there
    is, unless it is forced.

    `what` is asked for, as the message begins, which gives the estimated time, the memory and what
    to do. Returns notes for the user: how long the command may take, if that is more than a minute.
    """
    works = list(works)
    # A GPU replaces a hundred threads. Works follow one another: times add up, and the memory is
    # the largest of them.
    gpu = 100.0
    threads = gpu if (mi.variant() or "").startswith("cuda") else max(1, dr.thread_count())
    least = sum(work.seconds for work in works) / threads
    most = sum(work.seconds if work.most is None else work.most for work in works) / threads
    memory = max((work.memory for work in works), default=0.0)
    usable = usable_memory()
    forced = os.environ.get("AIRLIGHT_FORCE", "0") not in ("", "0")
    # The fastest thread against the measured one: twice its clock, twice the width of its vectors,
    # and a scene that is two and a half times cheaper than most. A command that takes more than an
    # hour on that one, too, must be forced [s].
    faster, longest = 10.0, 3600.0
    reasons = []
    if least > longest * faster and not forced:
        reasons.append(
            f"would take about {_duration(least)} at the speed of one machine, and more than an "
            f"hour at {faster:g} times that speed"
        )
    if usable is not None and memory > usable.size and not forced:
        reasons.append(f"needs about {memory / 1e9:.3g} GB of memory, of which {usable}")
    if reasons:
        raise InputError(
            f"{what}: {' and '.join(reasons)}; ask for less, or set AIRLIGHT_FORCE=1 to start it"
        )
    # From a minute on a user would rather know before than wait.
    if most <= 60.0:
        return ()
    time = (
        f"about {_duration(most)}"
        if most < 1.1 * least
        else f"between {_duration(least)} and {_duration(most)}"
    )
    words = (
        "by its rays and samples and the speed of one machine; another machine or scene may take "
        "several times that"
    )
    return (f"{what}: {time} {words}",)


def _duration(seconds: float) -> str:
    if seconds < 3600:
        return f"{seconds:.2g} seconds" if seconds < 100 else f"{seconds / 60:.2g} minutes"
    hours = seconds / 3600
    if hours < 48:
        return f"{hours:.2g} hours"
    days = hours / 24
    return f"{days:.0f} days" if days < 730 else f"{days / 365:.3g} years"
