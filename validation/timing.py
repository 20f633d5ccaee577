# SPDX-License-Identifier: BSD-3-Clause
"""Times that were measured, as rows and reports hold them, without Dr.Jit;
`validation.clock` measures them.

Times may be compared where they are of one *run*: there all works take turns, in rounds, so that a
change of the machine affects all of them alike. An *anchor*, the same work for every method, is
repeated at the beginning and at the end of each round, and says whether the machine changed
meanwhile. `anchored` has the rule.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from airlight.validation.columns import column

#: Repetitions of an anchor at each end of a round. A median of n repetitions that scatter by a
#: standard deviation s has the standard error 1.253 s/sqrt(n), and quartiles lie 1.349 s apart.
#: Five rounds with two ends have ten medians, of which the farthest two are less than 5.16 standard
#: errors apart in 99 runs of 100, by the normal law: that is the distance of the quartiles for n =
#: (5.16 * 1.253/1.349)^2 = 23, so that a machine which does not change passes.
ANCHORS = 25


@dataclass(frozen=True)
class Timing:
    """Repeated measurements of one piece of work [ms]."""

    median_ms: float = column("median", "ms", "of the wall clock")
    low_ms: float = column("first quartile", "ms", "lower quartile, of the wall clock")
    high_ms: float = column("third quartile", "ms", "upper quartile, of the wall clock")
    repetitions: int = column("repetitions", "1", "how often it was measured")
    cpu_ms: float | None = column(
        "processor",
        "ms",
        "least processor time, of all threads; null where it is not known",
        default=None,
    )

    @property
    def quartiles(self) -> list[float]:
        """The median with the quartiles [ms]."""
        return [self.median_ms, self.low_ms, self.high_ms]

    @property
    def rate(self) -> list[float]:
        """How often a second, with the quartiles [1/s]."""
        return [1000 / self.median_ms, 1000 / self.high_ms, 1000 / self.low_ms]


@dataclass(frozen=True)
class TimingRun:
    """A run in which times were measured in turns; times of one run may be compared."""

    started: str = column(
        "timed", meaning="when the run of these times began; rows of one run have the same"
    )
    rounds: int = column("rounds", "1", "of the run: in each of them every work takes its turn")
    anchor: Timing | None = column(
        "anchor",
        meaning="camera rays alone, the anchor of the run, at both ends of each round",
        default=None,
    )
    between: float | None = column(
        "between", "1", "largest over smallest median of the anchor", default=None
    )
    within: float | None = column(
        "within",
        "1",
        "upper over lower quartile of the anchor at one end of a round, geometric mean",
        default=None,
    )

    steady: bool | None = column(
        "steady",
        "",
        "whether scatter within the ends of rounds explains `between`; null where no anchor says so",
        default=None,
    )


def anchored(started: str, rounds: int, ends: Sequence[Timing], whole: Timing) -> TimingRun:
    """Return a run from the times of its anchor: at the `ends` of its rounds, and
    of all of these together.

    The machine was steady where the medians of the anchor have no larger ratio than its quartiles
    at one end of a round: a chart shows quartiles as bars, and such a change moves no point out of
    its bar. Each end has at least `ANCHORS` repetitions.
    """
    medians = [end.median_ms for end in ends]
    between = max(medians) / min(medians)
    within = math.exp(sum(math.log(end.high_ms / end.low_ms) for end in ends) / len(ends))
    return TimingRun(started, rounds, whole, between, within, between <= within)


def joined(runs: Sequence[TimingRun]) -> TimingRun:
    """Return runs of one anchor as one run, whose ends of rounds are these runs."""
    anchors = [run.anchor for run in runs if run.anchor is not None]
    return anchored(runs[0].started, sum(run.rounds for run in runs), anchors, anchors[0])


@dataclass(frozen=True)
class FrameTimes:
    """The times of a frame and of its stages [ms]; of an image from elsewhere the frame alone."""

    frame: Timing = column(
        "frame", "ms", "a whole frame while nothing moves: shadow maps or planes are there"
    )
    airlight: Timing | None = column(
        "airlight",
        "ms",
        "the airlight, with the surfaces where the method knows their shadows",
        default=None,
    )
    surface: Timing | None = column(
        "rays + surface",
        "ms",
        "camera rays, and the surfaces where shadow rays light them",
        default=None,
    )
    light_moved: Timing | None = column(
        "light moved",
        "ms",
        "a frame after the light moved, shadow maps or planes again",
        default=None,
    )
    objects_moved: Timing | None = column(
        "objects moved",
        "ms",
        "a frame after the objects moved too: acceleration structure",
        default=None,
    )
    light_moved_camera_cached: Timing | None = column(
        "light moved, camera rays cached",
        "ms",
        "the same light, camera rays reused",
        default=None,
    )
    colours_changed: Timing | None = column(
        "colours changed", "ms", "a frame after only medium or colours changed", default=None
    )
    run: TimingRun | None = column(
        meaning="the run in which these were measured, in turns; null for times of another program",
        default=None,
    )

    @property
    def measured(self) -> dict[str, Timing]:
        """The times that were measured, by name."""
        return {name: timing for name, timing in vars(self).items() if isinstance(timing, Timing)}

    @property
    def medians(self) -> dict[str, float]:
        """The medians of these [ms]."""
        return {name: timing.median_ms for name, timing in self.measured.items()}


@dataclass(frozen=True)
class StepCost:
    """The times of a frame at one step of growing work."""

    work: float
    frame: Timing
    light_moved: Timing
    objects_moved: Timing
    rays: Timing  #: camera rays without shading
    memory: float | None  #: [MiB]


@dataclass(frozen=True, kw_only=True)
class TimeGrowth:
    """How a time grows with work; see `validation.study.growth`."""

    exponent: float | None  #: None for fewer than two steps
    #: from the scatter about the line, None for fewer than three steps
    standard_error: float | None
    steepest: float | None  #: exponent between two steps that follow one another
    at: float | None  #: work of the second of these
    cliff: bool  #: whether that is more than the work asks for


@dataclass(frozen=True, kw_only=True)
class Scaling:
    """The cost of a method as one kind of work grows."""

    scene: str = column(meaning="of the study")
    size: tuple[int, int] = column(unit="pixels", meaning="of its images")
    label: str = column(meaning="the method")
    kind: Literal["size", "triangles", "lights", "map"] = column(meaning="what grows")
    costs: tuple[StepCost, ...] = column(
        meaning="by step: the `work`, times of frames and of the camera `rays` alone"
    )
    growth: Mapping[str, TimeGrowth] = column(
        meaning="of a time by name: `exponent` of the fit time ~ work^exponent, its `standard_error`, the `steepest` "
        "between two steps, the work `at` the second, and whether that is a `cliff`"
    )
    refused: str | None = column(meaning="why the steps end early; `null` if all were made")
    run: TimingRun | None = column(
        meaning=(
            "of all steps: `between` compares the anchor, camera rays of the first step, over the "
            "steps"
        ),
        default=None,
    )
