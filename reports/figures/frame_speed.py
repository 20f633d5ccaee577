# SPDX-License-Identifier: BSD-3-Clause
"""The figure of whole frames: time against the error of the airlight, a panel for each scene of a report."""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.data.reader import read_report
from reports.figures.files import new_figure, read_csv, read_data, value, write_csv, write_data
from reports.figures.report import measured, report_origin
from reports.plotting.style import WIDTHS, report_styles

NAME = "frame-speed"
SUMMARY = "time of a frame against the error of the airlight, from a report"

_HEADER = (
    "scene",
    "width",
    "height",
    "label",
    "method",
    "frame_ms",
    "frame_ms_low",
    "frame_ms_high",
    "relative_rmse",
    "relative_bias",
    "p99",
    "nonfinite",
)


def compute(folder: Path | str, *, report: Path | str) -> None:
    """Write `frame-speed.csv` into a folder: times [ms] and errors of every method in every scene of a report.

    `frame-speed-labels.csv` names all methods of the report in its order.
    """
    target, data = ensure_folder(folder), read_report(report)
    rows = []
    for scene in data["scenes"]:
        for entry in measured(scene):
            if not entry["times"]:
                continue
            frame, error = entry["times"]["frame"], entry["error"]
            times = (frame["median_ms"], frame["low_ms"], frame["high_ms"])
            errors = (error["relative_rmse"], error["relative_bias"], error["p99"], error["nonfinite"])
            rows.append((scene["name"], *scene["size"], entry["label"], entry["method"], *times, *errors))
    # All labels, also those without a point: variants are numbered as in the report, so that its page agrees.
    labels = dict.fromkeys((entry["method"], entry["label"]) for scene in data["scenes"] for entry in scene["methods"])
    write_csv(target / f"{NAME}-labels.csv", ("method", "label"), labels)
    write_data(target, NAME, _HEADER, rows, **report_origin(report, data), timed=data["settings"].get("timed"))


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    scenes = list(dict.fromkeys(row["scene"] for row in rows))
    by_scene = {scene: [row for row in rows if row["scene"] == scene] for scene in scenes}
    known = report_styles([{"methods": read_csv(folder / f"{NAME}-labels.csv", NAME)}])
    styles = {label: style for label, style in known.items() if label in {row["label"] for row in rows}}
    width = WIDTHS[column]
    across = min(len(scenes), 3 if column == "double" else 1)
    down = -(-len(scenes) // across)
    legend = -(-len(styles) // (3 if column == "double" else 1))
    figure = new_figure(width, down * min(0.75 * width / across, 2.4) + 0.14 * legend + 0.1)
    panels = figure.subplots(down, across, squeeze=False)
    for panel, scene in zip(panels.flat, scenes):
        for row in by_scene[scene]:
            _point(panel, row, styles[row["label"]])
        panel.set(xscale="log", yscale="log", xlabel="time of a frame [ms]")
        panel.set_title(scene, parse_math=False)  # a dollar in a file name must not begin a formula
        _plain_times(panel)
    for panel in panels.flat[len(scenes) :]:
        panel.set_axis_off()
    figure.supylabel("relative RMSE of the airlight [1]", fontsize="medium")
    handles = [panels.flat[0].plot([], [], linestyle="none", **style)[0] for style in styles.values()]
    figure.legend(handles, list(styles), loc="outside lower center", ncols=3 if column == "double" else 1)
    return figure


def _point(panel, row: dict[str, str], style: dict[str, Any]) -> None:
    """Draw a method with the quartiles of its time; an error of 0 has no place on a logarithmic axis."""
    middle, low, high = (value(row, name) for name in ("frame_ms", "frame_ms_low", "frame_ms_high"))
    error = value(row, "relative_rmse")
    if middle is None or low is None or high is None or not error:
        return
    panel.errorbar([middle], [error], xerr=[[middle - low], [high - middle]], linestyle="none", **style)


def _plain_times(panel) -> None:
    """Name 1, 2 and 5 of each decade, in plain numbers: times often span less than one."""
    from math import log10

    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    low, high = panel.get_xlim()
    subs = (1, 2, 5) if log10(high / low) < 1.7 else (1,)
    panel.xaxis.set_major_locator(LogLocator(subs=subs))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
