# SPDX-License-Identifier: BSD-3-Clause
"""A time that was measured, as rows and reports hold it; `validation.clock` measures it."""

from dataclasses import dataclass

from validation.columns import column


@dataclass(frozen=True)
class Timing:
    """Repeated measurements of one piece of work [ms]."""

    median_ms: float = column("median", "ms", "of the wall clock")
    low_ms: float = column("first quartile", "ms", "lower quartile, of the wall clock")
    high_ms: float = column("third quartile", "ms", "upper quartile, of the wall clock")
    repetitions: int = column("repetitions", "1", "how often it was measured")
    cpu_ms: float | None = column(
        "processor", "ms", "least processor time, of all threads; null where stages were timed", default=None
    )

    @property
    def interval(self) -> list[float]:
        """The median with its quartiles [ms]."""
        return [self.median_ms, self.low_ms, self.high_ms]

    @property
    def rate(self) -> list[float]:
        """How often a second, with its quartiles [1/s]."""
        return [1000 / self.median_ms, 1000 / self.high_ms, 1000 / self.low_ms]
