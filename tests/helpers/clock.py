# SPDX-License-Identifier: BSD-3-Clause
"""A clock for tests: no test waits, and no other load counts."""


class Clock:
    """A clock that goes on only where a test says so, in the place of `analytic.clock.time`."""

    def __init__(self):
        self.now, self.calls = 0.0, []
        self.pace = lambda now: 1.0  #: by what work takes longer, at a time [s]

    def perf_counter(self):
        return self.now

    def process_time(self):
        return 2 * self.now

    def work(self, name, *times):
        """Return work that takes these times [ms] one after the other, the
        last one again and again.
        """

        def done():
            self.now += (
                1e-3 * self.pace(self.now) * times[min(self.calls.count(name), len(times) - 1)]
            )
            self.calls.append(name)

        return done
