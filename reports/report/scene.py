# SPDX-License-Identifier: BSD-3-Clause
"""What a report says of one scene: every part kept on disk, or computed and then kept."""

import hashlib
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.kept import Spent, is_kept, key_of, stopwatch
from reports.data.own_faults import own_fault
from reports.data.serialize import scene_facts
from reports.machine.environment import machine, threads
from reports.machine.progress import Progress, part_of
from reports.report.computed import judged_result, measured_result, truth_result
from reports.report.expected import scene_seconds, shares
from validation.comparison.engine_images import EngineImage
from validation.estimates.monte_carlo import ElsewhereFor
from validation.metrics.errors import plain
from validation.scenes.identity import scene_identity
from validation.scenes.loading import scene_stem
from validation.study.configuration import Configuration, user_code
from validation.study.results import (
    CachedResult,
    Computed,
    cached_result,
    load_result,
    now,
    store_result,
)
from validation.study.run import Apart, Measurement, configurations_for
from validation.study.scene import (
    Effort,
    SceneStudy,
    check_truth,
    study_configuration,
    study_multiple,
    wants_flip,
    with_flips,
)

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
    keys: "SceneKeys",
    folder: Path,
    results: list[CachedResult],
    own: OwnMethods,
    progress: Progress,
    spread: ElsewhereFor | None = None,
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
    keys
        Of its results.
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
    seconds_of = scene_seconds(scene_stem(study.name), study.effort.image, keys.named(chosen), complete=True)
    steps = {name: part_of(progress, *share) for name, share in shares(seconds_of).items()}
    parts = _Parts(study, keys, folder, results)
    steps["truth"](0.0, "the quadrature truth")
    truth = parts.result("truth", lambda: truth_result(study), stem=_REFERENCE)
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


@dataclass(frozen=True)
class SceneKeys:
    """The keys of all results of a scene, which need not be loaded at its size for this."""

    scene: str  #: from `scene_identity`
    effort: Effort
    machine: Mapping[str, str]  #: times hang on it

    @classmethod
    def of(cls, name_or_path: str, effort: Effort) -> "SceneKeys":
        """Return the keys of a scene as it is named on the command line."""
        return cls(scene_identity(name_or_path), effort, machine())

    def part(self, kind: str) -> str:
        """Return the key of the 'truth', of its checks ('agreement'), or of 'multiple' scattering."""
        parts: dict[str, tuple[Callable[..., Any], tuple[str, ...]]] = {
            "truth": (truth_result, ("image",)),
            "agreement": (check_truth, ("checked", "margins", "samples", "batches", "patience")),
            "multiple": (study_multiple, ("multiple",)),
        }
        function, settings = parts[kind]
        return self._key(f"report-{kind}", function, *settings)

    def method(self, chosen: Configuration) -> str:
        """Return the key of a configuration, with the source of the user's own method and kernel."""
        asked = {"chosen": chosen, "code": user_code(chosen), "wants_flip": wants_flip(self.effort, chosen)}
        settings = ("image", "timed", "seconds", "slow", "limit")
        return self._key("report-method", measured_result, *settings, **asked, **_flip_version())

    def image(self, shown: EngineImage) -> str:
        """Return the key of an image from elsewhere."""
        digest = hashlib.sha256(shown.path.read_bytes()).hexdigest()
        asked = {"label": shown.label, "file": digest, "wants_flip": self.effort.flip}
        return self._key("report-image", judged_result, "image", **asked, **_flip_version())

    def named(self, configurations: Sequence[Configuration]) -> dict[str, str]:
        """Return the keys of all parts and of configurations, by the names of the parts and by labels."""
        parts = {kind: self.part(kind) for kind in ("truth", "agreement", "multiple")}
        return parts | {chosen.label: self.method(chosen) for chosen in configurations}

    def _key(self, kind: str, function: Callable[..., Any], *settings: str, **asked: Any) -> str:
        asked |= {name: getattr(self.effort, name) for name in settings}
        return key_of(kind, function, scene=self.scene, machine=self.machine, **asked)


class _Parts:
    """The parts of a scene's report: their keys and where their files are written."""

    def __init__(self, study: SceneStudy, keys: SceneKeys, folder: Path, results: list[CachedResult]) -> None:
        self._study, self._keys, self._folder, self._results = study, keys, folder, results

    def result(self, kind: str, compute: Callable[[], Computed], *, stem: str = "") -> CachedResult:
        """Return a part, with its files written."""
        return self.done(cached_result(self._keys.part(kind), compute), stem)

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
        folder = folder_of(str(self._study.loaded.path or self._study.name))
        return {name: f"{folder}/{stem}{SUFFIXES[name]}" for name in files}

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
        keys = [self._keys.method(each) for each in chosen]
        if not all(map(is_kept, keys)):
            _ = self._study.truth  # loaded or computed now: it is no part of the time of a method
        workers = threads()
        written: dict[int, dict[str, Any]] = {}

        def keep(done: Sequence[tuple[int, Measurement, Spent]]) -> None:
            """Keep what was measured, with its HDR-FLIP."""
            spent = stopwatch()
            measured = with_flips(self._study, [each for _, each, _ in done], workers=workers)
            flip = Spent(*(value / max(1, len(done)) for value in spent()))
            for (number, _, took), measurement in zip(done, measured, strict=True):
                computed = measured_result(self._study, measurement, factor)
                if measurement.configuration.own and measurement.refused:  # a fault may have gone by the next run
                    result = CachedResult(*computed, seconds=took.seconds, measured=now(), cached=False)
                else:
                    result = store_result(keys[number], computed, Spent(*map(sum, zip(took, flip))))
                written[number] = self.written(result, stems[number])

        # HDR-FLIP of as many configurations at once as there are processors; Ctrl-C loses those that wait for it.
        waiting: list[tuple[int, Measurement, Spent]] = []
        for number, configuration in enumerate(chosen):
            known = load_result(keys[number])
            if known is not None:
                written[number] = self.written(known, stems[number])
                continue
            steps[configuration.label](0.0, configuration.label)
            spent = stopwatch()
            measurement = own.measured(self._study, configuration)
            done = number, measurement, spent()
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
        computed = cached_result(self._keys.image(shown), lambda: judged_result(self._study, shown, factor))
        return self.written(computed, stem)


def folder_of(name_or_path: str) -> str:
    """Return the name of a scene's folder in a report, safe in file systems and in addresses."""
    return re.sub(r"[^\w.-]+", "-", scene_stem(name_or_path)).strip("-.") or "scene"


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


def _flip_version() -> dict[str, str]:
    from importlib.metadata import PackageNotFoundError, version

    try:
        return {"flip": version("flip-evaluator")}
    except PackageNotFoundError:
        return {"flip": "missing"}
