# SPDX-License-Identifier: BSD-3-Clause
"""The reference of what is shown, computed by another process while nothing moves."""

import os
import pickle
import subprocess
import sys
import threading
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path

from reports.machine.environment import VARIANT_VARIABLE
from reports.view.truth_order import KnownTruth
from reports.view.truth_process import Answer, Task
from validation.scenes.changes import Values


class TruthInBackground:
    """A process that computes references, and what it has found for the last task.

    `told` is called in a thread of its own whenever more is known.
    """

    def __init__(self, told: Callable[[], None], variant: str) -> None:
        self._told = told
        self._lock = threading.Lock()
        self._number = 0
        self.truth: KnownTruth | None = None
        self.done = False
        self.failure = ""  #: why there is no reference, in one line
        root = str(Path(__file__).resolve().parents[2])
        paths = [root, *filter(None, [os.environ.get("PYTHONPATH")])]
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", "from reports.view.truth_process import main; main()"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env=os.environ | {"PYTHONPATH": os.pathsep.join(paths), VARIANT_VARIABLE: variant},
            start_new_session=True,  # Ctrl-C reaches the view alone, which ends this
        )
        self._listener = threading.Thread(target=self._listen, daemon=True)
        self._listener.start()

    def start(self, scene: str, size: tuple[int, int], changes: Mapping[str, Values]) -> None:
        """Compute the reference of a scene from now on."""
        with self._lock:
            self._number += 1
            self.truth, self.done, self.failure = KnownTruth.of_size(*size), False, ""
            self._send(Task(self._number, scene, size, dict(changes)))

    def stop(self) -> None:
        """Compute nothing, and forget what was found."""
        with self._lock:
            self._number += 1
            self.truth, self.done, self.failure = None, False, ""
            self._send(None)

    def end(self) -> None:
        """End the process."""
        assert self.process.stdin is not None
        self.process.kill()
        with suppress(OSError):
            self.process.stdin.close()
        self.process.wait()
        self._listener.join(1)

    def _send(self, task: Task | None) -> None:
        assert self.process.stdin is not None
        with suppress(OSError):  # it has ended: `_listen` says so
            pickle.dump(task, self.process.stdin)
            self.process.stdin.flush()

    def _listen(self) -> None:
        assert self.process.stdout is not None
        with self.process.stdout as given, suppress(EOFError, OSError, pickle.UnpicklingError):
            while True:
                self._take(pickle.load(given))
        with self._lock:
            self.failure = self.failure or "the process that computes the reference has ended; start the view again"
        self._told()

    def _take(self, answer: Answer) -> None:
        with self._lock:
            if answer.task != self._number or self.truth is None:
                return
            if answer.pixels is not None:
                self.truth.add(answer.pixels, answer.airlight, answer.surface, answer.bound)
            self.done, self.failure = answer.done, answer.failure
        self._told()
