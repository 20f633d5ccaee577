# SPDX-License-Identifier: BSD-3-Clause
"""What figures and tables read of a report: report.json, checked, without Mitsuba."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from reports.data.reader import read_report

FOLDER = Path("airlight-report")  #: where `airlight report` writes unless told otherwise


def report_origin(folder: Path | str, data: dict[str, Any]) -> dict[str, Any]:
    """Return the date and machine of a report, for `reports.figures.files.write_data`."""
    return {
        "report": {"created": data["created"], "command": data["command"], "folder": Path(folder).name},
        "environment": data["environment"],
    }


def reported_papers(folder: Path | str | None) -> tuple[list[dict[str, Any]], dict[str, Any]]:
    """Return the claims of papers in a report, and its origin as of `report_origin`; nothing without a report."""
    if folder is None:
        return [], {}
    data = read_report(folder)
    return data.get("papers") or [], report_origin(folder, data)


def measured(scene: dict[str, Any], layer: str = "airlight") -> Iterator[dict[str, Any]]:
    """Yield the methods of a scene that were not refused and whose error is of a layer."""
    for entry in scene["methods"]:
        if not entry["refused"] and entry["error"] and entry.get("layer", "airlight") == layer:
            yield entry
