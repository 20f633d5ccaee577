# SPDX-License-Identifier: BSD-3-Clause
"""The one stopwatch: how long work takes, by the wall clock and of the processors.

A user waits for the time of the wall clock. The processor time of all threads is reported with it,
because other load on the machine changes it least. Work on a device is done when its arrays are
ready: `validation.clock.timed` waits for them.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Spent:
    """The times of some work."""

    seconds: float = 0.0  #: by the wall clock [s]
    processor: float = 0.0  #: of all threads of the process [s]

    @property
    def ms(self) -> float:
        """The time by the wall clock [ms]."""
        return 1e3 * self.seconds

    @property
    def cpu_ms(self) -> float:
        """The time of all threads of the process [ms]."""
        return 1e3 * self.processor

    def __add__(self, other: "Spent") -> "Spent":
        return Spent(self.seconds + other.seconds, self.processor + other.processor)

    def __sub__(self, other: "Spent") -> "Spent":
        return Spent(self.seconds - other.seconds, self.processor - other.processor)


def stopwatch() -> Callable[[], Spent]:
    """Return a function that says what was spent since now."""
    start = _now()
    return lambda: _now() - start


def _now() -> Spent:
    return Spent(time.perf_counter(), time.process_time())
