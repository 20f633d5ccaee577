# SPDX-License-Identifier: BSD-3-Clause
"""The data of a report: plain numbers and words, ready for JSON.

docs/report-schema.md explains every key of the schema "airlight-report/2". Not-a-number is null.
"""

from dataclasses import asdict, is_dataclass
from typing import Any

from realtime.plan import describe
from validation.bench import Measurement, knows_shadows
from validation.metrics import plain as plain_value
from validation.study import SceneStudy

SCHEMA = "airlight-report/2"


def plain(value: Any) -> Any:
    """Return dataclasses, NumPy numbers and containers as what JSON can hold."""
    if is_dataclass(value) and not isinstance(value, type):
        return plain(asdict(value))
    if isinstance(value, dict):
        return {str(key): plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    return plain_value(value)


def scene_data(study: SceneStudy) -> dict[str, Any]:
    """Return what a study found, without its images."""
    import numpy as np

    truth = study.truth
    finite = np.isfinite(truth.airlight)
    height, width = truth.distance.shape
    mean = float(truth.airlight[finite].mean()) if finite.any() else float("nan")
    return {
        "name": study.loaded.name,
        "purpose": study.loaded.purpose,
        "published": study.loaded.published,
        "path": str(study.loaded.path) if study.loaded.path else None,
        "size": [width, height],
        "plan": describe(study.plan),
        "notes": list(study.plan.notes),
        "truth": plain(
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
        ),
        "agreement": plain(study.agreement),
        "multiple": plain(study.multiple),
        "methods": [measurement_data(one) for one in study.measurements],
    }


def measurement_data(measured: Measurement) -> dict[str, Any]:
    """Return what one configuration costs and how wrong it is."""
    return {
        "label": measured.configuration.label,
        "kind": "function" if ":" in measured.configuration.method else "built-in",
        "layer": "airlight",
        "method": measured.configuration.method,
        "kernel": measured.configuration.kernel,
        "parameters": dict(measured.configuration.parameters),
        "knows_shadows": knows_shadows(measured.configuration),
        "refused": measured.refused,
        "left_out": False,
        "note": measured.note,
        "times": plain(measured.times),
        "error": plain(measured.error),
        "surface_error": plain(measured.surface_error),
        "flip": measured.flip.to_json() if measured.flip else None,
        "files": {},
    }


def mutations_data(study: Any) -> dict[str, Any]:
    """Return what `validation.mutations.study_mutations` found, in full."""
    return {
        "caught": study.caught,
        "count": len(study.results),
        "passed": study.passed,
        "results": plain(study.results),
    }
