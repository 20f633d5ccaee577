# SPDX-License-Identifier: BSD-3-Clause
"""Content of report.json by hand: one builder for all tests, whose parts have every key
that the records ask for.

`timing`, `errors`, `entry`, `scene`, `report_of` and their likes make the parts as JSON has them,
with arguments for what a test is about; `checked` makes the record of a whole report, `record_of`
that of a part. `report` makes reports for comparisons, with times that are as noisy as a machine.
"""

import copy
import itertools
from collections.abc import Sequence
from dataclasses import fields
from typing import Any

import numpy as np

from airlight.reports.data.records import Report
from airlight.validation.columns import record_of
from airlight.validation.statistics.records import Statistics

LABELS = (
    "unshadowed (exact)",
    "ray-march (steps=100)",
    "shadow-planes (exact)",
    "light-volumes (exact)",
)
SCENES = ("fog", "hall", "pens")
WHEN = "2026-11-21 12:00:00 +0000"
RUN = {
    "started": WHEN,
    "rounds": 5,
    "anchor": None,
    "between": 1.01,
    "within": 1.02,
    "steady": True,
}
_RUNS = itertools.count()  # no two reports to compare are of one run

# of a frame's work
_STAGES = {"surface": 0.3, "airlight": 0.7, "frame": 1.0, "light_moved": 1.4, "objects_moved": 1.9}


def checked(data: dict[str, Any]) -> Report:
    """Return the record of a report; a fake that is none is a fault of its test."""
    return record_of(data, Report)


def timing(median: float) -> dict[str, Any]:
    """Return a timing with its quartiles [ms]."""
    return {
        "median_ms": median,
        "low_ms": 0.9 * median,
        "high_ms": 1.2 * median,
        "repetitions": 7,
        "cpu_ms": None,
    }


def growth_record(
    *,
    cliff: bool = False,
    refused: str | None = None,
    works: Sequence[float] = (100.0, 400.0),
    exponent: float = 0.47,
    size: tuple[int, int] = (80, 60),
) -> dict[str, Any]:
    """Return how shadow planes grow with the triangles of `hall`; with `cliff`, a frame jumps."""
    growth = {
        "exponent": exponent,
        "standard_error": 0.01,
        "steepest": 1.93,
        "at": works[-1] if works else None,
    }
    times = ("frame", "light_moved", "objects_moved")
    return {
        "scene": "hall",
        "size": list(size),
        "label": "shadow-planes (exact)",
        "kind": "triangles",
        "costs": [
            {"work": work, "memory": 71.5}
            | {name: timing(0.31 * work) for name in (*times, "rays")}
            for work in works
        ],
        "growth": {name: growth | {"cliff": cliff and name == "frame"} for name in times},
        "refused": refused,
    }


def errors(relative_rmse: float | None, **changes: Any) -> dict[str, Any]:
    """Return the errors of an image, all in proportion; no number where there is none."""
    fractions = {
        "relative_bias": 0.1,
        "rmse": 0.1,
        "relative_rmse": 1.0,
        "p50": 0.5,
        "p99": 3.0,
        "max": 10.0,
    }
    scaled = {
        name: None if relative_rmse is None else fraction * relative_rmse
        for name, fraction in fractions.items()
    }
    return {"pixels": 76800, "bias": 1e-4, "nonfinite": 0, "negative": 0} | scaled | changes


def flip(value: float | None, note: str = "") -> dict[str, Any]:
    """Return an HDR-FLIP."""
    exposures = {
        "start_exposure": -1.0,
        "stop_exposure": 2.0,
        "exposures": 4,
        "pixels_per_degree": 67.0,
    }
    return {"value": value, "note": note} | exposures


def entry(
    label: str, relative_rmse: float | None = 0.01, median: float = 2.0, **changes: Any
) -> dict[str, Any]:
    """Return what a report says of a configuration, which takes so many milliseconds a frame."""
    name, _, inside = label.partition(" (")
    kernel = inside.rstrip(")").split(", ")[0]
    made = {
        "scene": "fog",
        "label": label,
        "method": name,
        "parameters": "{}",
        "width": 320,
        "height": 240,
    }
    made |= {
        "kernel": kernel if kernel and "=" not in kernel else None,
        "status": "done",
        "files": {},
    }
    made |= {
        "times": {"run": RUN}
        | {stage: timing(fraction * median) for stage, fraction in _STAGES.items()}
    }
    made |= {"error": errors(relative_rmse), "measured": WHEN, "seconds": 1.5, "cached": False}
    return made | dict.fromkeys(("reason", "note", "surface_error", "flip")) | changes


def refused(label: str, why: str, **changes: Any) -> dict[str, Any]:
    """Return what a report says of a configuration that was refused."""
    return entry(label, status="refused", reason=why, times=None, error=None) | changes


def engine(label: str, relative_rmse: float = 0.1, **changes: Any) -> dict[str, Any]:
    """Return what a report says of an engine's image: judged by its total, without times."""
    return (
        entry(
            label,
            relative_rmse,
            kind="image",
            layer="total",
            method="image",
            kernel=None,
            times=None,
        )
        | changes
    )


def agreement(
    equivalent: bool | None = True,
    estimator: str = "volpath",
    *,
    layer: str = "airlight",
    detectable: float | None = 0.002,
    margin: float = 0.01,
    finished: bool = True,
    **statistics: Any,
) -> dict[str, Any]:
    """Return the comparison of the reference with an estimator."""
    known: dict[str, Any] = {
        "margin": margin,
        "equivalent": equivalent,
        "detectable_bias": detectable,
    }
    known |= {"relative_bias": 1.7e-4, "relative_bias_ci": [0.0 if equivalent else -0.02, 0.001]}
    known |= {"relative_bias_ci_batches": None, "z_mean": 0.013, "z_std": 1.021, "rejected": 3}
    known |= {"expected_rejections": 0.01}
    for each in fields(Statistics):
        known.setdefault(each.name, 0)
    run = {
        "width": 160,
        "height": 120,
        "batches": 48,
        "samples": 64,
        "epsilon": 8.94e-4,
        "masked": 11,
    }
    run |= {"uncorrected_bias": 0.0013, "finished": finished}
    return {"estimator": estimator, "layer": layer, "statistics": known | statistics} | run


def reference(**changes: Any) -> dict[str, Any]:
    """Return how exact the reference of a scene is."""
    counts = dict.fromkeys(("transitions", "checked", "disagreements", "refined", "left"), 0)
    return {"mean": 1.0, "relative_error": 1e-10, "missed": 0.0} | counts | changes


def fraction(value: float) -> dict[str, Any]:
    """Return a fraction of the light with its interval."""
    return {"value": value, "interval": [value - 0.003, value + 0.003]}


def scene(name: str, methods: list[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    """Return what a report says of a scene."""
    made = {
        "name": name,
        "purpose": f"A {name}.",
        "published": "",
        "path": None,
        "notes": [],
        "exposure": 1.0,
    }
    made |= {"size": [320, 240], "timed": [320, 240], "reference": reference(), "methods": methods}
    made |= {
        "plan": {
            "shadows": "visibility tests",
            "medium": "unbounded",
            "lights": "1 point",
            "extinction": "one",
        }
    }
    multiple = {
        "medium": fraction(0.123),
        "everything": fraction(0.21),
        "max_depth": 64,
        "batches": 4,
        "samples": 1,
    }
    made |= {
        "agreement": {"volpath airlight": agreement()},
        "multiple": multiple,
        "seconds": {"reference": 0.5},
    }
    files = {
        "exr": "reference.exr",
        "picture": "reference.png",
        "airlight": "reference-airlight.png",
    }
    return made | {"files": {kind: f"{name}/{file}" for kind, file in files.items()}} | changes


def settings(**changes: Any) -> dict[str, Any]:
    """Return an effort."""
    measure = {
        "times": "stages",
        "seconds": 0.1,
        "timed_size": [320, 240],
        "slow": 1.0,
        "limit": 1.0,
    }
    checks = {
        "size": [64, 48],
        "margins": {"volpath": 0.01},
        "samples": {"volpath": 4},
        "batches": 8,
    }
    checks |= {"multiple": [4, 1], "patience": 1.0}
    made = {
        "name": "quick",
        "scenes": [],
        "sizes": [[320, 240]],
        "measure": measure,
        "checks": checks,
    }
    return made | {"flip": "none", "stability": 0} | changes


def environment(**changes: Any) -> dict[str, Any]:
    """Return a machine."""
    versions = {"airlight": "0.1.0", "mitsuba": "3.9.1", "drjit": "1.5.0"}
    known = {
        "versions": versions,
        "platform": "none",
        "processor": "abacus",
        "threads": 2,
        "variant": "llvm_ad_rgb",
    }
    return known | changes


def stable(kernel: str, *broken: str) -> dict[str, Any]:
    """Return the stability of a kernel, which breaks some of its bars."""
    return {"kernel": kernel, "exact": True, "refused": {}, "sets": [], "broken": [*broken]}


def report_of(scenes: list[dict[str, Any]], **changes: Any) -> dict[str, Any]:
    """Return the content of a report."""
    made = {
        "schema": "airlight-report/5",
        "created": "2026-11-21 12:00:01 +0000",
        "command": "airlight report",
    }
    made |= {"seconds": 2.0, "parts": {"scenes": 2.0}, "cached": 0, "computed": 4}
    made |= {
        "measured": {"first": WHEN, "last": WHEN},
        "settings": settings(),
        "environment": environment(),
    }
    made |= {
        "claims": [
            {"kind": "reference", "text": "The reference is confirmed by volpath.", "good": True}
        ]
    }
    return made | {"scenes": scenes, "stability": []} | changes


# --- reports to compare ---------------------------------------------------------------------------


def sampled(samples) -> dict[str, Any]:
    """Return the timing that repetitions give [ms]."""
    low, median, high = np.percentile(samples, [25, 50, 75]).tolist()
    return {
        "median_ms": median,
        "low_ms": low,
        "high_ms": high,
        "repetitions": len(samples),
        "cpu_ms": None,
    }


def times(
    frame_ms: float, rng: np.random.Generator | None = None, *, busy: float = 0.0
) -> dict[str, Any]:
    """Return the times of a configuration.

    Without a generator exact ones. A machine that is busy now and then, by the fraction `busy`,
    adds up to three times the work to whole timings, and to single repetitions of the others: both
    were seen.
    """
    stages: dict[str, Any] = {"run": RUN | {"started": f"run {next(_RUNS)}"}}
    for stage, fraction in _STAGES.items():
        count = 40 if fraction <= 1 else 12
        samples = np.full(count, frame_ms * fraction)
        if rng is not None:
            samples *= 1 + 0.01 * rng.exponential(size=count)
            if rng.random() < busy:
                samples *= 1 + rng.uniform(0.3, 1.0)
            hit = rng.random(count) < busy * rng.uniform(0.5, 2.0)
            samples += hit * frame_ms * fraction * rng.uniform(0.5, 3.0, size=count)
        stages[stage] = sampled(samples)
    return stages


def report(seed: int | None = None, *, busy: float = 0.0, machine: float = 1.0) -> dict[str, Any]:
    """Return a report; the times of a seed, on a machine that takes `machine` times as long."""
    rng = None if seed is None else np.random.default_rng(seed)
    scenes = []
    for number, name in enumerate(SCENES):
        methods = [
            entry(
                label,
                10.0 ** -(1 + place),
                times=times(machine * (0.7 + number) * (1 + 3 * place), rng, busy=busy),
                surface_error=errors(1e-6),
                flip=flip(0.01 * (place + 1)),
            )
            for place, label in enumerate(LABELS)
        ]
        scenes.append(scene(name, methods, reference=reference(mean=0.127 + number)))
    return report_of(copy.deepcopy(scenes), stability=[stable("exact")])


def method(
    data: dict[str, Any], scene: str = "hall", label: str = "shadow-planes (exact)"
) -> dict[str, Any]:
    (entry,) = (entry for entry in data["scenes"] if entry["name"] == scene)
    (configuration,) = (
        configuration for configuration in entry["methods"] if configuration["label"] == label
    )
    return configuration


def slow_down(
    configuration: dict[str, Any], factor: float, stages: tuple[str, ...] = tuple(_STAGES)
) -> None:
    """Make stages of a method slower."""
    for stage in stages:
        for name in ("median_ms", "low_ms", "high_ms"):
            configuration["times"][stage][name] *= factor
