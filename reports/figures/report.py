# SPDX-License-Identifier: BSD-3-Clause
"""What figures and tables read of a report: report.json, checked, without Mitsuba."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from analytic.errors import InputError

FOLDER = Path("airlight-report")  #: where `airlight report` writes unless told otherwise
_SCHEMAS = ("airlight-report/1", "airlight-report/2")


def read_report(folder: Path | str) -> dict[str, Any]:
    """Return the content of a report's report.json.

    Raises
    ------
    InputError
        If there is none, or it is of a schema that is not known here.
    """
    path = Path(folder) / "report.json"
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(f"{path} is missing; write a report with `airlight report -o {folder}` first") from None
    except ValueError as error:
        raise InputError(f"{path} is no JSON ({error}); write it again with `airlight report -o {folder}`") from None
    schema = data.get("schema") if isinstance(data, dict) else None
    if schema not in _SCHEMAS:
        raise InputError(f"{path}: got the schema {schema!r}, wanted one of {', '.join(_SCHEMAS)}; write it again")
    return data


def report_origin(folder: Path | str, data: dict[str, Any]) -> dict[str, Any]:
    """Return what `reports.figures.files.write_data` says of a report: its date and machine, not ours."""
    return {
        "report": {"created": data["created"], "command": data["command"], "folder": Path(folder).name},
        "environment": data["environment"],
    }


def reported_papers(folder: Path | str | None) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return what a report holds of the papers, and its origin as of `report_origin`; nothing without a report."""
    if folder is None:
        return {}, {}
    data = read_report(folder)
    return data.get("published") or {}, report_origin(folder, data)


def measured(scene: dict[str, Any], layer: str = "airlight") -> Iterator[dict[str, Any]]:
    """Yield the methods of a scene that were not refused and whose error is of a layer."""
    for one in scene["methods"]:
        if not one["refused"] and one["error"] and one.get("layer", "airlight") == layer:
            yield one
