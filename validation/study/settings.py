# SPDX-License-Identifier: BSD-3-Clause
"""The settings of a study, as its file has them and as a report shows them.

Both are the same records, with their columns, and need no Mitsuba: a page reads them from
report.json.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from airlight.validation.columns import column

Size = tuple[int, int]  #: width and height [pixels]

SIZE: Size = (160, 120)  #: of the images where a study gives none [pixels]


@dataclass(frozen=True)
class Measure:
    """The measurements of a cell besides its errors."""

    times: str = column(meaning="one of `TIMES`: how frames are timed", default="with")
    seconds: float = column(unit="s", meaning="spent on each of the times of 'stages'", default=0.6)
    timed_size: Size | None = column(
        unit="pixels",
        meaning="of the frames that are timed by stages; `null`: of the image",
        default=None,
    )
    slow: float | None = column(
        unit="s",
        meaning="a frame that takes longer, preparation included, is timed by stages",
        default=None,
    )
    limit: float | None = column(
        unit="s",
        meaning="a cell is left out if a frame would take longer; `null`: never",
        default=None,
    )
    flip: bool = column(
        meaning="whether each cell has HDR-FLIP, which takes about a second", default=False
    )
    every_metric: bool = column(
        meaning="those of other tools, colours, and the error that a method states for itself",
        default=True,
    )


@dataclass(frozen=True)
class Checks:
    """How the references of a study are held against Monte Carlo estimators."""

    size: Size = column(unit="pixels", meaning="of the images", default=(64, 48))
    margins: Mapping[str, float] = column(
        meaning="by estimator, the relative bias that counts as agreement",
        factory=lambda: {"single-scatter": 0.0005, "volpath": 0.01},
    )
    samples: Mapping[str, int] = column(
        meaning="by estimator, samples per pixel in a batch",
        factory=lambda: {"single-scatter": 128, "volpath": 16},
    )
    batches: int = column(meaning="largest number of batches", default=2048)
    multiple: tuple[int, int] = column(
        meaning="of multiple scattering: batches, and samples per pixel in each", default=(8, 4)
    )
    patience: float | None = column(
        unit="s",
        meaning="after which an undecided estimator is stopped; `null`: never",
        default=None,
    )


@dataclass(frozen=True)
class Settings:
    """The settings of a study."""

    name: str = column(
        meaning="`quick`, `default`, `full`, or the name of a user's study", default="sweep"
    )
    scenes: tuple[str, ...] = column(meaning="the scenes", default=())
    sizes: tuple[Size, ...] = column(
        unit="pixels", meaning="width and height of the images", default=(SIZE,)
    )
    measure: Measure = column(meaning="what is measured besides errors", factory=Measure)
    flip: Literal["none", "kinds", "all"] = column(
        meaning="which get HDR-FLIP; `kinds`: those of `--quick`", default="none"
    )
    checks: Checks = column(meaning="how references are checked", factory=Checks)
    stability: int = column(
        meaning="generated rays for the stability of the kernels; 0: none", default=0
    )
    growth: tuple[str, ...] = column(
        meaning="the kinds of work by whose growth a scene is timed", default=()
    )

    @property
    def timed_size(self) -> Size:
        """The size of the frames that are timed [pixels]."""
        return self.measure.timed_size or self.sizes[0]
