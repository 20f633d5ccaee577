# SPDX-License-Identifier: BSD-3-Clause
"""The process that computes the reference of what the view shows, and yields the processor to it.

A new task ends the one before it, at the next of its chunks. The process ends with the other end of its pipe, however
the view has ended.
"""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from typing import Any

import numpy as np

from validation.scenes.changes import Values

_CHUNK = 0.25  # approximate time for the rays between two looks for a new task [s]
_FIRST, _MOST = 256, 20000  # rays


@dataclass(frozen=True)
class Task:
    """A reference to compute."""

    number: int
    scene: str  #: name or path
    size: tuple[int, int]  #: [pixels]
    changes: dict[str, Values]  #: `validation.scenes.changes`
    most: int | None = None  #: pixels, by chance; None: all, in their order


@dataclass(frozen=True)
class Answer:
    """What was found for a task: rays, the end, or why there is no reference."""

    task: int
    pixels: Any = None  #: numbers of pixels, (rays,)
    airlight: Any = None  #: (rays, 3) [W/(m^2 sr)]
    surface: Any = None  #: (rays, 3) [W/(m^2 sr)]
    bound: Any = None  #: of the error of the airlight, and twice its standard error, (rays, 3) [W/(m^2 sr)]
    done: bool = False
    failure: str = ""


def yield_processor() -> None:
    """Let this process run only when nothing else wants to, where the system knows that, else seldom."""
    with suppress(OSError, AttributeError):
        os.nice(19)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def answers(task: Task) -> Iterator[Answer]:
    """Yield the reference of an image, rays after rays."""
    from reports.view.reference_order import pixel_order
    from validation.estimates.quadrature import reference_error, reference_of_pixels
    from validation.scenes.loading import load_scene

    scene = load_scene(task.scene, task.size, task.changes).scene
    order = pixel_order(*task.size)
    if task.most is not None:  # others for each frame
        order = np.random.default_rng(task.number).permutation(order)[: task.most]
    begin, rays = 0, _FIRST
    while begin < len(order):
        chosen = order[begin : begin + rays]
        start = time.perf_counter()
        found = reference_of_pixels(scene, chosen)
        taken = time.perf_counter() - start
        begin += len(chosen)
        rays = int(np.clip(rays * np.clip(_CHUNK / max(taken, 1e-3), 0.25, 2), 16, _MOST))
        # The lights that the camera sees are left out: the frames beside this show none.
        layers = found.airlight, found.surface, found.airlight_bound
        airlight, surface, bound = (layer.reshape(-1, 3) for layer in layers)
        error = reference_error(found, "airlight")
        if error is not None:
            bound = bound + 2 * error.reshape(-1, 3)
        yield Answer(task.number, chosen, airlight, surface, bound)
    yield Answer(task.number, done=True)


def compute(pipe: Connection, variant: str) -> None:
    """Answer the tasks of a pipe, the newest first and alone; None for nothing to do."""
    from analytic.errors import InputError
    from reports.machine.environment import activate
    from reports.machine.process_start import default_signals

    default_signals()
    with suppress(OSError, AttributeError):
        os.setsid()  # Ctrl-C reaches the view alone, which ends this
    os.dup2(2, 1)  # what is printed
    yield_processor()
    activate(variant)
    with suppress(EOFError, OSError):  # the view has ended
        while True:
            task: Task | None = pipe.recv()
            while pipe.poll():
                task = pipe.recv()
            try:
                for answer in () if task is None else answers(task):
                    if pipe.poll():
                        break
                    pipe.send(answer)
            except InputError as error:
                pipe.send(Answer(task.number if task else 0, failure=" ".join(str(error).split())))
