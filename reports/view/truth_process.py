# SPDX-License-Identifier: BSD-3-Clause
"""The process that computes the reference of what the view shows, and yields the processor to it.

It reads tasks from its input and writes what it finds to its output, as pickles. A new task ends the one before it, at
the next of its chunks. It ends when its input does, however the view has ended.
"""

import os
import pickle
import queue
import threading
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO

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
    from reports.view.truth_order import pixel_order
    from validation.estimates.quadrature import reference_error, truth_of_pixels
    from validation.scenes.loading import load_scene

    scene = load_scene(task.scene, task.size, task.changes).scene
    order = pixel_order(*task.size)
    begin, rays = 0, _FIRST
    while begin < len(order):
        chosen = order[begin : begin + rays]
        start = time.perf_counter()
        found = truth_of_pixels(scene, chosen)
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


def serve(tasks: "queue.Queue[Task | None]", output: BinaryIO) -> None:
    """Answer tasks, the newest first and alone; None for nothing to do."""
    from analytic.errors import InputError

    while True:
        task = _newest(tasks)
        if task is None:
            continue
        try:
            for answer in answers(task):
                if not tasks.empty():
                    break
                _write(output, answer)
        except InputError as error:
            _write(output, Answer(task.number, failure=" ".join(str(error).split())))


def _newest(tasks: "queue.Queue[Task | None]") -> Task | None:
    task = tasks.get()
    while not tasks.empty():
        task = tasks.get()
    return task


def _write(output: BinaryIO, answer: Answer) -> None:
    try:
        pickle.dump(answer, output)
        output.flush()
    except OSError:  # the view has ended
        os._exit(0)


def _read(given: BinaryIO, tasks: "queue.Queue[Task | None]") -> None:
    """Hand tasks on, and end with the process that sends them."""
    with suppress(EOFError, OSError):
        while True:
            tasks.put(pickle.load(given))
    os._exit(0)


def main() -> None:
    """Serve the process that started this one."""
    from reports.machine.environment import activate
    from reports.machine.signals import default_signals

    default_signals()
    given = os.fdopen(os.dup(0), "rb")
    output = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what is printed does not come between answers
    tasks: queue.Queue[Task | None] = queue.Queue()
    threading.Thread(target=_read, args=(given, tasks), daemon=True).start()
    yield_processor()
    activate()
    serve(tasks, output)
