# SPDX-License-Identifier: BSD-3-Clause
"""The reference of what is shown: in which order its pixels come, and the process that computes it.

Pixels of a coarse grid come first, then pixels of grids of half its step. Within a grid the order
is random, so that what is known is a fair sample of the image at any time, and the picture of it
grows sharper. The process yields the processor to the view. A new task ends the one before it, at
the next of its chunks; the process ends with the other end of its pipe, however the view has ended.
"""

import os
import sys
import threading
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.connection import Connection
from types import ModuleType
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import stopwatch
from airlight.validation.metrics.errors import error_metrics
from airlight.validation.scenes.changes import Values

Array = NDArray[np.float64]
STEPS = (16, 8, 4, 2, 1)


def pixel_order(width: int, height: int) -> NDArray[np.int64]:
    """Return the numbers of all pixels in their order, (pixels,)."""
    # Each pixel has the level of the coarsest grid that it lies on: from the finest to the
    # coarsest, each overwrites. Within a level the order is random, with one seed.
    row, column = np.divmod(np.arange(width * height), width)
    level = np.full(width * height, len(STEPS) - 1)
    for number, step in reversed(list(enumerate(STEPS))):
        level[(row % step == 0) & (column % step == 0)] = number
    return np.lexsort([np.random.default_rng(0).random(width * height), level])


@dataclass(frozen=True)
class KnownReference:
    """The known part of the reference of an image; the rest is NaN."""

    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    surface: Array  #: [W/(m^2 sr)]
    #: error of the airlight; with area lights, and twice its standard error [W/(m^2 sr)]
    error: Array

    @staticmethod
    def of_size(width: int, height: int) -> "KnownReference":
        """Return a reference of which nothing is known."""
        return KnownReference(*(np.full((height, width, 3), np.nan) for _ in range(3)))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which pixels are known, (height, width)."""
        return np.isfinite(self.airlight[..., 0])

    def add(self, pixels: NDArray[np.int64], airlight: Array, surface: Array, error: Array) -> None:
        """Note the reference of some pixels, (pixels, 3) each."""
        for layer, values in (
            (self.airlight, airlight),
            (self.surface, surface),
            (self.error, error),
        ):
            layer.reshape(-1, 3)[pixels] = values

    def filled(self, layer: Array) -> Array:
        """Return a layer of the reference, or of a frame; pixels that are not known
        take a near one that is.
        """
        # The finest grid that is known as a whole; a pixel takes the corner of its cell.
        known = self.known
        step = next((step for step in reversed(STEPS) if known[::step, ::step].all()), None)
        if step is None:
            return np.where(known[..., None], layer, 0)
        rows, columns = (np.arange(size) // step * step for size in known.shape)
        return np.where(known[..., None], layer, layer[np.ix_(rows, columns)])


@dataclass(frozen=True)
class ViewError:
    """The error of the airlight of a frame against what is known of its
    reference, over the mean of that.
    """

    relative_rmse: float | None
    #: half of the 95 % interval of that, for the pixels that are not known yet
    interval: float | None
    relative_bias: float | None
    p99: float | None  #: see `validation.metrics.errors`
    #: root mean square of the reference's own error: the most by which it changes the error
    own_error: float | None
    known: int  #: pixels
    pixels: int


def view_error(found: KnownReference, airlight: Array) -> ViewError | None:
    """Return the error of the airlight of a frame, (height, width, 3) [W/(m^2 sr)];
    None if nothing is known.
    """
    # Errors over the known pixels, a random sample of all.
    known = found.known
    count, pixels = int(known.sum()), known.size
    if count == 0:
        return None
    reference, test = found.airlight[known], np.asarray(airlight, dtype=np.float64)[known]
    metrics = error_metrics(reference[None], test[None])
    # Pixels that are not finite are in no error, as in the metrics.
    finite = (np.isfinite(reference) & np.isfinite(test)).all(axis=1)
    if not finite.any():
        return ViewError(None, None, None, None, None, count, pixels)
    mean = float(reference[finite].mean())
    square = np.mean((test - reference)[finite] ** 2, axis=1)
    # The standard error of the mean square, without replacement: it is zero when all pixels are
    # known. The error of its root is half of that over the root.
    spread = float(square.std()) / np.sqrt(len(square)) * np.sqrt(1 - count / pixels)
    rmse = float(np.sqrt(square.mean()))
    interval = 1.96 * spread / (2 * rmse) if rmse > 0 else 0.0
    # The reference's own error, which no number of pixels removes.
    own_error = float(np.sqrt(np.mean(found.error[known] ** 2)))
    return ViewError(
        metrics.relative_rmse,
        interval / mean if mean > 0 else None,
        metrics.relative_bias,
        metrics.p99,
        own_error / mean if mean > 0 else None,
        count,
        pixels,
    )


def motion_error(errors: Sequence[ViewError]) -> tuple[float, float]:
    """Return the root mean square of the errors of frames, and half of its 95 % interval
    for the pixels left out.
    """
    rmse, halves = (
        np.array([getattr(each, name) for each in errors]) for name in ("relative_rmse", "interval")
    )
    # Half intervals of independent frames add in quadrature, each weighted by its own error.
    mean = float(np.sqrt(np.mean(rmse**2)))
    return mean, float(np.linalg.norm(rmse * halves)) / (len(errors) * mean) if mean > 0 else 0.0


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
    """The answer to a task: rays, the end, or why there is no reference."""

    task: int
    pixels: Any = None  #: numbers of pixels, (rays,)
    airlight: Any = None  #: (rays, 3) [W/(m^2 sr)]
    surface: Any = None  #: (rays, 3) [W/(m^2 sr)]
    #: error of the airlight, and twice its standard error, (rays, 3) [W/(m^2 sr)]
    error: Any = None
    done: bool = False
    failure: str = ""


def yield_processor() -> None:
    """Let this process run only when nothing else wants to, where the system
    knows that, else seldom.
    """
    with suppress(OSError, AttributeError):
        os.nice(19)
    with suppress(OSError, AttributeError):
        os.sched_setscheduler(0, os.SCHED_IDLE, os.sched_param(0))


def answers(task: Task) -> Iterator[Answer]:
    """Yield the reference of an image, rays after rays."""
    from airlight.reference.quadrature.reference import reference_of_pixels
    from airlight.validation.estimates.quadrature import reference_error
    from airlight.validation.scenes.loading import load_scene

    # This process has the scene by its name and its changes; nothing on the device is shared.
    scene = load_scene(task.scene, task.size, task.changes).scene
    order = pixel_order(*task.size)
    if task.most is not None:  # others for each frame
        order = np.random.default_rng(task.number).permutation(order)[: task.most]
    begin, rays = 0, 256
    while begin < len(order):
        # About a quarter of a second of rays passes between two looks for a new task: their number
        # follows the time that the last ones took, by a factor of two up or four down at most.
        chosen = order[begin : begin + rays]
        took = stopwatch()
        found = reference_of_pixels(scene, chosen)
        begin, seconds = begin + len(chosen), took().seconds
        rays = int(np.clip(rays * np.clip(0.25 / max(seconds, 1e-3), 0.25, 2), 16, 20000))
        # The lights that the camera sees are left out: the frames beside this show none.
        layers = found.airlight, found.surface, found.airlight_error
        airlight, surface, error = (layer.reshape(-1, 3) for layer in layers)
        # Area lights add two standard errors of their samples.
        by_chance = reference_error(found, "airlight")
        if by_chance is not None:
            error = error + 2 * by_chance.reshape(-1, 3)
        yield Answer(task.number, chosen, airlight, surface, error)
    yield Answer(task.number, done=True)


def compute(pipe: Connection, variant: str) -> None:
    """Answer the tasks of a pipe, the newest first and alone; None for nothing to do."""
    from airlight.errors import InputError
    from airlight.reports.machine.environment import activate
    from airlight.reports.machine.process_start import default_signals

    default_signals()
    with suppress(OSError, AttributeError):
        os.setsid()  # Ctrl-C reaches the view alone, which ends this
    os.dup2(2, 1)  # what is printed
    yield_processor()
    activate(variant)
    with suppress(EOFError, OSError):  # the view has ended
        while True:
            # Only the newest task counts: older ones are of a scene that is shown no more. A newer
            # one also ends the work on this one.
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


class ReferenceInBackground:
    """A process that computes references, and what it has found for the last task.

    `told` is called in a separate thread whenever more is known.
    """

    def __init__(self, told: Callable[[], None], variant: str) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._number = 0
        self.known: KnownReference | None = None
        self.done = False
        self.failure = ""  #: why there is no reference, in one line
        self._ended = ""  # why no task is answered any more
        # A forked process would share the state of Dr.Jit, and deadlock in it.
        context = get_context("spawn")
        self._pipe, other = context.Pipe()
        self.process = context.Process(target=compute, args=(other, variant), daemon=True)
        main, sys.modules["__main__"] = sys.modules["__main__"], ModuleType("__main__")
        try:
            self.process.start()
        finally:
            sys.modules["__main__"] = main  # it is not imported again: a script would run once more
        other.close()
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def start(
        self,
        scene: str,
        size: tuple[int, int],
        changes: Mapping[str, Values],
        most: int | None = None,
    ) -> None:
        """Compute the reference of a scene from now on, of all pixels or of so many by chance."""
        with self._lock:
            # Answers to an older task carry its number and are dropped.
            self._number += 1
            self.known, self.done = KnownReference.of_size(*size), False
            self.failure = self._ended
            self._send(Task(self._number, scene, size, dict(changes), most))

    def stop(self) -> None:
        """Compute nothing, and forget what was found."""
        with self._lock:
            self._number += 1
            self.known, self.done, self.failure = None, False, self._ended
            self._send(None)

    def end(self) -> None:
        """End the process."""
        self.process.kill()
        self.process.join()
        self._listener.join(1)

    def _send(self, task: Task | None) -> None:
        with suppress(OSError):  # it has ended: `_listen` says so
            self._pipe.send(task)

    def _listen(self) -> None:
        with suppress(EOFError, OSError):
            while True:
                self._take(self._pipe.recv())
        with self._lock:
            self._ended = "the process that computes the reference has ended; start the view again"
            self.failure = self.failure or self._ended
        self._told()

    def _take(self, answer: Answer) -> None:
        with self._lock:
            # Late news of an older task.
            if answer.task != self._number or self.known is None:
                return
            if answer.pixels is not None:
                self.known.add(answer.pixels, answer.airlight, answer.surface, answer.error)
            self.done, self.failure = answer.done, answer.failure
        self._told()
