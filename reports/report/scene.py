# SPDX-License-Identifier: BSD-3-Clause
"""What a report says of one scene: every part kept on disk, or computed and then kept."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from realtime.methods.user_method import method_file
from reference.storage.exr import Image, write_exr
from reference.storage.files import temporary_folder
from reports.data.own_faults import own_fault
from reports.data.serialize import image_data, measurement_data, scene_facts, truth_data
from reports.machine.environment import stamped, threads
from reports.machine.progress import Progress, part_of
from reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from reports.report.expected import SceneEntries, scene_seconds, shares
from validation.comparison.engine_images import EngineImage, ImageMeasurement, image_flip, measure_image
from validation.configurations.methods import Configuration
from validation.estimates.images import layered_frame, layered_truth
from validation.estimates.monte_carlo import Spread
from validation.frames.benchmark import Apart, Measurement, configurations_for
from validation.frames.result_cache import (
    CachedResult,
    Computed,
    ResultCache,
    cached_result,
    load_result,
    now,
    source_digest,
    store_result,
)
from validation.frames.scene_study import (
    SceneStudy,
    check_truth,
    study_configuration,
    study_multiple,
    wants_flip,
    with_flips,
)
from validation.metrics.errors import plain
from validation.metrics.flip import Flip

#: Files of a report by what they are.
SUFFIXES = {"exr": ".exr", "picture": ".png", "airlight": "-airlight.png", "error": "-error.png"}
_REFERENCE = "reference"  # the stem of the truth's files


@dataclass(frozen=True)
class OwnMethods:
    """How methods of the user's own are run."""

    apart: Apart | None = None  #: calls a function in a process of its own; None: in this one, where a fault is raised
    ended: Mapping[Configuration, str] = field(default_factory=dict)  #: those that ended such a process, with how

    def measured(self, study: SceneStudy, chosen: Configuration) -> Measurement:
        """Measure a configuration, also one that is not the user's own.

        Raises
        ------
        InputError
            If the user's method is at fault and runs in this process.
        """
        if chosen in self.ended:
            return Measurement(chosen, None, None, None, None, refused=self.ended[chosen], knows_shadows=True)
        measurement = study_configuration(study, chosen, apart=self.apart)
        fault = own_fault(chosen.method, measurement.refused)
        if fault and self.apart is None:
            raise InputError(fault)
        return measurement


def scene_report(
    study: SceneStudy,
    *,
    configurations: Sequence[Configuration],
    images: Sequence[EngineImage],
    cache: ResultCache,
    folder: Path,
    results: list[CachedResult],
    own: OwnMethods,
    progress: Progress,
    spread: Spread | None = None,
) -> dict[str, Any]:
    """Return what the report says of a scene, and write its files.

    Parameters
    ----------
    study
        The scene.
    configurations
        What to measure; variants that the scene has no use for are left out.
    images
        From elsewhere, to judge.
    cache
        Of the run.
    folder
        Of the report; the files go into a folder in it that has the scene's name.
    results
        Every part is added to it as soon as it is there.
    own
        How methods of the user's own are run.
    progress
        Called with (share done, what).
    spread
        Lets other processes trace the batches that check the truth.
    """
    chosen = configurations_for(study.scene.features, configurations)
    entries = SceneEntries(cache, study.loaded.name, study.loaded.path, study.effort)
    seconds_of = scene_seconds(entries, chosen, complete=True)
    steps = {name: part_of(progress, *share) for name, share in shares(seconds_of).items()}
    parts = _Parts(study, entries, folder, results)
    steps["truth"](0.0, "the quadrature truth")
    truth = parts.result("truth", lambda: _truth(study), stem=_REFERENCE)
    factor = truth.data["exposure"]
    steps["agreement"](0.0, "checks of the truth")
    checks = parts.result(
        "agreement", lambda: (plain(check_truth(study, progress=steps["agreement"], spread=spread)), {})
    )
    steps["multiple"](0.0, "multiple scattering")
    multiple = parts.result("multiple", lambda: (plain(study_multiple(study)), {}))
    stems = file_stems([*(configuration.label for configuration in chosen), *(image.label for image in images)])
    methods = parts.methods(chosen, stems, factor, own=own, steps=steps)
    judged = [parts.image(image, stem, factor) for image, stem in zip(images, stems[len(chosen) :])]
    seconds = {"truth": truth.seconds, "agreement": checks.seconds, "multiple": multiple.seconds}
    seconds |= {"methods": round(sum(entry["seconds"] for entry in methods), 3)}
    return scene_facts(study) | {
        **truth.data,
        "agreement": checks.data,
        "multiple": multiple.data,
        "files": parts.names(_REFERENCE, truth.files),
        "methods": [*methods, *judged],
        "seconds": seconds,
    }


class _Parts:
    """The parts of a scene's report: where they are kept and where their files are written."""

    def __init__(self, study: SceneStudy, entries: SceneEntries, folder: Path, results: list[CachedResult]) -> None:
        self._study, self._entries, self._folder, self._results = study, entries, folder, results
        self._made_from = {"scene": study.digest}

    def result(self, kind: str, compute: Callable[[], Computed], *, stem: str = "") -> CachedResult:
        """Return a part, with its files written."""
        return self.done(cached_result(self._entries.part(kind, self._made_from), compute), stem)

    def done(self, result: CachedResult, stem: str) -> CachedResult:
        """Note that a part is there, and write its files."""
        self._results.append(result)
        for name, where in self.names(stem, result.files).items():
            path = self._folder / where
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(result.files[name])
        return result

    def names(self, stem: str, files: Mapping[str, bytes]) -> dict[str, str]:
        """Return the names of a part's files in the folder of the report."""
        return {name: f"{self._study.name}/{stem}{SUFFIXES[name]}" for name in files}

    def written(self, result: CachedResult, stem: str) -> dict[str, Any]:
        """Return what the report says of a method or an image, with its files written."""
        self.done(result, stem)
        about = {"measured": result.measured, "seconds": result.seconds, "kept": result.cached}
        return result.data | {"files": self.names(stem, result.files)} | about

    def methods(
        self,
        chosen: Sequence[Configuration],
        stems: Sequence[str],
        factor: float,
        *,
        own: OwnMethods,
        steps: Mapping[str, Progress],
    ) -> list[dict[str, Any]]:
        """Return what the report says of all configurations."""
        entries = [self._entries.method(each, self._made_from | _own_source(each)) for each in chosen]
        workers = threads()
        written: dict[int, dict[str, Any]] = {}

        def keep(done: Sequence[tuple[int, Measurement, float]]) -> None:
            """Keep what was measured, with its HDR-FLIP."""
            start = time.monotonic()
            measured = with_flips(self._study, [each for _, each, _ in done], workers=workers)
            flip = (time.monotonic() - start) / max(1, len(done))
            for (number, _, took), measurement in zip(done, measured, strict=True):
                computed = _measured(self._study, measurement, factor)
                if own_fault(measurement.configuration.method, measurement.refused):  # it may have gone by the next run
                    result = CachedResult(*computed, seconds=took, measured=now(), cached=False)
                else:
                    result = store_result(entries[number], computed, took + flip)
                written[number] = self.written(result, stems[number])

        # HDR-FLIP of as many configurations at once as there are processors; Ctrl-C loses those that wait for it.
        waiting: list[tuple[int, Measurement, float]] = []
        for number, configuration in enumerate(chosen):
            known = load_result(entries[number])
            if known is not None:
                written[number] = self.written(known, stems[number])
                continue
            steps[configuration.label](0.0, configuration.label)
            start = time.monotonic()
            measurement = own.measured(self._study, configuration)
            done = number, measurement, time.monotonic() - start
            if measurement.frame is None or not wants_flip(self._study.effort, configuration):
                keep([done])
                continue
            waiting.append(done)
            if len(waiting) == workers:
                keep(waiting)
                waiting = []
        keep(waiting)
        return [written[number] for number in sorted(written)]

    def image(self, shown: EngineImage, stem: str, factor: float) -> dict[str, Any]:
        """Return what the report says of an image from elsewhere."""
        made_from = self._made_from | {"file": source_digest([shown.path])} | _flip_version()
        entry = self._entries.image(shown.label, made_from)
        return self.written(cached_result(entry, lambda: _judged(self._study, shown, factor)), stem)


def file_stems(labels: Sequence[str]) -> list[str]:
    """Return a name for the files of every label: letters, digits and dashes; no two labels share a file."""

    def files(stem: str) -> set[str]:
        return {stem + suffix for suffix in SUFFIXES.values()}

    taken, stems = files(_REFERENCE), []
    for label in labels:
        words = "".join(c if c.isascii() and c.isalnum() else " " for c in label).lower().split()
        stem = base = "-".join(words) or "image"
        number = 2
        while files(stem) & taken:
            stem, number = f"{base}-{number}", number + 1
        taken |= files(stem)
        stems.append(stem)
    return stems


def _truth(study: SceneStudy) -> Computed:
    truth = study.truth
    light = truth.airlight + truth.surface
    factor = exposure(light)
    files = {
        "exr": _exr_bytes(layered_truth(study.name, truth)),
        "picture": png_bytes(tone_mapped(light, factor)),
        "airlight": png_bytes(tone_mapped(truth.airlight, factor)),
    }
    return {"truth": truth_data(truth), "exposure": factor}, files


def _measured(study: SceneStudy, measured: Measurement, factor: float) -> Computed:
    data, frame = measurement_data(measured), measured.frame
    if frame is None:
        return data, {}
    image = layered_frame(study.name, measured.configuration, frame)
    airlight = np.asarray(frame.airlight, dtype=np.float64)
    files = {
        "exr": _exr_bytes(_with_flip(image, measured.flip)),
        "picture": png_bytes(tone_mapped(airlight + frame.surface, factor)),
        "error": png_bytes(error_map(study.truth.airlight, airlight)),
    }
    return data, files


def _judged(study: SceneStudy, shown: EngineImage, factor: float) -> Computed:
    measured = measure_image(shown, study.truth_of, surfaces=study.scene.features.surfaces)
    if study.effort.flip != "none":
        measured = replace(measured, flip=image_flip(measured))
    test = np.asarray(measured.image.layers[measured.layer], dtype=np.float64)
    files = {
        "exr": _exr_bytes(_with_flip(_named(study, measured), measured.flip)),
        "picture": png_bytes(tone_mapped(measured.light, factor)),
        "error": png_bytes(error_map(measured.expected, test)),
    }
    return image_data(measured), files


def _named(study: SceneStudy, measured: ImageMeasurement) -> Image:
    attributes = {"airlight:scene": study.name, "airlight:image": measured.shown.path.name}
    return replace(measured.image, attributes=attributes)


def _with_flip(image: Image, flip: Flip | None) -> Image:
    """Return an image with its map of HDR-FLIP as a grey layer."""
    if flip is None or flip.error_map is None:
        return image
    return replace(image, layers=dict(image.layers) | {"flip": np.repeat(flip.error_map[:, :, None], 3, axis=2)})


def _exr_bytes(image: Image) -> bytes:
    """Return the file of an image: OpenEXR writes to a path alone."""
    with temporary_folder() as folder:
        path = folder / "image.exr"
        write_exr(path, stamped(image), finite=False)  # somebody's, which the report judges
        return path.read_bytes()


def _own_source(chosen: Configuration) -> dict[str, Any]:
    """Return what else the numbers of a method depend on: its source where it is the user's own, HDR-FLIP."""
    if not chosen.own:
        return _flip_version()
    file = method_file(chosen.method)
    # A function typed into a notebook has no file, so its results cannot be kept.
    source = file.read_bytes().hex() if file else f"no file, {time.time_ns()}"
    return _flip_version() | {"own": source}


def _flip_version() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return {"flip": version("flip-evaluator")}
    except PackageNotFoundError:
        return {"flip": "missing"}
