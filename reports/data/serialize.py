# SPDX-License-Identifier: BSD-3-Clause
"""The data of a report: plain numbers and words, ready for JSON.

docs/formats.md explains every key of the schema "airlight-report/2". NaN becomes null.
"""

from pathlib import Path
from typing import Any

from realtime.scene.features import describe
from reference.quadrature.ray_values import TruthImage
from validation.comparison.engine_images import ImageMeasurement
from validation.metrics.errors import plain
from validation.study.growth import Scaling
from validation.study.run import Measurement, knows_shadows
from validation.study.scene import SceneStudy


def scene_facts(study: SceneStudy) -> dict[str, Any]:
    """Return the description of a scene."""
    loaded, effort, features = study.loaded, study.effort, study.scene.features
    return {
        "name": loaded.name,
        "purpose": loaded.purpose,
        "published": loaded.published,
        "path": str(loaded.path) if loaded.path else None,
        "size": list(effort.image),
        "timed": list(effort.timed),
        "plan": describe(features),
        "notes": list(features.notes),
    }


def truth_data(truth: TruthImage) -> dict[str, Any]:
    """Return the error bounds of the quadrature truth, without its images."""
    import numpy as np

    finite = np.isfinite(truth.airlight)
    mean = float(truth.airlight[finite].mean()) if finite.any() else float("nan")
    return plain(
        {
            "mean": mean,
            "relative_bound": float(truth.airlight_bound[finite].mean()) / mean if mean > 0 else None,
            "transitions": truth.transitions,
            "missed": truth.missed,
            "checked": truth.checked,
            "disagreements": truth.disagreements,
            "refined": truth.refined,
            "left": truth.left,
        }
    )


def measurement_data(measured: Measurement) -> dict[str, Any]:
    """Return times and errors of one configuration."""
    chosen = measured.configuration
    return {
        "label": chosen.label,
        "kind": "function" if chosen.own else "built-in",
        "layer": "airlight",
        "method": chosen.method,
        "kernel": chosen.kernel,
        "parameters": dict(chosen.parameters),
        "knows_shadows": knows_shadows(chosen) if measured.knows_shadows is None else measured.knows_shadows,
        "refused": measured.refused,
        "left_out": measured.left_out,
        "note": measured.note,
        "times": plain(measured.times),
        "memory": measured.memory,
        "error": plain(measured.error),
        "surface_error": plain(measured.surface_error),
        "flip": measured.flip.to_json() if measured.flip else None,
        "files": {},
    }


def image_data(measured: ImageMeasurement) -> dict[str, Any]:
    """Return the errors of an engine's image, with the keys of `measurement_data`."""
    return {
        "label": measured.shown.label,
        "kind": "image",
        "layer": measured.layer,
        "pixel": measured.pixel,
        "method": "image",
        "kernel": None,
        "parameters": {},
        "knows_shadows": True,
        "refused": None,
        "left_out": False,
        "note": measured.note,
        "times": None,
        "error": plain(measured.error),
        "surface_error": plain(measured.surface_error),
        "flip": measured.flip.to_json() if measured.flip else None,
        "files": {},
    }


def scaling_data(name: str, size: tuple[int, int], found: Scaling) -> dict[str, Any]:
    """Return how a method grows with one kind of work, in a scene with images of a size [pixels]."""
    shown = {"scene": Path(name).stem, "size": list(size), "label": found.configuration.label, "kind": found.kind}
    growth = {time: plain(of_time) for time, of_time in found.growth.items()}
    return shown | {"costs": plain(found.costs), "growth": growth, "refused": found.refused}
