# SPDX-License-Identifier: BSD-3-Clause
"""The error report: studies written down as EXR files, pictures, report.json and one page of HTML."""

import json
import time
from collections import Counter
from collections.abc import Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import numpy as np

from analytic.errors import InputError
from reference.exr import write_exr
from reference.files import ensure_folder, write_text
from reports.claims import claims
from reports.data import SCHEMA, mutations_data, plain, scene_data
from reports.environment import describe_environment, stamped
from reports.page import render_page
from reports.pictures import error_map, exposure, tone_mapped, write_png
from reports.progress import Progress
from validation.configurations import STANDARD, Configuration
from validation.references import layered_frame, layered_truth
from validation.study import Effort, SceneStudy, study_scene


def write_report(
    folder: Path | str,
    *,
    scenes: Sequence[str],
    effort: Effort,
    configurations: Sequence[Configuration] = STANDARD,
    command: str = "airlight report",
    progress: Progress | None = None,
) -> dict[str, Any]:
    """Study scenes and write the report.

    Parameters
    ----------
    folder
        Where `report.html`, `report.json` and a folder for each scene go.
    scenes
        Built-in names and paths of Mitsuba XML files.
    effort
        How much work to do.
    configurations
        What to measure.
    command
        The command line that the page names under "how to reproduce".
    progress
        Called with (share done, what) now and then.

    Returns
    -------
    dict
        The content of `report.json`.

    Raises
    ------
    InputError
        If the folder cannot be written or a scene cannot be used; nothing that was there before is damaged.
    """
    _refuse_twins(scenes)
    target = ensure_folder(folder)
    start = time.monotonic()
    found = []
    for number, name in enumerate(scenes):

        def tell(share: float, what: str, number: int = number, name: str = name) -> None:
            if progress is not None:
                progress((number + share) / len(scenes), f"{Path(name).stem}: {what}")

        study = study_scene(name, effort, configurations=configurations, progress=tell)
        found.append(_write_scene(target, study))
    kernels = []
    if effort.rays:
        from validation.stability import stability

        kernels = plain(stability(count=effort.rays))
    mutations = None
    if effort.mutations:
        from validation.mutations import study_mutations

        mutations = mutations_data(study_mutations())
    data = {
        "schema": SCHEMA,
        "created": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        "command": command,
        "seconds": round(time.monotonic() - start, 1),
        "kept": 0,
        "computed": sum(len(scene["methods"]) for scene in found),
        "settings": asdict(effort),
        "environment": describe_environment(),
        "claims": claims(found),
        "scenes": found,
        "stability": kernels,
        "mutations": mutations,
        "published": None,
    }
    write_text(target / "report.json", json.dumps(data, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(target / "report.html", render_page(data, target))
    return data


def _refuse_twins(scenes: Sequence[str]) -> None:
    """Refuse scenes whose images would lie in one folder."""
    for name, count in Counter(Path(scene).stem for scene in scenes).items():
        if count > 1:
            raise InputError(f"scenes: two scenes are called {name}; give each once, or rename one of the files")


def _write_scene(target: Path, study: SceneStudy) -> dict[str, Any]:
    """Write the images of one scene and return its data with the names of the files."""
    data = scene_data(study)
    folder = ensure_folder(target / study.loaded.name)
    truth = study.truth
    factor = exposure(truth.airlight + truth.surface)
    data["exposure"] = factor
    write_exr(folder / "reference.exr", stamped(layered_truth(study.loaded.name, truth)))
    write_png(folder / "reference.png", tone_mapped(truth.airlight + truth.surface, factor))
    write_png(folder / "reference-airlight.png", tone_mapped(truth.airlight, factor))
    data["files"] = {
        name: f"{study.loaded.name}/reference{suffix}"
        for name, suffix in (("exr", ".exr"), ("picture", ".png"), ("airlight", "-airlight.png"))
    }
    for one, measured in zip(data["methods"], study.measurements):
        if measured.frame is None:
            continue
        frame, stem = measured.frame, _file_stem(one["label"])
        image = layered_frame(study.loaded.name, measured.configuration, frame)
        if measured.flip is not None and measured.flip.error_map is not None:
            grey = np.repeat(measured.flip.error_map[:, :, None], 3, axis=2)
            image = replace(image, layers=dict(image.layers) | {"flip": grey})
        write_exr(folder / f"{stem}.exr", stamped(image))
        write_png(folder / f"{stem}.png", tone_mapped(np.asarray(frame.airlight) + frame.surface, factor))
        write_png(folder / f"{stem}-error.png", error_map(truth.airlight, np.asarray(frame.airlight, dtype=np.float64)))
        one["files"] = {
            name: f"{study.loaded.name}/{stem}{suffix}"
            for name, suffix in (("exr", ".exr"), ("picture", ".png"), ("error", "-error.png"))
        }
    return data


def _file_stem(label: str) -> str:
    return "".join(c if c.isalnum() else "-" for c in label).strip("-").replace("--", "-").lower()
