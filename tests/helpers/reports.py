# SPDX-License-Identifier: BSD-3-Clause
"""Reports by hand: a few scenes and methods with errors, and times that are as noisy as a machine."""

import copy
from typing import Any

import numpy as np

LABELS = ("unshadowed (exact)", "ray-march (steps=100)", "shadow-planes (exact)", "light-volumes (exact)")
SCENES = ("fog", "hall", "pens")

_STAGES = {
    "surface": 0.3,
    "airlight": 0.7,
    "frame": 1.0,
    "light_moved": 1.4,
    "objects_moved": 1.9,
}  # of the work of a frame


def timing(samples) -> dict[str, float]:
    low, median, high = np.percentile(samples, [25, 50, 75])
    return {"median_ms": median, "low_ms": low, "high_ms": high, "repetitions": len(samples)}


def times(frame_ms: float, rng: np.random.Generator | None = None, *, busy: float = 0.0) -> dict[str, Any]:
    """Return the times of a configuration.

    Without a generator exact ones. A machine that is busy now and then, by the share `busy`, adds up to three times the
    work to whole timings, and to single repetitions of the others: both were seen.
    """
    found = {}
    for stage, share in _STAGES.items():
        count = 40 if share <= 1 else 12
        samples = np.full(count, frame_ms * share)
        if rng is not None:
            samples *= 1 + 0.01 * rng.exponential(size=count)
            if rng.random() < busy:
                samples *= 1 + rng.uniform(0.3, 1.0)
            hit = rng.random(count) < busy * rng.uniform(0.5, 2.0)
            samples += hit * frame_ms * share * rng.uniform(0.5, 3.0, size=count)
        found[stage] = timing(samples)
    return found


def errors(relative_rmse: float) -> dict[str, Any]:
    return {
        "pixels": 76800,
        "bias": 1e-4,
        "relative_bias": 0.1 * relative_rmse,
        "rmse": 0.1 * relative_rmse,
        "relative_rmse": relative_rmse,
        "p50": 0.5 * relative_rmse,
        "p99": 3 * relative_rmse,
        "max": 10 * relative_rmse,
        "nonfinite": 0,
        "negative": 0,
    }


def agreement(equivalent: bool = True, estimator: str = "volpath") -> dict[str, Any]:
    statistics = {
        "equivalent": equivalent,
        "margin": 0.01,
        "relative_bias_ci": [-0.02 if not equivalent else 0.0, 0.001],
    }
    return {"estimator": estimator, "layer": "airlight", "statistics": statistics}


def report(seed: int | None = None, *, busy: float = 0.0, machine: float = 1.0) -> dict[str, Any]:
    """Return a report of schema 2; the times of a seed, on a machine that takes `machine` times as long."""
    rng = None if seed is None else np.random.default_rng(seed)
    scenes = []
    for number, name in enumerate(SCENES):
        methods = [
            {
                "label": label,
                "kind": "built-in",
                "layer": "airlight",
                "refused": None,
                "note": None,
                "times": times(machine * (0.7 + number) * (1 + 3 * place), rng, busy=busy),
                "error": errors(10.0 ** -(1 + place)),
                "surface_error": errors(1e-6),
                "flip": {"value": 0.01 * (place + 1), "note": None},
            }
            for place, label in enumerate(LABELS)
        ]
        truth = {"mean": 0.127 + number, "relative_bound": 1e-10, "disagreements": 0, "left": 0}
        known = {"volpath airlight": agreement()}
        scenes.append({"name": name, "size": [320, 240], "truth": truth, "agreement": known, "methods": methods})
    return {
        "schema": "airlight-report/2",
        "settings": {"name": "quick", "timed": [320, 240]},
        "environment": {"processor": "one", "threads": 2, "variant": "llvm_ad_rgb", "versions": {"drjit": "1.5.0"}},
        "claims": [{"kind": "truth", "text": "The truth is confirmed by volpath.", "good": True}],
        "scenes": copy.deepcopy(scenes),
        "stability": [{"kernel": "exact", "broken": []}],
        "mutations": {"count": 20, "caught": 20, "passed": True},
    }


def method(data: dict[str, Any], scene: str = "hall", label: str = "shadow-planes (exact)") -> dict[str, Any]:
    (one,) = (one for one in data["scenes"] if one["name"] == scene)
    (found,) = (found for found in one["methods"] if found["label"] == label)
    return found


def slow_down(one: dict[str, Any], factor: float, stages: tuple[str, ...] = tuple(_STAGES)) -> None:
    """Make stages of a method slower."""
    for stage in stages:
        for name in ("median_ms", "low_ms", "high_ms"):
            one["times"][stage][name] *= factor
