# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its reference, the checks of the reference, and the rows of every
configuration and of images from elsewhere.

Each part is stored on disk as soon as it is computed: a study that was killed goes on where it
stopped, and a study in which nothing changed computes nothing. Errors are stored by configuration.
Times are stored by scene, for all of its configurations together: they are compared with one
another, and come from one run (`validation.study.turns`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import mitsuba as mi

from airlight.reference.monte_carlo.volpath_gaps import CannotTrace
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.scene.model import Model
from airlight.reference.storage.scene_digest import scene_content
from airlight.reference.storage.store import Content, Inputs, Kept, is_kept, stored
from airlight.validation.estimates.agreement import agreements
from airlight.validation.estimates.monte_carlo import ElsewhereFor
from airlight.validation.estimates.multiple_scattering import multiple_scattering_fraction
from airlight.validation.statistics.records import Agreement, Fraction, MultipleScattering
from airlight.validation.study.configuration import Configuration, configuration_work
from airlight.validation.study.cost import Work, reference_work, sampled_work
from airlight.validation.study.run import with_times
from airlight.validation.study.scene import SceneStudy
from airlight.validation.study.scene_images import image_row
from airlight.validation.study.scene_rows import (
    Judged,
    cell_inputs,
    row_of,
    scene_times,
    times_inputs,
    with_flip,
)
from airlight.validation.study.study import Checks
from airlight.validation.study.turns import Apart

if TYPE_CHECKING:  # what only reports of images need is imported there
    from airlight.validation.engine.images import EngineImage


#: Size of the image whose fraction of multiple scattering is measured [pixels].
_MULTIPLE = (64, 48)
_EDGES = 64  #: of its paths at most


@dataclass(frozen=True)
class CheckInputs(Inputs):
    """The inputs of the checks of a reference."""

    kind = "scene-checks"
    scene: Content
    checks: Checks
    points: int | None  #: of area lights in the reference


@dataclass(frozen=True)
class MultipleInputs(Inputs):
    """The inputs of the fraction of multiple scattering."""

    kind = "scene-multiple"
    scene: Content
    batches: int
    samples: int


@dataclass(frozen=True)
class SceneResult:
    """All that a study says of a scene."""

    study: SceneStudy
    reference: ReferenceImage
    agreement: Mapping[str, Agreement]  #: by estimator and layer
    multiple: MultipleScattering
    rows: tuple[Judged, ...]
    seconds: Mapping[str, float]  #: that its parts took when they were computed
    #: every part, as it is cached
    results: tuple[Kept[Any], ...] = field(repr=False, default=())


def expected_seconds(study: SceneStudy) -> dict[str, float]:
    """Return roughly how long each part will take on one thread [s], by the names that
    `study_scene` reports; 0 for a part that is cached.
    """
    lights, area_lights = len(study.scene.lights), len(study.scene.area_lights)
    checks, parts = study.study.checks, dict[str, float]()
    # A part whose inputs have a result on disk is loaded, which takes no time.
    cached = is_kept(study.reference_inputs.key)
    work = reference_work(study.size, lights=lights, area_lights=area_lights)
    parts["reference"] = 0.0 if cached else work.seconds
    # Estimators stop when they have decided, at the latest when the patience ends. Where it
    # never ends a minute stands for it.
    with study.at(checks.size) as scene:
        cached = is_kept(CheckInputs(scene_content(scene), checks, study.study.points).key)
    parts["checks"] = 0.0 if cached else len(checks.margins) * (checks.patience or 60.0)
    batches, samples = checks.multiple
    with study.at(_MULTIPLE) as scene:
        cached = is_kept(MultipleInputs(scene_content(scene), batches, samples).key)
    parts["multiple scattering"] = (
        0.0 if cached else _seconds(sampled_work(_MULTIPLE, 20 * batches * samples))
    )
    # A configuration renders one frame for its errors; the frames for its times come last,
    # with those of all others.
    for chosen in study.configurations:
        cached = is_kept(cell_inputs(study, chosen).key)
        parts[chosen.label] = (
            0.0 if cached else _seconds(configuration_work(study.scene, chosen, frames=1))
        )
    works = [configuration_work(study.timed, chosen) for chosen in study.configurations]
    times = times_inputs(study)
    cached = times is None or is_kept(times.key)
    parts["times"] = 0.0 if cached else sum(map(_seconds, works))
    return parts


def _seconds(work: Work) -> float:
    # The kernels of a configuration or an estimator take two seconds more to compile.
    return 2.0 + work.seconds


def study_scene(
    study: SceneStudy,
    *,
    images: Sequence[EngineImage] = (),
    model: Model | None = None,
    apart: Apart | None = None,
    ended: Mapping[Configuration, str] | None = None,
    progress: Callable[[str], None] = lambda part: None,
    spread: ElsewhereFor | None = None,
    workers: int = 1,
) -> SceneResult:
    """Return the results of a study for a scene.

    `images` from elsewhere are judged, by the equation of a `model`, of the model that a capture
    names, or of that which the scene names. `apart` calls a user's method in a separate process;
    configurations that `ended` such a process before, with how, are not called again. `progress` is
    called with the name of each part, as of `SceneStudy.seconds`, before it begins. `spread` lets
    other processes trace the batches that check the reference. `workers` is the number of processes
    that compute HDR-FLIP at once, each on one processor.
    """
    # The reference comes first: every row is compared with it, and its checks say how far it can
    # be trusted.
    progress("reference")
    reference, checks = study.kept_reference, study.study.checks
    progress("checks")
    with study.at(checks.size) as scene:
        agreement = check_reference(scene, checks, study.study.points, spread=spread)
    progress("multiple scattering")
    with study.at(_MULTIPLE) as scene:
        multiple = multiple_scattering(scene, *checks.multiple)
    # Errors of all configurations, then times of all in one run: only configurations that could be
    # rendered are timed.
    rows = []
    for chosen in study.configurations:
        progress(chosen.label)
        rows.append(row_of(study, chosen, apart, ended or {}))
    progress("times")
    timings = None
    times = times_inputs(study)
    if times is not None:
        timings = scene_times(study, times, [judged.row for judged in rows], apart)
        rows = [
            replace(judged, row=with_times(judged.row, timed))
            for judged, timed in zip(rows, timings.value, strict=True)
        ]
    # Nothing is timed any more: FLIP, which runs on one processor in a separate process, may use
    # all processors.
    with ThreadPoolExecutor(workers) as pool:
        rows = list(pool.map(with_flip, rows))
    rows += [image_row(study, shown, model) for shown in images]
    # The time that each part took when it was computed, now or in an earlier study.
    methods = [result for row in rows for result in row.results]
    seconds = {
        "reference": reference.seconds,
        "agreement": agreement.seconds,
        "multiple": multiple.seconds,
    }
    seconds["methods"] = round(sum(result.seconds for result in methods), 3)
    seconds["times"] = 0 if timings is None else timings.seconds
    results: list[Kept[Any]] = [reference, agreement, multiple, *methods]
    results += [] if timings is None else [timings]
    return SceneResult(
        study,
        reference.value,
        agreement.value,
        multiple.value,
        tuple(rows),
        seconds,
        tuple(results),
    )


def check_reference(
    scene: mi.Scene,
    checks: Checks,
    points: int | None = None,
    *,
    spread: ElsewhereFor | None = None,
) -> Kept[dict[str, Agreement]]:
    """Compare the reference with the Monte Carlo estimators; see
    `validation.estimates.agreement.agreements`.
    """

    def compute() -> dict[str, Agreement]:
        return agreements(
            scene,
            checks.margins,
            batches=checks.batches,
            samples=checks.samples,
            seconds=checks.patience,
            points=points,
            spread=spread,
        )

    return stored(CheckInputs(scene_content(scene), checks, points), compute, dict[str, Agreement])


def multiple_scattering(scene: mi.Scene, batches: int, samples: int) -> Kept[MultipleScattering]:
    """Return the fraction of multiple scattering; see
    `validation.estimates.multiple_scattering`.
    """
    inputs = MultipleInputs(scene_content(scene), batches, samples)

    def compute() -> MultipleScattering:
        with suppress(CannotTrace):
            return multiple_scattering_fraction(
                scene, max_depth=_EDGES, batches=batches, samples=samples
            )
        unknown = Fraction(value=None, interval=(None, None))
        return MultipleScattering(
            medium=unknown, everything=unknown, max_depth=_EDGES, batches=batches, samples=samples
        )

    return stored(inputs, compute, MultipleScattering)
