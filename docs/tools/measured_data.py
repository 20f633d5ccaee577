# SPDX-License-Identifier: BSD-3-Clause
"""Data of a report for the documentation: `python docs/tools/measured_data.py
[--report DIR] [--kernels FILE]`.

It writes `docs/data/report.json`: `report` (when, by which command, on which machine), `claims`,
`scenes` (each with `counts`, `reference`, `multiple` and `methods`) and `kernels` (costs and errors
of `airlight study kernels`, or null). `fill_pages.py` then writes the tables of the pages.
"""

import argparse
import json
import re
from dataclasses import asdict
from pathlib import Path
from typing import Any

from airlight.errors import InputError
from airlight.reference.storage.files import write_text
from airlight.reports.data.records import read_json, read_report
from airlight.reports.machine.environment import activate

DATA = Path(__file__).resolve().parents[1] / "data" / "report.json"

_ERRORS = ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")
_METHOD = (
    *("scene", "label", "method", "kernel", "parameters", "width", "height", "knows_shadows"),
    *("status", "reason", "note"),
)
_COST = (
    "kernel",
    "family",
    "size",
    "phase",
    "g",
    "device",
    "wall",
    "median",
    "p99",
    "max",
    "nonfinite",
    "refused",
)


def refresh(report: Path | None, kernels: Path | None) -> None:
    """Write the data again from a report, from the costs of kernels, or both; what is
    not given stays as it was.
    """
    kept: dict[str, Any] = {"kernels": None}
    if DATA.exists():
        kept = _read_object(DATA, "the data of the documentation")
    if report is not None:
        kept |= kept_of_report(asdict(read_report(report)))
    if kernels is not None:
        costs = _read_object(kernels, "what `airlight study kernels -o FILE.json` writes")
        kept["kernels"] = kept_of_kernels(costs, kernels)
    write_text(DATA, json.dumps(kept, indent=1, ensure_ascii=False, allow_nan=False) + "\n")


def _read_object(path: Path, what: str) -> dict[str, Any]:
    """Return the object in a JSON file; raises InputError if the file is not there
    or holds something else.
    """
    data = read_json(path, what)
    if not isinstance(data, dict):
        raise InputError(f"{path}: expected {what}")
    return data


def kept_of_report(report: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a report that the documentation keeps."""
    environment = report["environment"]
    return {
        "report": {
            "created": report["created"],
            # The folder of the report is one of the machine that made it.
            "command": re.sub(r" (-o|--output)[ =]\S+", "", report["command"]),
            "effort": report["settings"]["name"],
            "timed": report["settings"]["measure"]["timed_size"] or report["settings"]["sizes"][0],
            "processor": environment["processor"],
            "threads": environment["threads"],
            "variant": environment["variant"],
            "versions": environment["versions"],
        },
        "claims": [claim["text"] for claim in report["claims"]],
        "scenes": [_kept_scene(scene) for scene in report["scenes"] if scene["path"] is None],
    }


def _kept_scene(scene: dict[str, Any]) -> dict[str, Any]:
    built_in = [entry for entry in scene["methods"] if entry["kind"] == "built-in"]
    return {
        "name": scene["name"],
        "size": scene["size"],
        "plan": scene["plan"],
        "counts": counts(scene["name"]),
        "reference": scene["reference"],
        "multiple": scene["multiple"],
        "methods": [_kept_method(entry) for entry in built_in],
    }


def _kept_method(entry: dict[str, Any]) -> dict[str, Any]:
    times = (
        {name: entry["times"][name] for name in ("frame", "airlight", "light_moved", "run")}
        if entry["times"]
        else None
    )
    error = {name: entry["error"][name] for name in _ERRORS} if entry["error"] else None
    return {name: entry[name] for name in _METHOD} | {"times": times, "error": error}


def counts(name: str) -> dict[str, int]:
    """Return how many shapes, triangles and lights a built-in scene has."""
    from airlight.validation.scenes.loading import load_scene

    scene = load_scene(name, (8, 6)).scene
    shapes = scene.shapes()
    triangles = sum(shape.face_count() for shape in shapes if shape.is_mesh())
    return {"shapes": len(shapes), "triangles": int(triangles), "lights": len(scene.emitters())}


def kept_of_kernels(costs: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the costs of kernels that the documentation keeps; raises
    InputError if a key is missing.
    """
    try:
        rows = costs["kernels"]["costs"]
        environment = costs["environment"]
        return {
            "processor": environment["processor"],
            "threads": environment["threads"],
            "variant": environment["variant"],
            "costs": [{name: row[name] for name in _COST} for row in rows],
        }
    except (KeyError, TypeError) as error:
        raise InputError(
            f"{path}: {error} is missing of what `airlight study kernels -o FILE.json` writes"
        ) from error


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--report", type=Path, help="a folder that `airlight report` wrote")
    parser.add_argument(
        "--kernels", type=Path, help="what `airlight study kernels -o FILE.json` wrote"
    )
    chosen = parser.parse_args()
    activate()  # counting shapes and triangles loads the scenes
    refresh(chosen.report, chosen.kernels)
