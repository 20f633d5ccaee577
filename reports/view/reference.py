# SPDX-License-Identifier: BSD-3-Clause
"""The reference of what is shown, computed by another process while nothing moves."""

import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from multiprocessing import get_context
from types import ModuleType

from reports.view.reference_order import KnownReference
from reports.view.reference_process import Answer, Task, compute
from validation.scenes.changes import Values


class ReferenceInBackground:
    """A process that computes references, and what it has found for the last task.

    `told` is called in a thread of its own whenever more is known.
    """

    def __init__(self, told: Callable[[], None], variant: str) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._number = 0
        self.known: KnownReference | None = None
        self.done = False
        self.failure = ""  #: why there is no reference, in one line
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

    def start(self, scene: str, size: tuple[int, int], changes: Mapping[str, Values], most: int | None = None) -> None:
        """Compute the reference of a scene from now on, of all pixels or of so many by chance."""
        with self._lock:
            self._number += 1
            self.known, self.done, self.failure = KnownReference.of_size(*size), False, ""
            self._send(Task(self._number, scene, size, dict(changes), most))

    def stop(self) -> None:
        """Compute nothing, and forget what was found."""
        with self._lock:
            self._number += 1
            self.known, self.done, self.failure = None, False, ""
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
            self.failure = self.failure or "the process that computes the reference has ended; start the view again"
        self._told()

    def _take(self, answer: Answer) -> None:
        with self._lock:
            if answer.task != self._number or self.known is None:
                return
            if answer.pixels is not None:
                self.known.add(answer.pixels, answer.airlight, answer.surface, answer.bound)
            self.done, self.failure = answer.done, answer.failure
        self._told()
