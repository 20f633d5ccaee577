# SPDX-License-Identifier: BSD-3-Clause
"""The study of one scene: its reference, the checks of the reference, every configuration, images from elsewhere.

Each part is kept on disk as soon as it is there: a study that was killed goes on where it stopped, and one in which
nothing changed computes nothing.
"""

import hashlib
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from importlib.metadata import PackageNotFoundError, version
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from realtime.frame.renderer import Frame
from realtime.scene.read_scene import Scene, SceneFeatures, read_scene
from reference.quadrature.ray_values import ReferenceImage
from reference.storage.exr import TOTAL, Image
from reference.storage.kept import Kept, is_kept, key_of
from validation.columns import record_of
from validation.estimates.agreement import agreements
from validation.estimates.monte_carlo import ElsewhereFor
from validation.estimates.multiple_scattering import multiple_scattering_fraction
from validation.estimates.quadrature import has_reference, kept_reference, reference_image
from validation.metrics.flip import Flip, flip_hdr
from validation.scenes.loading import LoadedScene, load_scene, resize, scene_identity
from validation.statistics.records import Agreement, MultipleScattering
from validation.study.configuration import Configuration, configuration_work, user_code
from validation.study.cost import reference_work, sampled_work
from validation.study.reference import of_image
from validation.study.results import Computed, Result, cached_result
from validation.study.row import Row
from validation.study.run import Apart, cell_row, layered_frame, run
from validation.study.study import Cell, Study
from validation.timing import FrameTimes

if TYPE_CHECKING:  # what only reports of images need is imported there
    from validation.engine.images import EngineImage

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

_MULTIPLE = (64, 48)  # size of the image whose share of multiple scattering is measured [pixels]
_LAYER = "layer "  # begins the names of arrays that are layers of an image from elsewhere
_COMPILED = 2.0  # that the kernels of a configuration or an estimator take [s], beside its work on one thread


@dataclass(frozen=True)
class SceneStudy:
    """One scene and what to study of it; properties that take time are computed on first use."""

    loaded: LoadedScene  #: at the size of the images
    study: Study  #: with one size of images
    machine: Mapping[str, str]  #: on which times hang

    @cached_property
    def scene(self) -> Scene:
        """The scene as methods read it."""
        return read_scene(self.loaded.scene)

    @cached_property
    def timed(self) -> Scene | None:
        """The scene at the size of the timed frames; None if that is the size of the images."""
        size = self.study.measure.timed_size
        if size is None or size == self.size:
            return None
        with self.at(size) as scene:
            return read_scene(scene)

    @cached_property
    def kept_reference(self) -> tuple[ReferenceImage, Kept]:
        """The quadrature reference at pixel centres, and what it took."""
        return kept_reference(self.loaded.scene)

    @property
    def reference(self) -> ReferenceImage:
        """The quadrature reference at pixel centres."""
        return self.kept_reference[0]

    @cached_property
    def identity(self) -> str:
        """What the scene is."""
        return scene_identity(self.path)

    @cached_property
    def configurations(self) -> tuple[Configuration, ...]:
        """What to measure."""
        return configurations_for(self.scene.features, self.study.configurations)

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
        """Of the images [pixels]."""
        return self.study.sizes[0]

    @contextmanager
    def at(self, size: tuple[int, int]) -> Iterator[Any]:
        """Give the `mi.Scene` another size [pixels] for a while: it is loaded once."""
        resize(self.loaded.scene, size)
        try:
            yield self.loaded.scene
        finally:
            resize(self.loaded.scene, self.size)

    def reference_of(self, pixel: str) -> ReferenceImage:
        """Return the quadrature reference at pixel centres, or its means over their areas: 'centre' or 'area'."""
        return self.reference if pixel == "centre" else reference_image(self.loaded.scene, pixel=pixel)

    def cell(self, chosen: Configuration) -> Cell:
        """Return the cell of a configuration."""
        return Cell(self.path, self.size, (), chosen, self.study.measure)

    def seconds(self) -> dict[str, float]:
        """Return roughly what each part that is not kept will take on one thread [s], by name and by label."""
        lights = len(self.scene.lights) + 16 * len(self.scene.area_lights)
        checks, parts = self.study.checks, {"reference": 0.0}
        if not has_reference(self.loaded.scene):
            parts["reference"] = reference_work(self.size, lights=lights).seconds
        parts["checks"] = 0.0 if is_kept(_checks_key(self)) else len(checks.margins) * (checks.patience or 60.0)
        samples = 20 * checks.multiple[0] * checks.multiple[1]
        works = {"multiple scattering": (_multiple_key(self), sampled_work(_MULTIPLE, samples))}
        for chosen in self.configurations:
            works[chosen.label] = (_cell_key(self, chosen), configuration_work(self.scene, chosen))
        return parts | {name: 0.0 if is_kept(key) else _COMPILED + work.seconds for name, (key, work) in works.items()}


@dataclass(frozen=True)
class Judged:
    """A row of a scene, and its image."""

    row: Row
    image: Image | None = None  #: its layers; None if there is none
    expected: Array | None = None  #: what its layer `row.layer` was compared with, (height, width, 3) [W/(m^2 sr)]
    whole: Array | None = None  #: what all of its light is compared with by HDR-FLIP; None where nobody asks
    results: tuple[Result, ...] = ()  #: that it was made of

    @property
    def light(self) -> Array:
        """All light, to look at, (height, width, 3) [W/(m^2 sr)]."""
        assert self.image is not None
        shown = [self.image.layers[name] for name in ("airlight", "surface", "total") if name in self.image.layers]
        return np.sum([np.asarray(values, dtype=np.float64) for values in shown], axis=0)


@dataclass(frozen=True)
class SceneResult:
    """All that a study says of a scene."""

    study: SceneStudy
    reference: ReferenceImage
    agreement: Mapping[str, Agreement]  #: by estimator and layer, as `volpath airlight`
    multiple: MultipleScattering
    rows: tuple[Judged, ...]
    seconds: Mapping[str, float]  #: that its parts took when they were computed
    results: tuple[Result, ...] = field(repr=False, default=())  #: every part, as it was kept


def open_scene(name_or_path: str, study: Study, machine: Mapping[str, str]) -> SceneStudy:
    """Load a scene for a study, by its built-in name or by the path of a Mitsuba XML file."""
    return SceneStudy(load_scene(name_or_path, study.sizes[0]), study, machine)


def study_scene(
    study: SceneStudy,
    *,
    images: Sequence["EngineImage"] = (),
    apart: Apart | None = None,
    ended: Mapping[Configuration, str] | None = None,
    progress: Callable[[str], None] = lambda part: None,
    spread: ElsewhereFor | None = None,
    workers: int = 1,
) -> SceneResult:
    """Return what a study says of a scene.

    `images` from elsewhere are judged. `apart` calls a user's method in a process of its own; configurations that
    `ended` such a process before, with how, are not called again. `progress` is called with the name of each part, as
    of `SceneStudy.seconds`, before it begins. `spread` lets other processes trace the batches that check the reference.
    So many `workers` compute HDR-FLIP at once, each on one processor.
    """
    progress("reference")
    reference, kept = study.kept_reference
    made = Result({}, {}, kept.made, round(kept.spent.seconds, 3), kept.loaded)
    progress("checks")
    checks = cached_result(_checks_key(study), lambda: (check_reference(study, spread=spread), {}))
    progress("multiple scattering")
    multiple = cached_result(_multiple_key(study), partial(_multiple, study))
    rows = []
    for chosen in study.configurations:
        progress(chosen.label)
        rows.append(_row(study, chosen, apart, ended or {}))
    # Nothing is timed any more: FLIP, which runs on one processor in a process of its own, may have all of them.
    with ThreadPoolExecutor(workers) as pool:
        rows = list(pool.map(_with_flip, rows))
    rows += [_image(study, shown) for shown in images]
    results = (made, checks, multiple, *(result for row in rows for result in row.results))
    seconds = {"reference": made.seconds, "agreement": checks.seconds, "multiple": multiple.seconds}
    seconds["methods"] = round(sum(result.seconds for result in results[3:]), 3)
    agreement = {name: record_of(each, Agreement) for name, each in checks.data.items()}
    found = record_of(multiple.data, MultipleScattering)
    return SceneResult(study, reference, agreement, found, tuple(rows), seconds, results)


def configurations_for(features: SceneFeatures, configurations: Sequence[Configuration]) -> tuple[Configuration, ...]:
    """Return the configurations that differ in this scene from the ones before them.

    Variants of the shadows are left out if nothing casts a shadow. The published treatment of bounded media is left out
    if the scene has none, or if they do not lie in vacuum, and so are light samples where there is no area light.
    """
    without_effect = set() if features.shadows else {"shadow", "order", "map"}
    without_effect |= set() if features.clear else {"media"}
    without_effect |= set() if features.area_lights else {"points", "pattern"}
    return tuple(chosen for chosen in configurations if not without_effect & set(dict(chosen.parameters)))


def check_reference(study: SceneStudy, *, spread: ElsewhereFor | None = None) -> dict[str, Agreement]:
    """Compare the reference with the Monte Carlo estimators; see `validation.estimates.agreement.agreements`."""
    checks = study.study.checks
    with study.at(checks.size) as scene:
        return agreements(
            scene,
            checks.margins,
            batches=checks.batches,
            samples=checks.samples,
            seconds=checks.patience,
            spread=spread,
        )


def _checks_key(study: SceneStudy) -> str:
    asked = asdict(study.study.checks)
    return key_of("scene-checks", check_reference, scene=study.identity, machine=study.machine, **asked)


def _multiple_key(study: SceneStudy) -> str:
    asked = study.study.checks.multiple
    return key_of("scene-multiple", multiple_scattering_fraction, scene=study.identity, multiple=asked)


def _multiple(study: SceneStudy) -> Computed:
    batches, samples = study.study.checks.multiple
    with study.at(_MULTIPLE) as scene:
        return multiple_scattering_fraction(scene, batches=batches, samples=samples), {}


def _cell_key(study: SceneStudy, chosen: Configuration) -> str:
    cell = replace(study.cell(chosen), scene=study.identity)
    return key_of("cell", _measured, cell=cell, code=user_code(chosen), machine=study.machine)


def _measured(study: SceneStudy, chosen: Configuration, apart: Apart | None) -> Computed:
    """Return the row and the image of a configuration."""
    row, frame = run(study.cell(chosen), study.scene, of_image(study.reference), timed_scene=study.timed, apart=apart)
    if frame is None:
        return row, {}
    return row, {"airlight": frame.airlight, "surface": frame.surface, "depth": frame.distance, **frame.extra}


def _row(study: SceneStudy, chosen: Configuration, apart: Apart | None, ended: Mapping[Configuration, str]) -> Judged:
    if chosen in ended:
        row = cell_row(study.cell(chosen), status="refused", reason=ended[chosen])
        return Judged(row, results=(Result(row, {}, time.time(), 0.0, False),))
    _ = study.reference  # loaded or computed now: it is no part of the time of a configuration
    # A fault of the user's method may have gone by the next run.
    worth = (lambda row: row.status == "done") if chosen.own else (lambda row: True)
    result = cached_result(_cell_key(study, chosen), partial(_measured, study, chosen, apart), worth=worth)
    row = record_of(result.data, Row)
    if not result.arrays:
        return Judged(row, results=(result,))
    airlight, surface, distance = (result.arrays[name] for name in ("airlight", "surface", "depth"))
    extra = {name: array for name, array in result.arrays.items() if name not in ("airlight", "surface", "depth")}
    image = layered_frame(study.name, chosen, Frame(airlight, surface, distance, extra))
    whole = study.reference.airlight + study.reference.surface if study.study.wants_flip(chosen) else None
    return Judged(row, image, study.reference.airlight, whole, (result,))


def _with_flip(judged: Judged) -> Judged:
    """Return a row with its HDR-FLIP, whose map is a grey layer of the image, where it is asked for."""
    if judged.whole is None or judged.image is None:
        return judged
    shown = judged.whole, judged.light

    def compute() -> Computed:
        flip, error_map = flip_hdr(*shown)
        return flip, {} if error_map is None else {"map": error_map}

    result = cached_result(key_of("flip", flip_hdr, images=shown, version=_flip_version()), compute)
    image = judged.image
    if "map" in result.arrays:
        grey = np.repeat(result.arrays["map"][:, :, None], 3, axis=2)
        image = replace(image, layers=dict(image.layers) | {"flip": grey})
    row = replace(judged.row, flip=record_of(result.data, Flip))
    return replace(judged, row=row, image=image, results=(*judged.results, result))


def _image(study: SceneStudy, shown: "EngineImage") -> Judged:
    """Return the row of an image from elsewhere."""
    from validation.engine.images import image_times

    digest = hashlib.sha256(shown.path.read_bytes()).hexdigest()
    key = key_of(
        "scene-image",
        _image_measured,
        scene=study.identity,
        size=study.size,
        label=shown.label,
        file=digest,
        times=image_times(shown.path),
    )
    result = cached_result(key, partial(_image_measured, study, shown))
    layers = {name.removeprefix(_LAYER): array for name, array in result.arrays.items() if name.startswith(_LAYER)}
    attributes = {"airlight:scene": study.name, "airlight:image": shown.path.name}
    whole = None if study.study.flip == "none" else result.arrays.get("whole")
    image, row = Image(layers, attributes=attributes), record_of(result.data, Row)
    return Judged(row, image, result.arrays["expected"], whole, (result,))


def _image_measured(study: SceneStudy, shown: "EngineImage") -> Computed:
    from validation.engine.images import image_times, measure_image, notes_of

    timed = image_times(shown.path)
    judged, layers, surface = measure_image(
        shown, study.loaded, study.reference_of, surfaces=study.scene.features.surfaces
    )
    row = Row(
        scene=study.path,
        label=shown.label,
        method="image",
        kernel=None,
        parameters="{}",
        width=study.size[0],
        height=study.size[1],
        status="done",
        note=notes_of(judged, timed),
        kind="image",
        layer=judged.expected,
        pixel=judged.pixel,
        error=judged.comparison.metrics,
        surface_error=surface,
        times=None if timed is None else FrameTimes(timed[0]),
    )
    arrays: dict[str, Any] = {f"{_LAYER}{name}": values for name, values in layers.items()}
    arrays["expected"], reference = judged.reference, judged.fit.reference
    if judged.expected == TOTAL:
        arrays["whole"] = judged.reference
    elif "surface" in layers or not np.any(reference.surface > 0):
        arrays["whole"] = reference.airlight + reference.surface
    return row, arrays


def _flip_version() -> str:
    try:
        return version("flip-evaluator")
    except PackageNotFoundError:
        return "missing"
