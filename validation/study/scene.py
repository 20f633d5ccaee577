# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its truth, the checks of the truth, and the error and cost of every configuration.

Each part is a function of its own, so that a report can reuse earlier results and compute only the rest.
"""

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

from realtime.scene.read_scene import Scene, read_scene
from reference.quadrature.ray_values import TruthImage
from reference.storage.scene_digest import scene_digest
from validation.estimates.agreement import Agreement, agreements
from validation.estimates.monte_carlo import ElsewhereFor
from validation.estimates.multiple_scattering import MultipleScattering, multiple_scattering_share
from validation.estimates.quadrature import truth_image
from validation.metrics.flip import flip_hdr
from validation.scenes.loading import LoadedScene, load_scene
from validation.scenes.registry import FOG_SCENES
from validation.study.configuration import QUICK, Configuration
from validation.study.run import Apart, Measurement, measure, render_and_time_by_name

Progress = Callable[[float, str], None]

_MULTIPLE = (64, 48)  # size of the image whose share of multiple scattering is measured [pixels]
_PROBE = (64, 48)  # size of the frame from which the time of a full-size frame is estimated [pixels]


@dataclass(frozen=True)
class Effort:
    """How much work a study does."""

    name: str
    image: tuple[int, int]  #: width and height of the images that are compared and shown [pixels]
    timed: tuple[int, int]  #: width and height of the frames that are timed [pixels]
    checked: tuple[int, int]  #: width and height of the comparisons of the truth [pixels]
    margins: Mapping[str, float]  #: by estimator, the margin of its relative bias
    samples: Mapping[str, int]  #: by estimator, samples per pixel in each batch of these comparisons
    seconds: float  #: spent on each timing
    scenes: tuple[str, ...] = ()  #: scenes that are studied by default
    batches: int = 2048  #: largest number of batches in these comparisons
    multiple: tuple[int, int] = (8, 4)  #: batches, and samples per pixel in each, for the share of multiple scattering
    patience: float | None = None  #: an estimator that has not decided after this time is stopped [s]; None: never
    #: If a frame takes longer, preparation included, frames are timed stage by stage [s]: from there on `seconds` allow
    #: only the least number of frames for each of the seven times, and as many by their stages give all of these.
    slow: float = 0.04
    limit: float = 10.0  #: frames that would take longer are not measured, and the report says so [s]
    flip: str = "none"  #: which configurations get HDR-FLIP: 'none', 'kinds' (those of `QUICK`) or 'all'
    rays: int = 0  #: number of generated rays for the stability of kernels; 0 leaves it out
    scaling: tuple[str, ...] = ()  #: kinds of work by whose growth a scene is timed, see `validation.study.ladders`

    def at(self, size: tuple[int, int] | None) -> "Effort":
        """Return the effort with images and timed frames of another size [pixels]; itself for None."""
        return self if size is None else replace(self, image=size, timed=size)

    def of(self, scene: str) -> "Effort":
        """Return the effort for a scene: built-in ones lit by lights with extent are compared at half the width.

        A batch of volpath has as many paths there as in others: launches would take all the time of fewer.
        """
        if scene not in _WIDE:
            return self
        image, checked = ((width // 2, height // 2) for width, height in (self.image, self.checked))
        samples = {**self.samples, "volpath": 4 * self.samples["volpath"]}
        return replace(self, image=image, checked=checked, samples=samples)


def _by_estimator(single_scatter: Any, volpath: Any) -> Mapping[str, Any]:
    return {"single-scatter": single_scatter, "volpath": volpath}


# `report --quick` studies scenes that take seconds. The default effort leaves out `tangle`, of which a frame takes up
# to minutes, and `clutter` and `soft-hall`, in which the truth or its checks take long and show what `hall` and `fence`
# show. The truth of a light with extent sums thousands of points.
_QUICK = ("open-fog", "sphere-spot", "two-pens", "penumbra-plane")
_HEAVY = ("clutter", "tangle", "soft-hall")
_WIDE = ("penumbra-plane", "fence", "overlap", "soft-hall")

# Few samples per batch would be a waste: then launches take all the time, and `single-scatter`, which stratifies its
# samples over the ray, gains more than a factor of four from four times as many.
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
            scenes=tuple(name for name in FOG_SCENES if name not in _HEAVY),
            image=(320, 240),
            timed=(320, 240),
            checked=(64, 48),
            margins=_by_estimator(0.0005, 0.01),
            samples=_by_estimator(128, 16),
            seconds=0.1,
            patience=18.0,
            flip="kinds",
            rays=10_000,
        ),
        Effort(
            "full",
            scenes=tuple(FOG_SCENES),
            image=(640, 480),
            timed=(800, 600),
            checked=(160, 120),
            margins=_by_estimator(0.0005, 0.002),
            samples=_by_estimator(128, 64),
            seconds=0.4,
            batches=4096,
            multiple=(16, 8),
            patience=75.0,
            slow=0.1,
            limit=40.0,
            flip="all",
            rays=100_000,
            scaling=("size", "triangles", "lights", "map"),
        ),
    )
}


@dataclass(frozen=True)
class SceneStudy:
    """One scene and the effort of its study; properties that take time are computed on first use."""

    loaded: LoadedScene  #: at the size of the images
    effort: Effort

    @cached_property
    def digest(self) -> str:
        """Digest of the content of the scene."""
        return scene_digest(self.loaded.scene)

    @cached_property
    def scene(self) -> Scene:
        """The scene as methods read it."""
        return read_scene(self.loaded.scene)

    @cached_property
    def timed(self) -> Scene | None:
        """The scene at the size of the timed frames; None if that is the size of the images."""
        return None if self.effort.timed == self.effort.image else read_scene(self.at(self.effort.timed).scene)

    @cached_property
    def probe(self) -> Scene:
        """The scene at a small size, for an estimate of the time of a full-size frame."""
        return read_scene(self.at(_PROBE).scene)

    @cached_property
    def truth(self) -> TruthImage:
        """The quadrature truth at pixel centres."""
        return truth_image(self.loaded.scene)

    def truth_of(self, pixel: str) -> TruthImage:
        """Return the quadrature truth at pixel centres, or its means over their areas: 'centre' or 'area'."""
        return self.truth if pixel == "centre" else truth_image(self.loaded.scene, pixel=pixel)

    @property
    def name(self) -> str:
        """The name of a built-in scene, or the stem of the user's file."""
        return self.loaded.name

    def at(self, size: tuple[int, int]) -> LoadedScene:
        """Return the scene at another size [pixels]."""
        return load_scene(str(self.loaded.path or self.loaded.name), size)


def open_study(name_or_path: str, effort: Effort) -> SceneStudy:
    """Load a scene for a study, by its built-in name or by the path of a Mitsuba XML file."""
    return SceneStudy(load_scene(name_or_path, effort.image), effort)


def check_truth(
    study: SceneStudy, *, progress: Progress | None = None, spread: ElsewhereFor | None = None
) -> dict[str, Agreement]:
    """Compare the truth with the Monte Carlo estimators, with the size, margins and patience of the effort.

    `spread` lets other processes trace batches.
    """
    effort = study.effort
    return agreements(
        study.at(effort.checked).scene,
        effort.margins,
        batches=effort.batches,
        samples=effort.samples,
        seconds=effort.patience,
        progress=progress,
        spread=spread,
    )


def study_multiple(study: SceneStudy) -> MultipleScattering:
    """Measure the share of light that single scattering leaves out."""
    batches, samples = study.effort.multiple
    return multiple_scattering_share(study.at(_MULTIPLE).scene, batches=batches, samples=samples)


def study_configuration(study: SceneStudy, chosen: Configuration, *, apart: Apart | None = None) -> Measurement:
    """Measure a configuration against the truth, without HDR-FLIP, which `with_flips` adds.

    A method of the user's own is called by `apart`, if given.
    """
    effort = study.effort
    render = None
    if chosen.own and apart is not None:
        name = str(study.loaded.path or study.loaded.name)
        function = partial(
            render_and_time_by_name,
            timed=effort.timed,
            probe=_PROBE,
            seconds=effort.seconds,
            slow=effort.slow,
            limit=effort.limit,
        )
        render = partial(apart, function, name, effort.image, chosen, name=chosen.method)
    return measure(
        study.scene,
        chosen,
        truth=study.truth,
        timed=study.timed,
        seconds=effort.seconds,
        slow=effort.slow,
        limit=effort.limit,
        probe=lambda: study.probe,
        render=render,
    )


def with_flips(study: SceneStudy, measured: Sequence[Measurement], *, workers: int) -> list[Measurement]:
    """Return measurements with their HDR-FLIP, if the effort asks for it.

    FLIP runs on one processor in a process of its own, so `workers` of them take no longer than one. They must not run
    while anything is timed.
    """

    def flipped(measurement: Measurement) -> Measurement:
        frame = measurement.frame
        if frame is None or not wants_flip(study.effort, measurement.configuration):
            return measurement
        light = study.truth.airlight + study.truth.surface
        return replace(measurement, flip=flip_hdr(light, frame.airlight + frame.surface))

    with ThreadPoolExecutor(workers) as pool:
        return list(pool.map(flipped, measured))


def wants_flip(effort: Effort, chosen: Configuration) -> bool:
    """Return whether an effort asks for the HDR-FLIP of a configuration."""
    return effort.flip == "all" or (effort.flip == "kinds" and (chosen in QUICK or chosen.own))
