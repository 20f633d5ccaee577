# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its truth, how far that can be trusted, and every configuration measured against it.

Each part is a function of its own, so that a report can keep what it computed before and ask for the rest.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from realtime.scene.read_scene import Scene, read_scene
from reference.quadrature.image import TruthImage
from reference.storage.scene_digest import scene_digest
from validation.configurations.methods import QUICK, Configuration
from validation.estimates.agreement import Agreement, agreements
from validation.estimates.multiple_scattering import MultipleScattering, multiple_scattering_share
from validation.estimates.quadrature import truth_image
from validation.frames.benchmark import Measurement, measure
from validation.metrics.flip import flip_hdr
from validation.scenes.loading import LoadedScene, load_scene
from validation.scenes.registry import SCENES

Progress = Callable[[float, str], None]

_MULTIPLE = (64, 48)  # pixels of the image whose multiple scattering is measured: one share, of the whole image
_PROBE = (64, 48)  # pixels of the frame that says whether one at full size would take too long


@dataclass(frozen=True)
class Effort:
    """How much work a study does."""

    name: str
    image: tuple[int, int]  #: width and height of the images that are compared and shown [pixels]
    timed: tuple[int, int]  #: width and height of the frames that are timed [pixels]
    checked: tuple[int, int]  #: width and height of the comparisons of the truth [pixels]
    margins: Mapping[str, float]  #: by estimator, of its relative bias
    samples: Mapping[str, int]  #: by estimator, a pixel in each batch of these comparisons
    seconds: float  #: spent on each timing
    scenes: tuple[str, ...] = ()  #: studied unless others are named
    batches: int = 2048  #: of these comparisons at most
    multiple: tuple[int, int] = (8, 4)  #: batches, and samples a pixel in each, for the share of multiple scattering
    patience: float = 10.0  #: seconds after which an estimator that has not decided is stopped
    slow: float = 0.15  #: where the airlight takes longer, whole frames are timed stage by stage [s]
    limit: float = 20.0  #: a frame that would take longer is not measured, and the report says so [s]
    flip: str = "none"  #: of which configurations HDR-FLIP is computed: 'none', one of each 'kinds' (`QUICK`), 'all'
    mutations: bool = False  #: count how many faults of the physics the checks of the truth find
    rays: int = 0  #: generated rays on which kernels are tried, besides the certified ones; 0 leaves this out
    papers: tuple[str, ...] = ()  #: whose tables are measured again: 'biri', 'billeter'
    paper_kernels: tuple[str, ...] = ("exact",)  #: with these kernels

    def at(self, size: tuple[int, int] | None) -> "Effort":
        """Return the effort with images and timed frames of another size [pixels]; itself for None."""
        return self if size is None else replace(self, image=size, timed=size)


def _by_estimator(single_scatter: Any, volpath: Any) -> Mapping[str, Any]:
    return {"single-scatter": single_scatter, "volpath": volpath}


# What `report --quick` looks at unless told otherwise: scenes that take seconds; and what the default leaves out: of
# `tangle` a frame takes up to minutes, in `clutter` the checks of the truth take long and show what `hall` shows.
_QUICK = ("open-fog", "sphere-spot", "two-pens")
_HEAVY = ("clutter", "tangle")

# Samples: a batch of few takes as long as it needs to be launched, and those of `single-scatter` are spread evenly over
# the ray, so that four times as many are worth more than four times.
EFFORTS: dict[str, Effort] = {
    effort.name: effort
    for effort in (
        Effort(
            "quick",
            scenes=_QUICK,
            image=(240, 180),
            timed=(240, 180),
            checked=(48, 36),
            margins=_by_estimator(0.002, 0.02),
            samples=_by_estimator(32, 8),
            seconds=0.05,
            patience=16.0,
        ),
        Effort(
            "default",
            scenes=tuple(name for name in SCENES if name not in _HEAVY),
            image=(320, 240),
            timed=(320, 240),
            checked=(64, 48),
            margins=_by_estimator(0.0005, 0.01),
            samples=_by_estimator(128, 16),
            seconds=0.1,
            patience=18.0,
            flip="kinds",
            rays=10_000,
            papers=("biri",),
        ),
        Effort(
            "full",
            scenes=tuple(SCENES),
            image=(640, 480),
            timed=(800, 600),
            checked=(160, 120),
            margins=_by_estimator(0.0005, 0.002),
            samples=_by_estimator(128, 64),
            seconds=0.4,
            batches=4096,
            multiple=(16, 8),
            patience=75.0,
            slow=0.5,
            limit=40.0,
            flip="all",
            mutations=True,
            rays=100_000,
            papers=("biri", "billeter"),
            paper_kernels=("exact", "taylor"),
        ),
    )
}


@dataclass(frozen=True)
class SceneStudy:
    """One scene with what is asked of it; what costs time is done when it is first asked for."""

    loaded: LoadedScene  #: at the size of the images
    effort: Effort

    @cached_property
    def digest(self) -> str:
        """Of the content of the scene."""
        return scene_digest(self.loaded.scene)

    @cached_property
    def scene(self) -> Scene:
        """The scene for the methods."""
        return read_scene(self.loaded.scene)

    @cached_property
    def timed(self) -> Scene | None:
        """The scene at the size of the frames that are timed; None where that is the size of the images."""
        return None if self.effort.timed == self.effort.image else read_scene(self.at(self.effort.timed).scene)

    @cached_property
    def probe(self) -> Scene:
        """The scene at a small size: what takes long there takes too long at the full one."""
        return read_scene(self.at(_PROBE).scene)

    @cached_property
    def truth(self) -> TruthImage:
        """The quadrature truth."""
        return truth_image(self.loaded.scene)

    @property
    def name(self) -> str:
        """The name of the scene: a built-in one, or the stem of its file."""
        return self.loaded.name

    def at(self, size: tuple[int, int]) -> LoadedScene:
        """Return the scene at another size [pixels]."""
        return load_scene(str(self.loaded.path or self.loaded.name), size)


def open_study(name_or_path: str, effort: Effort) -> SceneStudy:
    """Load a scene to study: a built-in one, or the path of a Mitsuba XML file."""
    return SceneStudy(load_scene(name_or_path, effort.image), effort)


def check_truth(study: SceneStudy, *, progress: Progress | None = None) -> dict[str, Agreement]:
    """Compare the truth with Monte Carlo estimators, at the effort's size, margins and patience."""
    effort = study.effort
    return agreements(
        study.at(effort.checked).scene,
        effort.margins,
        batches=effort.batches,
        samples=effort.samples,
        seconds=effort.patience,
        progress=progress,
    )


def study_multiple(study: SceneStudy) -> MultipleScattering:
    """Measure what single scattering leaves out of the image."""
    batches, samples = study.effort.multiple
    return multiple_scattering_share(study.at(_MULTIPLE).scene, batches=batches, samples=samples)


def study_configuration(study: SceneStudy, chosen: Configuration) -> Measurement:
    """Measure a configuration against the truth, all but HDR-FLIP: see `with_flips`."""
    effort = study.effort
    return measure(
        study.scene,
        chosen,
        truth=study.truth,
        timed=study.timed,
        seconds=effort.seconds,
        slow=effort.slow,
        limit=effort.limit,
        probe=lambda: study.probe,
    )


def with_flips(study: SceneStudy, measured: Sequence[Measurement], *, workers: int) -> list[Measurement]:
    """Return measurements with their HDR-FLIP, where the effort asks for it.

    FLIP runs on one processor, in a process of its own: several at once take no longer than one. They must not run
    while anything is timed.
    """

    def one(measurement: Measurement) -> Measurement:
        frame = measurement.frame
        if frame is None or not wants_flip(study.effort, measurement.configuration):
            return measurement
        light = study.truth.airlight + study.truth.surface
        return replace(measurement, flip=flip_hdr(light, frame.airlight + frame.surface))

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(one, measured))


def wants_flip(effort: Effort, chosen: Configuration) -> bool:
    """Return whether an effort asks for HDR-FLIP of a configuration."""
    return effort.flip == "all" or (effort.flip == "kinds" and (chosen in QUICK or chosen.own))
