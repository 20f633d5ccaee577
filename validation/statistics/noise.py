# SPDX-License-Identifier: BSD-3-Clause
r"""How far a number may move before that means something: the noise of errors and of times.

**Errors.** Methods and reference draw no random numbers: on one machine, with one set of versions,
a second run gives the same digits (seen in every pair of reports of 2026-11-21: no error differed).
Another processor, another width of its vectors, another LLVM or CUDA fuse and order the same
float32 operations differently. That moves an error e by

    |e' - e| <= band e + floor

- the floor is what rounding alone makes of a method without any other error: 24 times the rounding
  unit 2^-24 for averages. In a pixel a thousand times darker than the mean, which is where the
  denominator of a relative error ends, a rounding of the size of the mean counts a thousand times:
  the floor of the maximum is 2^-24 / 0.001;
- the band is for what rounding decides: a ray that just misses an edge, a texel that is just in the
  light. One pixel of a few thousand then has another error, which moves a maximum more than an
  average: its band is twice as wide. A bias is a sum in which errors cancel, so that it may be far
  smaller than what such a pixel adds: its band is that of a tenth of the RMSE at least.

Measured on 2026-11-21 at 64 x 48 pixels. Standard configurations of open-fog, sphere-spot,
three-media, two-pens and colonnade in code for AVX2, 8 lanes wide, instead of AVX-512, 16 wide: 657
of their numbers changed, beyond the floor none by more than 0.2 %. With one thread instead of two
as well, 534 numbers of the nine baselines changed; the only one beyond 2 % was a bias of 2.3e-4
beside an RMSE of 1.1e-2, by 5 %. Taking rounding away altogether (float64) moves more, and says
where the floor must end: the 99 % quantile of methods without other errors falls by 1.3e-6, their
largest error by up to 6e-5.

A count of negative pixels may move by the band and a thousandth of the image (sums that cancel to
zero have a random sign); a count of pixels that are not finite may not move at all.

**Times.** A timing is a median with its quartiles. Whatever else a machine does only adds time, in
bursts that last longer than a repetition; so the quartiles say how noisy the moment was, not how
far the next run will be. Four rules:

1. *Spread.* The geometric mean of upper over lower quartile, over all timings of a report, says how
   busy the machine was: 1.01 to 1.05 in seven reports on a quiet machine, 1.7 to 3.1 in five on the
   same machine when it was shared. A ratio counts from `(1 + tolerance) spread` on, with the larger
   spread of the two reports. That is the least slowdown that can be seen; on a busy machine little
   can be, and the comparison says so.
2. *Drift.* All frames share the median ratio over all of them: it is the machine, or code that
   every method uses. A method is slower only if it is slower as measured and after the drift is
   divided out. The drift itself is judged by rule 1, once. Between two machines ratios are compared
   after the drift is divided out, with four times the tolerance: methods do not profit alike from
   wider vectors, larger caches or more threads.
3. *Witnesses.* Each stage has timings, and is part of longer stages: surface and airlight are parts
   of the frame, the frame is a part of a frame after the light moved, and this of one after objects
   moved. If the work of a stage grew, the longer stages grew too; a burst hits one alone. Every
   stage that contains it must have grown by half as many milliseconds. The surface alone is no
   concern of a method.
4. *Chance.* If a burst multiplies a time by exp(E), E exponential with the mean tau, the logarithm
   of the ratio of two times of the same work is the difference of two such E: U has Laplace's law,
   P(U > u) = exp(-u/tau)/2 for u > 0. All |U| of the n timings of other configurations are
   exponential, and their mean is tau to 1/sqrt(n). The quotient x = u/mean then has Pareto's law,
   and the chance of such a growth or more is

       p = (1 + x/n)^-n / 2  for x > 0,        1 - (1 - x/n)^-n / 2  below.

   A stage and its witnesses are k timings that grow by chance independently of each other. By
   Fisher's method the sum of their -ln p has the law of Gamma(k), if n is large; that is the test
   statistic. A stage is slower if so large a sum has less than the chance sidak(LEVEL, tests), for
   as many tests as there are stages, configurations and directions: all of a comparison of the same
   code together give an alarm with the chance LEVEL. A test simulates it.

**Powers** of the work with which times grow, fitted to a few steps. Another power is one that
differs by more than three standard errors of both fits, and by more than `POWER_TOLERANCE`: over
the eight times the work of the shortest ladder, that is a time at one end that is wrong by half.
"""

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from airlight.validation.statistics.comparison import LEVEL
from airlight.validation.statistics.estimate import Answer, Estimate
from airlight.validation.statistics.samples import sidak
from airlight.validation.timing import TimeGrowth, Timing

ROUNDING = 2.0**-24  #: half of the distance from 1 to the next float32
ERROR_TOLERANCE = 0.02  #: relative band of an error
TIME_TOLERANCE = 0.25  #: relative band of a time
POWER_TOLERANCE = 0.2  #: of a power of the work with which a time grows
FLOORS = {
    "relative_rmse": 24 * ROUNDING,
    "relative_bias": 24 * ROUNDING,
    "p50": 24 * ROUNDING,
    "p99": 24 * ROUNDING,
    "max": ROUNDING / 1e-3,
    "mean": 24 * ROUNDING,
    "flip": 1e-4,  # the package's own note says 1e-5 between operating systems
}
SHORTEST = 0.05  #: differences below this are launches and the clock, not work [ms]

_WITNESSES = {
    "airlight": ("frame", "light_moved", "objects_moved"),
    "frame": ("sum", "light_moved", "objects_moved"),
    "light_moved": ("objects_moved",),
    "objects_moved": (),
}

Times = Mapping[str, Timing]  #: by stage


def error_band(
    name: str, old: float, *, tolerance: float = ERROR_TOLERANCE, pixels: int = 0, rmse: float = 0.0
) -> float:
    """Return how far an error may move [1].

    The name is a field of `validation.metrics.errors.Metrics` without a unit, 'mean' (relative to
    itself) or 'flip'. The relative band, `tolerance` [1], is twice as wide for the maximum. Counts
    need the number of `pixels` of the image, a bias the relative `rmse` [1] of the same image.
    """
    if name == "nonfinite":
        return 0.0
    if name == "negative":
        return tolerance * old + 1e-3 * pixels
    # A bias may be zero by cancellation: it counts as at least a tenth of the RMSE.
    size = abs(old)
    if name == "relative_bias":
        size = max(size, 0.1 * rmse)
    return tolerance * size * (2 if name == "max" else 1) + FLOORS[name]


def spread(times: Iterable[Times]) -> float:
    """Return the geometric mean of upper over lower quartile of all timings [1]; 1
    where none has quartiles.
    """
    # With fewer than three repetitions quartiles say nothing.
    ratios = [
        timing.high_ms / timing.low_ms
        for stages in times
        for timing in stages.values()
        if timing.repetitions >= 3 and timing.median_ms >= SHORTEST and timing.low_ms > 0
    ]
    return float(np.exp(np.mean(np.log(ratios)))) if ratios else 1.0


def drift(pairs: Iterable[tuple[Times, Times]]) -> float:
    """Return the median ratio [1] of the times of new to old frames; 1 where there are none."""
    ratios = [new["frame"].median_ms / old["frame"].median_ms for old, new in pairs]
    return math.exp(float(np.median(np.log(ratios)))) if ratios else 1.0


def least_ratio(
    spread_of_both: float, *, same_machine: bool, tolerance: float = TIME_TOLERANCE
) -> float:
    """Return the least ratio [1] of two times that means something.

    `spread_of_both` is by how much the machine's noise alone moves the ratio, at least 1: the
    larger `spread` of both. The band of `tolerance` is four times as wide where not one machine
    took both times.
    """
    return (1 + tolerance * (1 if same_machine else 4)) * spread_of_both


def growths(old: Times, new: Times, scale: float) -> list[float]:
    """Return the logarithms of the ratios of new to old times of the stages of a frame [1],
    beside a common `scale`.
    """
    was, now = _medians(old), _medians(new)
    return [
        _growth(was[stage], now[stage] / scale)
        for stage in _WITNESSES
        if stage in was and stage in now
    ]


def _growth(was: float, now: float) -> float:
    """Return the logarithm of the ratio of two times [ms]; what is too short to mean
    something has not changed.
    """
    return math.log(max(now, SHORTEST) / max(was, SHORTEST))


def chance(of: Sequence[float], others: Sequence[float]) -> float:
    """Return the chance that times of the same work grow together as much as these,
    or more, see the module.

    `of`, `others`: logarithms of ratios [1], of independent times and of times
    of other configurations.
    """
    n = len(others)
    if n == 0:
        return 1.0
    mean = float(np.mean(np.abs(others)))
    tiny = float(np.finfo(float).tiny)
    tails = [0.5 * math.exp(-n * math.log1p(abs(growth) / (n * mean + tiny))) for growth in of]
    total = -sum(
        math.log(max(tail if growth > 0 else 1 - tail, tiny)) for growth, tail in zip(of, tails)
    )
    return math.exp(-total) * sum(total**k / math.factorial(k) for k in range(len(of)))


def slower_stages(
    old: Times, new: Times, *, least: float, scale: float, others: Sequence[float], tests: int
) -> list[str]:
    """Return the stages of a frame that got slower.

    Ratios of times mean something from `least` on, see `least_ratio`; `scale` is how much slower
    than before everything else is [1], at least 1 on the same machine; `others` are the `growths`
    of other configurations, and `tests` how many stages are tested in all. Faster stages are those
    that get slower from new to old.
    """
    shared = [stage for stage in old if stage in new]
    before, after = ({stage: times[stage] for stage in shared} for times in (old, new))
    was, now = _medians(before), {stage: ms / scale for stage, ms in _medians(after).items()}
    slow = []
    for stage in (each for each in shared if each in _WITNESSES):
        # A stage got slower where the ratio means something, where the times that contain the
        # stage grew by at least half as much, and where chance explains it too rarely: the level
        # is for all stages that are tested.
        growth = now[stage] - was[stage]
        witnesses = [name for name in _WITNESSES[stage] if name in was]
        longer = growth >= SHORTEST and now[stage] >= least * was[stage]
        if longer and all(now[name] - was[name] >= 0.5 * growth for name in witnesses):
            timings = [_growth(was[name], now[name]) for name in (stage, *witnesses)]
            slow += [stage] if chance(timings, others) < sidak(LEVEL, tests) else []
    return slow


def _medians(times: Times) -> dict[str, float]:
    """Return the medians of stages, and that of surface and airlight together as 'sum' [ms]."""
    medians = {stage: timing.median_ms for stage, timing in times.items()}
    if {"surface", "airlight"} <= set(times):
        medians["sum"] = medians["surface"] + medians["airlight"]
    return medians


def other_power(old: TimeGrowth, new: TimeGrowth) -> float:
    """Return the change of the power of the work with which a time grows, 0 where noise may explain
    it.

    Two steps have a power without an error: whether it changed is unknown, and the change is 0.
    """
    before, after = old.exponent, new.exponent
    old_error, new_error = old.standard_error, new.standard_error
    if before is None or after is None or old_error is None or new_error is None:
        return 0.0
    change = after - before
    moved = Estimate(change, math.hypot(old_error, new_error)).within(0.0, 3.0) is Answer.NO
    return change if abs(change) > POWER_TOLERANCE and moved else 0.0
