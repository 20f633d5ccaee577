# SPDX-License-Identifier: BSD-3-Clause
"""The table of the methods: time of a frame with its quartiles and errors of the airlight, by scene of a report."""

from pathlib import Path

from reference.storage.files import ensure_folder
from reports.data.reader import read_report
from reports.figures.files import pixels, value, write_data
from reports.figures.report import report_origin
from reports.tables.drawing import latex
from reports.tables.methods import methods_table
from reports.tables.table import Measured, Row, Table, Value, number

NAME = "methods-table"
SUMMARY = "LaTeX table of times and errors of every method in every scene, from a report"

_TIMES = ("frame", "light_moved", "objects_moved")
_ENDS = {"": "median_ms", "_low": "low_ms", "_high": "high_ms"}
_ERRORS = ("relative_rmse", "relative_bias", "p99")
_HEADER = (
    *("scene", "width", "height", "label", "layer"),
    *(f"{name}_ms{end}" for name in _TIMES for end in _ENDS),
    *("repetitions", *_ERRORS, "nonfinite", "truth_bound", "refused"),
)


def compute(folder: Path | str, *, report: Path | str) -> None:
    """Write `methods-table.csv` into a folder: times [ms] and errors of every method in every scene of a report."""
    target, data = ensure_folder(folder), read_report(report)
    rows = []
    for scene in data["scenes"]:
        bound = (scene["truth"] or {}).get("relative_bound")
        for entry in scene["methods"]:
            error, times = entry["error"] or {}, entry["times"] or {}
            timings = [times.get(name) or {} for name in _TIMES]
            shown = (timing.get(key) for timing in timings for key in _ENDS.values())
            errors = [error.get(name) for name in (*_ERRORS, "nonfinite")]
            what = (scene["name"], *scene["size"], entry["label"], entry.get("layer", "airlight"))
            rows.append((*what, *shown, timings[0].get("repetitions"), *errors, bound, entry["refused"]))
    settings = {name: data["settings"].get(name) for name in ("image", "timed")}
    write_data(target, NAME, _HEADER, rows, **report_origin(report, data), settings=settings)


def tabular(rows: list[dict[str, str]]) -> str:
    """Return the LaTeX table, see `reports.figures.files.plot`."""
    scenes = dict.fromkeys(row["scene"] for row in rows)
    comment = (
        "Times: medians with the distances to the quartiles, kernels compiled before.",
        "Errors of the airlight against the quadrature truth; p99: quantile of |error| / max(truth, mean / 1000).",
    )
    return latex([_scene([row for row in rows if row["scene"] == scene]) for scene in scenes], comment=comment)


def _scene(rows: list[dict[str, str]]) -> Table:
    bound = value(rows[0], "truth_bound")
    truth = f", truth known to {number(bound, 2, zeros=True)}" if bound else ""
    keys = ("label", *_TIMES, *_ERRORS)
    return methods_table(rows[0]["scene"], [_row(row) for row in rows], *keys, explanation=pixels(rows[0]) + truth)


def _row(row: dict[str, str]) -> Row:
    if row["refused"]:
        return Row({"label": row["label"]}, "refused")
    values: dict[str, Value] = {"label": row["label"]} | {name: value(row, name) for name in _ERRORS}
    for name in _TIMES:
        median, low, high = (value(row, f"{name}_ms{end}") for end in _ENDS)
        values[name] = None if median is None or low is None or high is None else Measured(median, low, high)
    bad = value(row, "nonfinite")
    remarks = [] if row["layer"] == "airlight" else [row["layer"]]
    return Row(values, remarks=(*remarks, *([f"{bad:.0f} pixels not finite"] if bad else [])))
