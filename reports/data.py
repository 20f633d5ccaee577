# SPDX-License-Identifier: BSD-3-Clause
"""The data of a report: plain numbers and words, ready for JSON.

`report.json` has the schema "airlight-report/1": `environment`, `settings`, `claims` (sentences) and `scenes`, each
with `truth`, `agreement` by estimator and layer, `multiple` (what single scattering leaves out) and `methods`, each of
these with `times` [ms], `error` (airlight) and `surface_error`, and the files written; `kernels` and `mutations`, where
the effort includes them. Not-a-number is null.
"""

from dataclasses import asdict, is_dataclass
from typing import Any

from realtime.plan import describe
from validation.bench import Measurement, knows_shadows
from validation.metrics import plain as plain_value
from validation.study import SceneStudy

SCHEMA = "airlight-report/1"


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
        "method": measured.configuration.method,
        "kernel": measured.configuration.kernel,
        "parameters": dict(measured.configuration.parameters),
        "knows_shadows": knows_shadows(measured.configuration),
        "refused": measured.refused,
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


def claims(scenes: list[dict[str, Any]]) -> list[str]:
    """Return the sentences at the top of a report; each follows from numbers in `scenes`."""
    sentences = [_trust(scenes)] if scenes else []
    for target in (0.01, 0.001):
        sentences += [_fastest(scene, target) for scene in scenes]
    sentences += [_left_out(scenes)] if scenes else []
    refused = [f"{m['label']} in {scene['name']}" for scene in scenes for m in scene["methods"] if m["refused"]]
    if refused:
        sentences.append("Refused, with the reason in the tables: " + "; ".join(refused) + ".")
    return sentences


_WORDS = {"volpath": "Mitsuba's volpath", "single-scatter": "our own Mitsuba integrator"}


def _trust(scenes: list[dict[str, Any]]) -> str:
    """Return a sentence for each estimator that checked the truth."""
    compared = [(scene["name"], one) for scene in scenes for one in scene["agreement"].values()]
    if not compared:
        return "There is no light to compare with Mitsuba's volpath: no airlight and no lit surface in any scene."
    estimators = dict.fromkeys(one["estimator"] for _, one in compared)
    return " ".join(
        _verdict(_WORDS[name], [pair for pair in compared if pair[1]["estimator"] == name]) for name in estimators
    )


def _verdict(words: str, compared: list[tuple[str, dict[str, Any]]]) -> str:
    failed = [f"{name} ({one['layer']})" for name, one in compared if not one["statistics"]["equivalent"]]
    margin = 100 * compared[0][1]["statistics"]["margin"]
    if failed:
        return (
            f"The truth is NOT confirmed within {margin:g} % by {words} in {', '.join(failed)}: there the 95 % "
            "interval of the relative bias is not inside the margin."
        )
    detectable = max(one["statistics"]["detectable_bias"] for _, one in compared)
    return (
        f"The truth is confirmed by {words} in {len(compared)} of {len(compared)} comparisons: the 95 % interval of "
        f"the pooled relative bias lies within ±{margin:g} %; the least bias that would have been found is at worst "
        f"{100 * detectable:.2g} %."
    )


def _fastest(scene: dict[str, Any], target: float) -> str:
    measured = [m for m in scene["methods"] if m["error"] and m["error"]["relative_rmse"] is not None]
    # Pixels that are not finite are left out of the RMSE: a method that has any must not win by it.
    good = [m for m in measured if m["error"]["relative_rmse"] <= target and not m["error"].get("nonfinite")]
    if not good:
        return f"{scene['name']}: no method reaches a relative RMSE of {100 * target:g} %."
    best = min(good, key=lambda m: m["times"]["frame"]["median_ms"])
    milliseconds = best["times"]["frame"]["median_ms"]
    return (
        f"{scene['name']}: the fastest method within {100 * target:g} % relative RMSE is {best['label']}: "
        f"{milliseconds:.3g} ms a frame ({1000 / milliseconds:.0f} frames/s)."
    )


def _left_out(scenes: list[dict[str, Any]]) -> str:
    shares = "; ".join(f"{scene['name']} {100 * scene['multiple']['medium']['value']:.2g} %" for scene in scenes)
    return f"Every method here scatters once. The share of the airlight that this leaves out: {shares}."
