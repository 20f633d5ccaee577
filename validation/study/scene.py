# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its reference, the checks of the reference, the rows of every
configuration and of images from elsewhere.

Each part is stored on disk as soon as it is computed: a study that was killed goes on where it
stopped, and a study in which nothing changed computes nothing. Errors are stored by configuration.
Times are stored by scene, for all of its configurations together: they are compared with one
another, and come from one run (`validation.study.turns`).
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import Spent
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import (
    ReferenceInputs,
    reference_image,
    reference_result,
)
from airlight.reference.scene.model import Model
from airlight.reference.storage.exr import TOTAL, Image
from airlight.reference.storage.scene_digest import scene_content, scene_digest
from airlight.reference.storage.store import Content, Inputs, Kept, is_kept, stored
from airlight.validation.arrays import Array
from airlight.validation.columns import record_of
from airlight.validation.estimates.agreement import agreements
from airlight.validation.estimates.monte_carlo import ElsewhereFor
from airlight.validation.estimates.multiple_scattering import multiple_scattering_fraction
from airlight.validation.metrics.flip import Flip, flip_hdr
from airlight.validation.scenes.loading import LoadedScene, load_scene, resize, scene_identity
from airlight.validation.statistics.records import Agreement, MultipleScattering
from airlight.validation.study.configuration import Configuration, configuration_work, user_code
from airlight.validation.study.cost import Work, reference_work, sampled_work
from airlight.validation.study.reference import of_image
from airlight.validation.study.row import EquationError, Row
from airlight.validation.study.run import cell_row, layered_frame, run, with_times
from airlight.validation.study.study import Cell, Checks, Study
from airlight.validation.study.turns import Apart, CellTimes, time_cells
from airlight.validation.timing import FrameTimes, Timing

if TYPE_CHECKING:  # what only reports of images need is imported there
    from airlight.validation.engine.images import EngineImage
    from airlight.validation.engine.model_errors import ModelErrors

Layer = NDArray[np.floating]  # frames are float32

_MULTIPLE = (64, 48)  # size of the image whose fraction of multiple scattering is measured [pixels]


@dataclass(frozen=True)
class SceneStudy:
    """One scene and what to study of it; properties that take time are computed on first use."""

    loaded: LoadedScene  #: at the size of the images
    study: Study  #: with one size of images
    machine: Mapping[str, str]  #: facts of the machine, on which times depend

    @cached_property
    def scene(self) -> Scene:
        """The scene as methods read it."""
        return read_scene(self.loaded.scene)

    @property
    def timed_size(self) -> tuple[int, int]:
        """The size of the frames that are timed [pixels]."""
        return self.study.measure.timed_size or self.size

    @cached_property
    def timed(self) -> Scene:
        """The scene at the size of the frames that are timed."""
        if self.timed_size == self.size:
            return self.scene
        with self.at(self.timed_size) as scene:
            return read_scene(scene)

    @cached_property
    def kept_reference(self) -> Kept[ReferenceImage]:
        """The quadrature reference at pixel centres, and what it took."""
        return reference_result(self.loaded.scene, self.reference_inputs)

    @property
    def reference(self) -> ReferenceImage:
        """The quadrature reference at pixel centres."""
        return self.kept_reference.value

    @cached_property
    def identity(self) -> str:
        """The identity of the scene, by its name."""
        if self.loaded.path is None:
            return scene_identity(self.name)
        return f"{self.name} {scene_digest(self.loaded.scene) or time.time_ns()}"

    @cached_property
    def configurations(self) -> tuple[Configuration, ...]:
        """The configurations to measure."""
        return configurations_for(self.scene, self.study.configurations)

    @property
    def name(self) -> str:
        """The name of a built-in scene, or the stem of the user's file."""
        return self.loaded.name

    @property
    def path(self) -> str:
        """The name of a built-in scene, or the path of the user's file."""
        return str(self.loaded.path or self.loaded.name)

    @property
    def size(self) -> tuple[int, int]:
        """The size of the images [pixels]."""
        return self.study.sizes[0]

    @contextmanager
    def at(self, size: tuple[int, int]) -> Iterator[mi.Scene]:
        """Give the scene another size [pixels] within a block: it is loaded once."""
        resize(self.loaded.scene, size)
        try:
            yield self.loaded.scene
        finally:
            resize(self.loaded.scene, self.size)

    def reference_of(self, pixel: str) -> ReferenceImage:
        """Return the quadrature reference at pixel centres, or its means over their
        areas: 'centre' or 'area'.
        """
        return (
            self.reference if pixel == "centre" else reference_image(self.loaded.scene, pixel=pixel)
        )

    def cell(self, chosen: Configuration) -> Cell:
        """Return the cell of a configuration."""
        return Cell(self.path, self.size, (), chosen, self.study.measure)

    def seconds(self) -> dict[str, float]:
        """Return roughly how long each part will take on one thread [s], by the names that
        `study_scene` reports; 0 for a part that is cached.
        """
        lights, area_lights = len(self.scene.lights), len(self.scene.area_lights)
        checks, parts = self.study.checks, dict[str, float]()
        # A part whose inputs have a result on disk is loaded, which takes no time.
        cached = is_kept(self.reference_inputs.key)
        work = reference_work(self.size, lights=lights, area_lights=area_lights)
        parts["reference"] = 0.0 if cached else work.seconds
        # Estimators stop when they have decided, at the latest when the patience ends. Where it
        # never ends a minute stands for it.
        with self.at(checks.size) as scene:
            cached = is_kept(CheckInputs(scene_content(scene), checks, self.study.points).key)
        parts["checks"] = 0.0 if cached else len(checks.margins) * (checks.patience or 60.0)
        batches, samples = checks.multiple
        with self.at(_MULTIPLE) as scene:
            cached = is_kept(MultipleInputs(scene_content(scene), batches, samples).key)
        parts["multiple scattering"] = (
            0.0 if cached else _seconds(sampled_work(_MULTIPLE, 20 * batches * samples))
        )
        # A configuration renders one frame for its errors; the frames for its times come last,
        # with those of all others.
        for chosen in self.configurations:
            cached = is_kept(self.inputs(chosen).key)
            parts[chosen.label] = (
                0.0 if cached else _seconds(configuration_work(self.scene, chosen, frames=1))
            )
        works = [configuration_work(self.timed, chosen) for chosen in self.configurations]
        cached = self.times_inputs is None or is_kept(self.times_inputs.key)
        parts["times"] = 0.0 if cached else sum(map(_seconds, works))
        return parts

    @cached_property
    def reference_inputs(self) -> ReferenceInputs:
        """The inputs of the reference, which are among those of all that is compared with it."""
        return ReferenceInputs(scene_content(self.loaded.scene), points=self.study.points)

    def inputs(self, chosen: Configuration) -> CellInputs:
        """Return the inputs of the row and the image of a configuration, without its times."""
        # How long frames are timed, and at which size, has no effect on errors. Whether all stages
        # are timed has: frames that are not finite are refused then, see `run.render`.
        measure = self.study.measure
        times = "stages" if measure.times == "stages" else "none"
        errors = replace(measure, times=times, seconds=0.0, slow=None, timed_size=None)
        cell = replace(self.cell(chosen), scene=self.identity, measure=errors)
        return CellInputs(self.reference_inputs, cell, user_code(chosen), self.machine)

    @cached_property
    def times_inputs(self) -> TimesInputs | None:
        """The inputs of the times that are of one run; None where nothing is timed."""
        if self.study.measure.times == "none" or not self.configurations:
            return None
        cells = tuple(self.timed_cell(chosen, self.identity) for chosen in self.configurations)
        return TimesInputs(cells, tuple(map(user_code, self.configurations)), self.machine)

    def timed_cell(self, chosen: Configuration, scene: str) -> Cell:
        """Return the cell of a configuration at the size of timed frames;
        `scene`: its name or identity.
        """
        return replace(self.cell(chosen), scene=scene, size=self.timed_size)


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
class CellInputs(Inputs):
    """The inputs of the row and the image of a configuration."""

    kind = "cell"
    reference: ReferenceInputs
    cell: Cell  #: with the identity of its scene
    code: tuple[Content, ...]  #: of the user's in it
    machine: Mapping[str, str]


@dataclass(frozen=True)
class TimesInputs(Inputs):
    """The inputs of the times of all configurations of a scene, which are of one run."""

    kind = "scene-times"
    cells: tuple[Cell, ...]  #: with the identity of their scene, at the size of timed frames
    code: tuple[tuple[Content, ...], ...]  #: of the user's in each
    machine: Mapping[str, str]


@dataclass(frozen=True)
class FlipInputs(Inputs):
    """The inputs of HDR-FLIP."""

    kind = "flip"
    reference: Layer  #: (height, width, 3) [W/(m^2 sr)]
    test: Layer  #: of the same shape
    version: str  #: of its program


@dataclass(frozen=True)
class ImageInputs(Inputs):
    """The inputs of the row of an image from elsewhere."""

    kind = "scene-image"
    reference: ReferenceInputs
    scene: str  #: its identity
    size: tuple[int, int]  #: [pixels]
    label: str
    path: Path  #: which counts by its name and its content
    times: tuple[Timing, str] | None
    model: Model  #: the equation by which it is judged


def _seconds(work: Work) -> float:
    # The kernels of a configuration or an estimator take two seconds more to compile.
    return 2.0 + work.seconds


@dataclass(frozen=True)
class Judged:
    """A row of a scene, and its image.

    A row of one of our methods is stored without the reference that it is compared with.
    """

    row: Row
    image: Image | None = None  #: its layers; None if there is none
    #: the reference of its layer `row.layer`, (height, width, 3) [W/(m^2 sr)]
    expected: Layer | None = None
    #: the reference of all its light for HDR-FLIP, (height, width, 3) [W/(m^2 sr)]; None without
    whole: Layer | None = None
    results: tuple[Kept[Any], ...] = ()  #: the cached results of which it is made

    @property
    def light(self) -> Array:
        """All light, to look at, (height, width, 3) [W/(m^2 sr)]."""
        assert self.image is not None
        shown = [
            self.image.layers[name]
            for name in ("airlight", "surface", "total")
            if name in self.image.layers
        ]
        return np.sum([np.asarray(values, dtype=np.float64) for values in shown], axis=0)


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


def open_scene(name_or_path: str, study: Study, machine: Mapping[str, str]) -> SceneStudy:
    """Load a scene for a study, by its built-in name or by the path of a Mitsuba XML file."""
    return SceneStudy(load_scene(name_or_path, study.sizes[0]), study, machine)


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
        rows.append(_row(study, chosen, apart, ended or {}))
    progress("times")
    timings = None
    if study.times_inputs is not None:
        timings = scene_times(study, study.times_inputs, [judged.row for judged in rows], apart)
        rows = [
            replace(judged, row=with_times(judged.row, times))
            for judged, times in zip(rows, timings.value, strict=True)
        ]
    # Nothing is timed any more: FLIP, which runs on one processor in a separate process, may use
    # all processors.
    with ThreadPoolExecutor(workers) as pool:
        rows = list(pool.map(_with_flip, rows))
    rows += [_image(study, shown, model) for shown in images]
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


def configurations_for(
    scene: Scene, configurations: Sequence[Configuration]
) -> tuple[Configuration, ...]:
    """Return the configurations that differ in this scene from the ones before them.

    Variants of the shadows are left out if nothing casts a shadow. The published treatment of
    bounded media is left out if the scene has none, or if they do not lie in vacuum, and so are
    light samples where there is no area light.
    """
    # Names of parameters that change nothing here: a configuration that sets one of them renders
    # the same image as the configuration without it.
    without_effect = set() if scene.features.shadows else {"shadow", "order", "map"}
    without_effect |= set() if scene.medium.clear else {"media"}
    without_effect |= set() if scene.area_lights else {"points", "pattern"}
    return tuple(
        chosen for chosen in configurations if not without_effect & set(dict(chosen.parameters))
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
    compute = partial(multiple_scattering_fraction, scene, batches=batches, samples=samples)
    return stored(inputs, compute, MultipleScattering)


def measured(study: SceneStudy, chosen: Configuration, apart: Apart | None) -> Kept[Judged]:
    """Return the row and the image of a configuration."""
    inputs = study.inputs(chosen)

    def compute() -> Judged:
        # The key has the identity of the scene; a process that renders the cell loads its path.
        reference = of_image(study.kept_reference.value, study.kept_reference.spent)
        row, frame = run(
            replace(inputs.cell, scene=study.path), study.scene, reference, apart=apart
        )
        row = record_of(row, Row)  # without numbers that are not finite
        return Judged(row, None if frame is None else layered_frame(study.name, chosen, frame))

    return stored(inputs, compute, Judged, lambda judged: _is_worth(judged.row))


def _is_worth(row: Row) -> bool:
    """Return whether a row is to be cached: a user may correct a method that failed."""
    return row.kind == "built-in" or row.status == "done"


def scene_times(
    study: SceneStudy, inputs: TimesInputs, rows: Sequence[Row], apart: Apart | None
) -> Kept[list[CellTimes]]:
    """Return the times of all cells of a scene, of one run; `rows`: of the cells, of which only
    those that were done can be timed.
    """
    compute = partial(_scene_times, study, rows, apart)
    return stored(inputs, compute, list[CellTimes], partial(_all_timed, rows))


def _all_timed(rows: Sequence[Row], timings: Sequence[CellTimes]) -> bool:
    """Return whether times are to be cached: a row that is tried again lacks its times."""
    return all(map(_is_worth, rows)) and not any(each.lost for each in timings)


def _scene_times(study: SceneStudy, rows: Sequence[Row], apart: Apart | None) -> list[CellTimes]:
    cells = []
    for chosen, row in zip(study.configurations, rows, strict=True):
        cell = study.timed_cell(chosen, study.path)
        # After a first frame of more than 25 s, compilation included, no larger frame is timed
        # [ms].
        long = row.cost is not None and row.cost.first_ms > 25e3
        cells.append(
            None if row.status != "done" else replace(cell, size=study.size) if long else cell
        )
    timings = time_cells(
        cells,
        lambda cell: study.timed if cell.size == study.timed_size else study.scene,
        apart=apart,
    )
    at = "timed at {} x {}: larger frames take minutes".format(*study.size)
    smaller = [cell is not None and cell.size != study.timed_size for cell in cells]
    return [
        replace(times, note=at) if less else times
        for times, less in zip(timings, smaller, strict=True)
    ]


def _row(
    study: SceneStudy,
    chosen: Configuration,
    apart: Apart | None,
    ended: Mapping[Configuration, str],
) -> Judged:
    # A method that ended its process is not called again: its row says how it ended.
    if chosen in ended:
        row = cell_row(study.cell(chosen), status="refused", reason=ended[chosen])
        return Judged(row, results=(Kept(row, Spent(), time.time(), False),))
    # The reference is loaded or computed first: its time is no part of that of a configuration.
    reference = study.reference
    result = measured(study, chosen, apart)
    # The same scene may have been measured under another path.
    here = cell_row(study.cell(chosen))
    row = replace(result.value.row, scene=here.scene, command=here.command)
    judged = replace(result.value, row=row, results=(result,))
    if judged.image is None:
        return judged
    whole = reference.airlight + reference.surface if study.study.wants_flip(chosen) else None
    return replace(judged, expected=reference.airlight, whole=whole)


def _flip(reference: Layer, test: Layer) -> tuple[Flip, Layer | None]:
    """Return HDR-FLIP and its map."""
    summary, error_map = flip_hdr(reference, test)
    return record_of(summary, Flip), error_map


def _with_flip(judged: Judged) -> Judged:
    """Return a row with HDR-FLIP where it is asked for; its map is a grey layer of the image."""
    if judged.whole is None or judged.image is None:
        return judged
    # FLIP is another program: its version is an input beside both images.
    whole, light = judged.whole, judged.light
    inputs = FlipInputs(whole, light, _flip_version())
    result = stored(inputs, lambda: _flip(whole, light), tuple[Flip, Layer | None])
    summary, error_map = result.value
    image = judged.image
    if error_map is not None:
        image = replace(
            image, layers=dict(image.layers) | {"flip": np.repeat(error_map[:, :, None], 3, axis=2)}
        )
    return replace(
        judged,
        row=replace(judged.row, flip=summary),
        image=image,
        results=(*judged.results, result),
    )


def _image(study: SceneStudy, shown: EngineImage, model: Model | None) -> Judged:
    """Return the row of an image from elsewhere."""
    from airlight.validation.engine.images import captured_model, image_times

    model = model or captured_model(shown.path) or study.loaded.model
    # The key has the inputs of the reference: another reference gives another row.
    times = image_times(shown.path)
    inputs = ImageInputs(
        study.reference_inputs, study.identity, study.size, shown.label, shown.path, times, model
    )
    result = stored(inputs, lambda: _measured_image(study, shown, times, model), Judged)
    # Whether FLIP is asked for is no input of the row: the image for it is dropped here.
    whole = None if study.study.flip == "none" else result.value.whole
    return replace(
        result.value,
        row=replace(result.value.row, scene=study.path),
        whole=whole,
        results=(result,),
    )


def _measured_image(
    study: SceneStudy, shown: EngineImage, times: tuple[Timing, str] | None, model: Model
) -> Judged:
    """Return the row of an image with its layers."""
    from airlight.validation.engine.images import measure_image, notes_of
    from airlight.validation.engine.judge import references

    # An image of a model is judged by the reference of its own equation.
    loaded = replace(study.loaded, model=model)
    judged, layers, surface = measure_image(
        shown,
        loaded,
        study.reference_of if model.is_physical else references(loaded),
        surfaces=study.scene.features.surfaces,
    )
    row = replace(
        cell_row(study.cell(Configuration("image"))),
        label=shown.label,
        command=None,  # another program shows it
        note=notes_of(judged, times),
        kind="image",
        layer=judged.expected,
        pixel=judged.pixel,
        error=judged.comparison.metrics,
        model=None if judged.model is None else _equation_error(judged.model),
        surface_error=surface,
        times=None if times is None else FrameTimes(times[0]),
    )
    # FLIP compares all light. An image of the airlight alone has it only where the surfaces are
    # dark, or where it has a layer of them.
    reference, whole = judged.layers, None
    if judged.expected == TOTAL:
        whole = judged.reference
    elif "surface" in layers or not np.any(reference.surface > 0):
        whole = reference.airlight + reference.surface
    image = Image(
        layers, attributes={"airlight:scene": study.name, "airlight:image": shown.path.name}
    )
    return Judged(record_of(row, Row), image, judged.reference, whole)


def _equation_error(errors: ModelErrors) -> EquationError:
    """Return the errors of an equation and of an algorithm as columns of a row."""
    equation, total = errors.against_physics, errors.total
    # By blocks: one pixel beside a lamp outweighs all others in a root mean square of pixels.
    return EquationError(
        errors.name,
        errors.terms,
        errors.image.blocks,
        None if equation is None else equation.blocks,
        None if total is None else total.blocks,
        errors.correlation,
    )


def _flip_version() -> str:
    try:
        return version("flip-evaluator")
    except PackageNotFoundError:
        return "missing"
