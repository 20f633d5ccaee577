# SPDX-License-Identifier: BSD-3-Clause
"""The table of the methods: time of a frame with its quartiles and errors of the airlight, by scene of a report."""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import pixels, value, write_data, write_table
from reports.figures.report import read_report, report_origin
from reports.tables.latex import escape, number, table, with_quartiles

NAME = "methods-table"
SUMMARY = "LaTeX table of times and errors of every method in every scene, from a report"

_HEADER = (
    "scene",
    "width",
    "height",
    "label",
    "layer",
    "frame_ms",
    "frame_ms_low",
    "frame_ms_high",
    "repetitions",
    "light_moved_ms",
    "light_moved_ms_low",
    "light_moved_ms_high",
    "objects_moved_ms",
    "objects_moved_ms_low",
    "objects_moved_ms_high",
    "relative_rmse",
    "relative_bias",
    "p99",
    "nonfinite",
    "truth_bound",
    "refused",
)


def compute(folder: Path | str, *, report: Path | str) -> None:
    """Write `methods-table.csv` into a folder: times [ms] and errors of every method in every scene of a report.

    Parameters
    ----------
    folder
        Where the data go.
    report
        The folder of the report.
    """
    target, data = ensure_folder(folder), read_report(report)
    rows = []
    for scene in data["scenes"]:
        bound = (scene["truth"] or {}).get("relative_bound")
        for one in scene["methods"]:
            error, times = one["error"] or {}, one["times"] or {}
            errors = [error.get(name) for name in ("relative_rmse", "relative_bias", "p99", "nonfinite")]
            what = (scene["name"], *scene["size"], one["label"], one.get("layer", "airlight"))
            frame, light, objects = (times.get(name) or {} for name in ("frame", "light_moved", "objects_moved"))
            shown = (*_spread(frame), frame.get("repetitions"), *_spread(light), *_spread(objects))
            rows.append((*what, *shown, *errors, bound, one["refused"]))
    settings = {name: data["settings"].get(name) for name in ("image", "timed")}
    write_data(target, NAME, _HEADER, rows, **report_origin(report, data), settings=settings)


def plot(folder: Path | str, *, output: Path | str | None = None, **options: Any) -> None:
    """Write `methods-table.tex` from the data in a folder; a table has no use for the options of drawings."""
    write_table(NAME, folder, _tabular, output)


def _tabular(rows: list[dict[str, str]]) -> str:
    headers = (
        ("method", "frame", "light moved", "objects moved", "rel. RMSE", "rel. bias", "99\\,\\%"),
        ("", "[ms]", "[ms]", "[ms]", "[1]", "[1]", "[1]"),
    )
    body: list[tuple[str, ...] | str] = []
    for scene in dict.fromkeys(row["scene"] for row in rows):
        chosen = [row for row in rows if row["scene"] == scene]
        size, bound = pixels(chosen[0]), value(chosen[0], "truth_bound")
        truth = f", truth known to {number(bound, 2)}" if bound else ""
        body.append(rf"\textit{{{escape(scene)}}}, {escape(size)}{truth}")
        body += [_cells(row) for row in chosen]
    comment = (
        "Needs \\usepackage{booktabs}. Times: medians with the distances to the quartiles, kernels compiled before.",
        "Errors of the airlight against the quadrature truth; 99 %: quantile of |error| / max(truth, mean / 1000).",
    )
    return table("lrrrrrr", headers, body, comment=comment)


def _spread(timing: dict[str, Any]) -> tuple[float | None, ...]:
    return tuple(timing.get(name) for name in ("median_ms", "low_ms", "high_ms"))


def _cells(row: dict[str, str]) -> tuple[str, ...]:
    times = [
        with_quartiles(*(value(row, f"{name}{end}") for end in ("", "_low", "_high")))
        for name in ("frame_ms", "light_moved_ms", "objects_moved_ms")
    ]
    if row["refused"]:
        return (escape(row["label"]), r"\multicolumn{6}{l}{refused}")
    name = escape(row["label"]) + ("" if row["layer"] == "airlight" else f" ({escape(row['layer'])})")
    bad = value(row, "nonfinite")
    name += f", {bad:.0f} pixels not finite" if bad else ""
    return (name, *times, *(number(value(row, key), 2) for key in ("relative_rmse", "relative_bias", "p99")))
