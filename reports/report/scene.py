# SPDX-License-Identifier: BSD-3-Clause
"""The record of one scene of a report, and its files: an EXR and pictures of the
reference and of every row.
"""

import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from airlight.realtime.scene.read_scene import describe
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.storage.exr import Image, write_exr
from airlight.reports.data.records import Method, Reference, Scene, SceneFiles
from airlight.reports.machine.environment import stamped
from airlight.reports.plotting.pictures import error_map, exposure, png_bytes, tone_mapped
from airlight.validation.columns import record_of
from airlight.validation.estimates.images import layered_reference
from airlight.validation.estimates.quadrature import known_to, relative_error
from airlight.validation.scenes.names import scene_stem
from airlight.validation.study.reference import of_image
from airlight.validation.study.scene_rows import Judged
from airlight.validation.study.study_scene import SceneResult

#: Files of a report by what they are.
SUFFIXES = {"exr": ".exr", "picture": ".png", "airlight": "-airlight.png", "error": "-error.png"}
_REFERENCE = "reference"  # the stem of the reference's files


def write_scene(result: SceneResult, folder: Path) -> Scene:
    """Return the record of a scene, and write its files into a folder of the report's."""
    study, reference = result.study, result.reference
    # Every picture of the scene has the exposure of its reference, so that they can be compared by
    # eye.
    subfolder = folder_of(study.path)
    (folder / subfolder).mkdir(exist_ok=True)
    light = reference.airlight + reference.surface
    factor = exposure(light)
    pictures = {
        "picture": tone_mapped(light, factor),
        "airlight": tone_mapped(reference.airlight, factor),
    }
    named = _written(
        folder, f"{subfolder}/{_REFERENCE}", layered_reference(study.loaded, reference), pictures
    )
    # Labels become names of files that no two rows share.
    stems = [
        f"{subfolder}/{stem}" for stem in file_stems([judged.row.label for judged in result.rows])
    ]
    return Scene(
        name=study.name,
        purpose=study.loaded.purpose,
        published=study.loaded.published,
        path=str(study.loaded.path) if study.loaded.path else None,
        size=study.size,
        timed=study.study.measure.timed_size or study.size,
        plan=describe(study.scene),
        notes=tuple(study.scene.features.notes),
        reference=reference_record(reference),
        exposure=factor,
        agreement=result.agreement,
        multiple=result.multiple,
        files=SceneFiles(**named),
        methods=tuple(
            _entry(judged, folder, stem, factor)
            for judged, stem in zip(result.rows, stems, strict=True)
        ),
        seconds=result.seconds,
    )


def _entry(judged: Judged, report: Path, stem: str, factor: float) -> Method:
    """Return the record of a row, with its files written."""
    named = dict[str, str]()
    # A refusal has no image.
    if judged.image is not None and judged.expected is not None:
        test = np.asarray(judged.image.layers[judged.row.layer], dtype=np.float64)
        pictures = {
            "picture": tone_mapped(judged.light, factor),
            "error": error_map(np.asarray(judged.expected, dtype=np.float64), test),
        }
        named = _written(report, stem, judged.image, pictures)
    return Method(
        **vars(judged.row),
        files=named,
        measured=judged.results[0].measured,
        seconds=round(sum(result.seconds for result in judged.results), 3),
        cached=all(result.loaded for result in judged.results),
    )


def reference_record(reference: ReferenceImage) -> Reference:
    """Return the accuracy of a quadrature reference, without its images."""
    # Means over finite pixels; in the dark there is nothing to be relative to.
    finite = np.isfinite(reference.airlight)
    mean = float(reference.airlight[finite].mean()) if finite.any() else float("nan")
    numbers = ("transitions", "missed", "checked", "disagreements", "refined", "left")
    error = float(of_image(reference).error[finite].mean()) / mean if mean > 0 else None
    surface = known_to(reference, "surface")
    surface_error = relative_error(surface)
    values = {
        "mean": mean,
        "relative_error": error,
        "kind": known_to(reference, "airlight").kind,
        "surface_error": surface_error,
        "surface_kind": None if surface_error is None else surface.kind,
    } | {name: getattr(reference, name) for name in numbers}
    return record_of(values, Reference)


def _written(report: Path, stem: str, image: Image, pictures: Mapping[str, Any]) -> dict[str, str]:
    """Write an image and its pictures into a folder of the report; return the names of
    the files by what they are.
    """
    names = {kind: f"{stem}{SUFFIXES[kind]}" for kind in ("exr", *pictures)}
    # somebody's, which the report judges
    # An image from elsewhere may hold values that are not finite; the file keeps them, as the
    # report judges them.
    write_exr(report / names["exr"], stamped(image), finite=False)
    for kind, pixels in pictures.items():
        (report / names[kind]).write_bytes(png_bytes(pixels))
    return names


def folder_of(name_or_path: str) -> str:
    """Return the name of a scene's folder in a report, safe in file systems and in addresses."""
    return re.sub(r"[^\w.-]+", "-", scene_stem(name_or_path)).strip("-.") or "scene"


def file_stems(labels: Sequence[str]) -> list[str]:
    """Return a name for the files of every label: letters, digits and dashes; no
    two labels share a file.
    """

    def files(stem: str) -> set[str]:
        return {stem + suffix for suffix in SUFFIXES.values()}

    taken, stems = files(_REFERENCE), []
    for label in labels:
        # Labels have brackets, commas and paths of users; lower case, as some file systems ignore
        # it.
        words = "".join(c if c.isascii() and c.isalnum() else " " for c in label).lower().split()
        stem = base = "-".join(words) or "image"
        # `a` and `a-airlight` would share a file with the suffixes: all files of a stem have to be
        # free.
        number = 2
        while files(stem) & taken:
            stem, number = f"{base}-{number}", number + 1
        taken |= files(stem)
        stems.append(stem)
    return stems
