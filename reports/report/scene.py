# SPDX-License-Identifier: BSD-3-Clause
"""What a report says of one scene: every part kept on disk, or computed and then kept."""

import os
import sys
import tempfile
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from reference.storage.exr import Image, write_exr
from reports.data.serialize import image_data, measurement_data, plain, scene_facts, truth_data
from reports.machine.environment import stamped, threads
from reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from validation.comparison.engine_images import EngineImage, ImageMeasurement, image_flip, measure_image
from validation.configurations.methods import Configuration
from validation.estimates.images import layered_frame, layered_truth
from validation.frames.benchmark import Measurement, configurations_for
from validation.frames.result_cache import (
    Computed,
    Keeper,
    Kept,
    Slot,
    find_kept,
    keep,
    kept_result,
    slot,
    source_digest,
)
from validation.frames.scene_study import (
    SceneStudy,
    check_truth,
    study_configuration,
    study_multiple,
    wants_flip,
    with_flips,
)
from validation.metrics.flip import Flip

Tell = Callable[[float, str], None]

#: Files of a report by what they are.
SUFFIXES = {"exr": ".exr", "picture": ".png", "airlight": "-airlight.png", "error": "-error.png"}
_REFERENCE = "reference"  # the stem of the truth's files


def scene_report(
    study: SceneStudy,
    *,
    configurations: Sequence[Configuration],
    images: Sequence[EngineImage],
    keeper: Keeper,
    folder: Path,
    results: list[Kept],
    tell: Tell,
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
    keeper
        Of the run.
    folder
        Of the report; the files go into a folder in it that has the scene's name.
    results
        Every part is added to it as soon as it is there.
    tell
        Told (share done, what).
    """
    parts = _Parts(study, keeper, folder, results)
    tell(0.0, "the quadrature truth")
    truth = parts.result("truth", lambda: _truth(study), asked={"image": study.effort.image}, stem=_REFERENCE)
    factor = truth.data["exposure"]
    tell(0.3, "checks of the truth")
    asked = {name: getattr(study.effort, name) for name in ("checked", "margins", "samples", "batches", "patience")}
    checks = parts.result("agreement", lambda: _checks(study, tell), asked=asked)
    tell(0.5, "multiple scattering")
    multiple = parts.result(
        "multiple", lambda: (plain(study_multiple(study)), {}), asked={"multiple": study.effort.multiple}
    )
    chosen = configurations_for(study.scene.features, configurations)
    stems = file_stems([*(one.label for one in chosen), *(one.label for one in images)])
    methods = parts.methods(chosen, stems, factor, lambda share, what: tell(0.55 + 0.4 * share, what))
    judged = [parts.image(one, stem, factor) for one, stem in zip(images, stems[len(chosen) :])]
    seconds = {"truth": truth.seconds, "agreement": checks.seconds, "multiple": multiple.seconds}
    seconds |= {"methods": round(sum(one["seconds"] for one in methods), 3)}
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

    def __init__(self, study: SceneStudy, keeper: Keeper, folder: Path, results: list[Kept]) -> None:
        self._study, self._keeper, self._folder, self._results = study, keeper, folder, results

    def slot(self, kind: str, asked: Mapping[str, Any], fingerprint: Mapping[str, Any] | None = None) -> Slot:
        """Return where a part is kept."""
        loaded = self._study.loaded
        identity = {"scene": loaded.name, "path": str(loaded.path.resolve()) if loaded.path else None, "asked": asked}
        made_from = {"scene": self._study.digest} | dict(fingerprint or {})
        return slot(self._keeper, kind, identity=identity, fingerprint=made_from)

    def result(self, kind: str, compute: Callable[[], Computed], *, asked: Mapping[str, Any], stem: str = "") -> Kept:
        """Return a part, with its files written."""
        return self.done(kept_result(self.slot(kind, asked), compute), stem)

    def done(self, found: Kept, stem: str) -> Kept:
        """Note that a part is there, and write its files."""
        self._results.append(found)
        for name, where in self.names(stem, found.files).items():
            path = self._folder / where
            path.parent.mkdir(exist_ok=True)
            path.write_bytes(found.files[name])
        return found

    def names(self, stem: str, files: Mapping[str, bytes]) -> dict[str, str]:
        """Return the names of a part's files in the folder of the report."""
        return {name: f"{self._study.name}/{stem}{SUFFIXES[name]}" for name in files}

    def entry(self, found: Kept, stem: str) -> dict[str, Any]:
        """Return the entry of a method or an image from what is kept."""
        self.done(found, stem)
        about = {"measured": found.measured, "seconds": found.seconds, "kept": found.cached}
        return found.data | {"files": self.names(stem, found.files)} | about

    def methods(
        self, chosen: Sequence[Configuration], stems: Sequence[str], factor: float, tell: Tell
    ) -> list[dict[str, Any]]:
        """Return the entries of all configurations."""
        slots = [self.slot("method", self._asked(one), _own_source(one)) for one in chosen]
        entries = []
        workers = threads()
        # As many at once as there are processors, for HDR-FLIP: nothing is lost of those before if this is stopped.
        for first in range(0, len(chosen), workers):
            several = range(first, min(first + workers, len(chosen)))
            found = {number: find_kept(slots[number]) for number in several}
            missing = [number for number in several if found[number] is None]
            measured, seconds = [], []
            for number in missing:
                tell(number / len(chosen), chosen[number].label)
                start = time.monotonic()
                measured.append(study_configuration(self._study, chosen[number]))
                raise_own_error(chosen[number], measured[-1].refused)
                seconds.append(time.monotonic() - start)
            start = time.monotonic()
            measured = with_flips(self._study, measured, workers=workers)
            share = (time.monotonic() - start) / max(1, len(missing))
            for number, one, took in zip(missing, measured, seconds):
                found[number] = keep(slots[number], _measured(self._study, one, factor), took + share)
            entries += [self.entry(one, stems[number]) for number, one in found.items() if one is not None]
        return entries

    def image(self, shown: EngineImage, stem: str, factor: float) -> dict[str, Any]:
        """Return the entry of an image from elsewhere."""
        asked = {"label": shown.label, "image": self._study.effort.image, "flip": self._study.effort.flip}
        place = self.slot("image", asked, {"file": source_digest([shown.path])} | _flip_version())
        return self.entry(kept_result(place, lambda: _judged(self._study, shown, factor)), stem)

    def _asked(self, chosen: Configuration) -> dict[str, Any]:
        effort = self._study.effort
        names = ("image", "timed", "seconds", "slow", "limit")
        return asdict(chosen) | {name: getattr(effort, name) for name in names} | {"flip": wants_flip(effort, chosen)}


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


def raise_own_error(chosen: Configuration, refused: str | None) -> None:
    """Raise what a method of the user's own did wrong: what it refuses by name is a result, its faults are not.

    Raises
    ------
    InputError
        With the words of `realtime.methods.user_method`, which begin with the name of the method.
    """
    if chosen.own and refused and refused.startswith(f"method {chosen.method}:"):
        raise InputError(refused)


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


def _checks(study: SceneStudy, tell: Tell) -> Computed:
    return plain(check_truth(study, progress=lambda share, what: tell(0.3 + 0.2 * share, what))), {}


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
    truth = study.truth
    measured = measure_image(shown, truth, surfaces=study.scene.features.surfaces)
    if study.effort.flip != "none":
        measured = replace(measured, flip=image_flip(measured, truth))
    expected = truth.airlight if measured.layer == "airlight" else truth.airlight + truth.surface
    test = np.asarray(measured.image.layers[measured.layer], dtype=np.float64)
    files = {
        "exr": _exr_bytes(_with_flip(_named(study, measured), measured.flip)),
        "picture": png_bytes(tone_mapped(measured.light, factor)),
        "error": png_bytes(error_map(expected, test)),
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
    with tempfile.TemporaryDirectory(prefix="airlight-exr-") as folder:
        path = Path(folder, "image.exr")
        write_exr(path, stamped(image))
        return path.read_bytes()


def _own_source(chosen: Configuration) -> dict[str, Any]:
    """Return what else the numbers of a method depend on: its source where it is the user's own, HDR-FLIP."""
    if not chosen.own:
        return _flip_version()
    module = chosen.method.rpartition(":")[0]
    file = module if module.endswith(".py") or os.sep in module else getattr(sys.modules.get(module), "__file__", None)
    # Of a function typed into a notebook there is no file: its results are never found again.
    source = Path(file).read_bytes().hex() if file else f"no file, {time.time_ns()}"
    return _flip_version() | {"own": source}


def _flip_version() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return {"flip": version("flip-evaluator")}
    except PackageNotFoundError:
        return {"flip": "missing"}
