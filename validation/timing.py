# SPDX-License-Identifier: BSD-3-Clause
"""Times that were measured, as rows and reports hold them, without Dr.Jit; `validation.clock` measures them."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

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
    def quartiles(self) -> list[float]:
        """The median with the quartiles [ms]."""
        return [self.median_ms, self.low_ms, self.high_ms]

    @property
    def rate(self) -> list[float]:
        """How often a second, with the quartiles [1/s]."""
        return [1000 / self.median_ms, 1000 / self.high_ms, 1000 / self.low_ms]


@dataclass(frozen=True)
class FrameTimes:
    """The times of a frame and of its stages [ms]; of an image from elsewhere the frame alone."""

    frame: Timing = column("frame", "ms", "a whole frame while nothing moves: shadow maps or planes are there")
    airlight: Timing | None = column("airlight", "ms", "the airlight alone, with the lists of tiles", default=None)
    surface: Timing | None = column("rays + surface", "ms", "camera rays and lit surface", default=None)
    light_moved: Timing | None = column(
        "light moved", "ms", "a frame after the light moved, shadow maps or planes again", default=None
    )
    objects_moved: Timing | None = column(
        "objects moved", "ms", "a frame after the objects moved too: acceleration structure", default=None
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

    @property
    def measured(self) -> dict[str, Timing]:
        """The times that were measured, by name."""
        return {name: timing for name, timing in vars(self).items() if timing is not None}

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
    standard_error: float | None  #: from the scatter about the line, None for fewer than three steps
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
    costs: tuple[StepCost, ...] = column(meaning="by step: the `work`, times of frames and of the camera `rays` alone")
    growth: Mapping[str, TimeGrowth] = column(
        meaning="of a time by name: `exponent` of the fit time ~ work^exponent, its `standard_error`, the `steepest` "
        "between two steps, the work `at` the second, and whether that is a `cliff`"
    )
    refused: str | None = column(meaning="why the steps end early; `null` if all were made")
