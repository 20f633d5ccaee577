# SPDX-License-Identifier: BSD-3-Clause
"""What the documentation takes from a report: its numbers without the long tables.

The documentation is built from `docs/data/report.json`, schema "airlight-docs/1": `report` (when, by which command, on
which machine), `claims`, `scenes` (each with `baseline`, `counts`, `truth`, `multiple` and `methods`), `kernels` (costs
and errors of `airlight bench --kernels`, or null). Pictures are those of `airlight gallery`.

Stale numbers fail a test, which compares what a scene's numbers were measured with and what is measured now.
"""

import json
from pathlib import Path
from typing import Any

from analytic.errors import InputError
from reference.storage.files import ensure_folder, write_text
from reports.data.json_files import read_json
from reports.data.reader import read_report

SCHEMA = "airlight-docs/1"

_ERRORS = ("relative_rmse", "relative_bias", "p50", "p99", "max", "nonfinite", "negative")
_METHOD = ("label", "method", "kernel", "parameters", "knows_shadows", "refused", "left_out", "note")
_COST = ("kernel", "family", "size", "phase", "g", "device", "wall", "median", "p99", "max", "nonfinite", "refused")


def refresh(data: Path, *, report: Path | None = None, kernels: Path | None = None) -> list[Path]:
    """Write the data of the documentation anew from a report, from the costs of kernels, or both; return the files.

    Parameters
    ----------
    data
        The folder `docs/data`.
    report
        A folder that `airlight report` wrote.
    kernels
        What `airlight bench --kernels --json` printed. What is not given stays as it was.

    Raises
    ------
    InputError
        If a file is not what it should be; nothing is written then.
    """
    path = data / "report.json"
    kept: dict[str, Any] = {"schema": SCHEMA, "kernels": None}
    if path.exists():
        kept = _read_object(path, "the data of the documentation")
    if report is not None:
        kept |= kept_of_report(read_report(report))
    if kernels is not None:
        costs = _read_object(kernels, "what `airlight bench --kernels --json` prints")
        kept["kernels"] = kept_of_kernels(costs, kernels)
    ensure_folder(data)
    write_text(path, json.dumps(kept, indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    return [path]


def _read_object(path: Path, what: str) -> dict[str, Any]:
    """Return the object in a JSON file; raises InputError if the file is not there or holds something else."""
    data = read_json(path, what)
    if not isinstance(data, dict):
        raise InputError(f"{path}: wanted {what}")
    return data


def kept_of_report(report: dict[str, Any]) -> dict[str, Any]:
    """Return the parts of a report that the documentation keeps."""
    environment = report["environment"]
    return {
        "report": {
            "created": report["created"],
            "command": report["command"],
            "effort": report["settings"]["name"],
            "timed": report["settings"]["timed"],
            "processor": environment["processor"],
            "threads": environment["threads"],
            "variant": environment["variant"],
            "versions": environment["versions"],
        },
        "claims": [claim["text"] for claim in report["claims"]],
        "scenes": [_kept_scene(scene) for scene in report["scenes"] if scene["path"] is None],
    }


def baseline_revision(scene: str) -> int | None:
    """Return the revision of the accuracy baseline of a scene in this checkout, None where there is none."""
    path = Path(__file__).resolve().parents[2] / "tests/evidence/baselines" / f"{scene}.json"
    return json.loads(path.read_text(encoding="utf-8"))["revision"] if path.is_file() else None


def _kept_scene(scene: dict[str, Any]) -> dict[str, Any]:
    built_in = [entry for entry in scene["methods"] if entry["kind"] == "built-in"]
    return {
        "name": scene["name"],
        "size": scene["size"],
        "baseline": baseline_revision(scene["name"]),
        "plan": scene["plan"],
        "counts": counts(scene["name"]),
        "truth": scene["truth"],
        "multiple": scene["multiple"],
        "methods": [_kept_method(entry) for entry in built_in],
    }


def _kept_method(entry: dict[str, Any]) -> dict[str, Any]:
    times = {name: entry["times"][name] for name in ("frame", "airlight", "light_moved")} if entry["times"] else None
    error = {name: entry["error"][name] for name in _ERRORS} if entry["error"] else None
    return {name: entry[name] for name in _METHOD} | {"times": times, "error": error}


def counts(name: str) -> dict[str, int]:
    """Return how many shapes, triangles and lights a built-in scene has."""
    from validation.scenes.loading import load_scene

    scene = load_scene(name, (8, 6)).scene
    shapes = scene.shapes()
    triangles = sum(shape.face_count() for shape in shapes if shape.is_mesh())
    return {"shapes": len(shapes), "triangles": int(triangles), "lights": len(scene.emitters())}


def kept_of_kernels(costs: dict[str, Any], path: Path) -> dict[str, Any]:
    """Return the costs of kernels that the documentation keeps; raises InputError if a key is missing."""
    try:
        rows = costs["kernels"]["costs"]
        environment = costs["environment"]
        return {
            "processor": environment["processor"],
            "threads": environment["threads"],
            "variant": environment["variant"],
            "costs": [{name: row[name] for name in _COST} for row in rows],
            "convergence": costs["convergence"],
        }
    except (KeyError, TypeError) as error:
        raise InputError(f"{path}: wanted what `airlight bench --kernels --json` prints, {error} is missing") from error
