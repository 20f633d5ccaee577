# SPDX-License-Identifier: BSD-3-Clause
"""Rows of a sweep made by a seeded generator, so that what must come out is known."""

import hashlib
import io
import json

import numpy as np
from PIL import Image

from airlight.validation.study.row import COLUMNS, arrow_schema, property_names

#: method, kernel, parameters, and the median of its error, its spread in
#: e-folds, and its time [ms].
METHODS = (
    ("unshadowed", "exact", {}, 0.2, 1.0, 1.0),
    ("ray-march", None, {"steps": 16}, 0.03, 0.8, 2.0),
    ("ray-march", None, {"steps": 100}, 0.004, 0.8, 9.0),
    ("shadow-planes", "exact", {}, 2e-6, 0.5, 6.0),
    ("light-volumes", "exact", {}, 8e-4, 0.9, 4.0),
)


def label(method, kernel, parameters):
    inside = ", ".join(
        [*([kernel] if kernel else []), *(f"{key}={value}" for key, value in parameters.items())]
    )
    return f"{method} ({inside})" if inside else method


def row(scene="random:0", method="ray-march", kernel=None, parameters=None, **changes):
    """A row that ended, with any columns changed; `property_NAME` for properties."""
    parameters = parameters or {}
    seed = int(scene.removeprefix("random:")) if scene.startswith("random:") else None
    identity = (
        scene,
        method,
        kernel,
        parameters,
        changes.get("medium"),
        changes.get("width"),
        changes.get("height"),
    )
    values = {
        "key": hashlib.sha256(json.dumps(identity).encode()).hexdigest(),
        "study": "test",
        "scene": scene,
    }
    values |= {
        "seed": seed,
        "method": method,
        "kernel": kernel,
        "parameters": json.dumps(parameters),
    }
    values |= {
        "label": label(method, kernel, parameters),
        "width": 160,
        "height": 120,
        "status": "done",
        "attempts": 1,
    }
    error = {"pixels": 19200, "nonfinite": 0, "negative": 0, "rmse": 0.01, "relative_rmse": 0.01}
    error |= {"relative_bias": 0.002, "p50": 0.001, "p99": 0.05}
    frame = {"median_ms": 3.0, "low_ms": 2.9, "high_ms": 3.2}
    origin = {
        "host": "here",
        "device": "a processor",
        "variant": "llvm_ad_rgb",
        "threads": 2,
        "airlight": "0.1.0",
    }
    origin |= {
        "started": "2026-11-23T08:30:00Z",
        "mitsuba": "3.9.1",
        "drjit": "1.5.0",
        "python": "3.11.2",
    }
    reference = {"estimator": "quadrature", "error": 1e-7, "seconds": 0.5}
    run = {"started": "2026-11-23 08:31:00 +0000", "rounds": 5}
    parts = {
        "error": error,
        "reference": reference,
        "times.frame": frame,
        "times.run": run,
        "origin": origin,
    }
    parts |= {"cost": {"alone": True}}
    values |= {
        f"{part}.{name}": value for part, own in parts.items() for name, value in own.items()
    }
    values["command"] = f"airlight compare {scene} --method {method}"
    values |= {column_of(name): value for name, value in changes.items()}
    if values["status"] != "done":
        values = {
            name: None if name.startswith(("error.", "times.", "cost.")) else values[name]
            for name in values
        }
    return {each.key: None for each in COLUMNS} | values


def column_of(name):
    """The column of a short name: `relative_rmse`, `frame_ms`, `property_NAME`."""
    if name.startswith("property_"):
        return name.replace("property_", "properties.")
    known = {each.key for each in COLUMNS}
    return (
        name
        if name in known
        else {
            "frame_ms": "times.frame.median_ms",
            "frame_ms_low": "times.frame.low_ms",
            "frame_ms_high": "times.frame.high_ms",
            "timed_alone": "cost.alone",
            "timed": "times.run.started",
            "rounds": "times.run.rounds",
            "reference": "reference.estimator",
            "reference_error": "reference.error",
            "surface_nonfinite": "surface_error.nonfinite",
            "outside_bound": "stated.outside",
            "bound": "stated.bound",
            **{
                each: f"origin.{each}"
                for each in ("host", "device", "threads", "started", "source", "airlight")
            },
        }.get(name, f"error.{name}")
    )


def rows(scenes=60, seed=3, methods=METHODS):
    """Rows of random scenes. Errors of `ray-march` grow with the optical depth alone,
    those of others with nothing.

    `light-volumes` refuses scenes of more than six lights. `silhouettes` and
    `triangles` say nearly the same.
    """
    rng = np.random.default_rng(seed)
    made = []
    for number in range(scenes):
        depth, lights = 10 ** rng.uniform(-3, 1.3), int(rng.integers(1, 9))
        silhouettes = 10 ** rng.uniform(1, 4)
        properties = {
            "property_optical_depth": depth,
            "property_lights": float(lights),
            "property_silhouettes": silhouettes,
            "property_triangles": 3 * silhouettes * np.exp(0.05 * rng.normal()),
            "property_light_distance": rng.uniform(0.3, 9),
        }
        for method, kernel, parameters, median, spread, time in methods:
            error = median * np.exp(spread * rng.normal())
            if method == "ray-march":
                error = median * depth**0.5 * np.exp(0.3 * rng.normal())
            milliseconds = time * np.exp(0.2 * rng.normal()) * lights**0.5
            changes = {
                "relative_rmse": error,
                "rmse": error,
                "p99": 5 * error,
                "relative_bias": -error / 3,
            }
            changes |= {"frame_ms": milliseconds, "frame_ms_low": 0.97 * milliseconds}
            changes |= {"frame_ms_high": 1.05 * milliseconds}
            if method == "light-volumes" and lights > 6:
                changes |= {
                    "status": "refused",
                    "reason": f"random:{number} has {lights} lights, expected at most 6",
                }
            made.append(
                row(f"random:{number}", method, kernel, parameters, **changes, **properties)
            )
    return made


def write_rows(path, several):
    """Write rows as a sweep does; returns the path."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    schema = arrow_schema(property_names(several))
    pq.write_table(
        pa.Table.from_pylist(list(several), schema=schema), path, write_page_checksum=True
    )
    return path


def picture(number):
    """A small picture, as a row may have one."""
    pixels = np.random.default_rng(number).integers(0, 255, (12, 48, 3), dtype=np.uint8)
    stored = io.BytesIO()
    Image.fromarray(pixels).save(stored, "webp")
    return stored.getvalue()


def faulty_rows():
    """Rows with pictures of the worst, and one of each fault."""
    several = rows(40)
    for name in {each["label"] for each in several}:
        own = [each for each in several if each["label"] == name and each["status"] == "done"]
        for number, each in enumerate(
            sorted(own, key=lambda each: -each["error.relative_rmse"])[:12]
        ):
            each["picture"] = picture(number)
    several[7] |= {"error.nonfinite": 12, "picture": picture(12)}
    several[13] |= {"stated.outside": 2, "stated.bound": 1e-5}
    several.append(
        row("random:99", parameters={"steps": 16}, status="hung", reason="longer than 60 s")
    )
    return several
