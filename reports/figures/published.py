# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the published results: frames a second of each table and figure of the papers, beside our own.

Biri, Arques, Michelin 2006, Table 2, and Billeter, Sintorn, Assarsson 2010, Figures 6 and 7 and Table 1. Everything is
rebuilt after the light moved, as published. The machines are not the same: what can be compared are ratios within a
paper, and what the error of each is.
"""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, pixels, read_data, value, write_data
from reports.figures.published_rows import HEADER, billeter_entries, biri_entries, measured_papers
from reports.figures.report import reported_papers
from reports.machine.progress import Progress
from reports.plotting.style import WIDTHS, method_style
from reports.tables.drawing import latex
from reports.tables.table import Column, Measured, Table, Value, table

NAME = "published"
SUMMARY = "frames a second of each table of the papers, published and measured"


def compute(
    folder: Path | str,
    *,
    report: Path | str | None = None,
    quick: bool = False,
    progress: Progress | None = None,
) -> None:
    """Write `published.csv` into a folder: a row for each published figure and everything that was measured for it.

    Parameters
    ----------
    report
        The folder of a report: the papers that it holds are taken from it; if it holds none, all are measured, which
        takes minutes.
    quick
        Measure at a quarter of the published size, Billeter's Table 1 for its smallest map.
    """
    target = ensure_folder(folder)
    papers, origin = reported_papers(report)
    if not any(papers.values()):
        papers, origin = measured_papers(quick, progress), {}
    rows = biri_entries(papers.get("biri") or {}) + billeter_entries(papers.get("billeter") or {})
    write_data(target, NAME, HEADER, rows, **origin)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    names = dict.fromkeys(row["table"] for row in rows)
    tables = {name: [row for row in rows if row["table"] == name] for name in names}
    lines = [len({row["row"] for row in chosen}) for chosen in tables.values()]
    width, double = WIDTHS[column], column == "double"
    figure = new_figure(width, 0.24 * sum(lines) + (0.4 if double else 0.8) * len(tables) + 0.3)
    panels = figure.subplots(len(tables), 1, sharex=True, squeeze=False, height_ratios=lines)[:, 0]
    for panel, (name, chosen) in zip(panels, tables.items()):
        _panel(panel, chosen)
        title = name + _scale(chosen[0])
        if double:
            panel.set_title(title)
            panel.legend(loc="center left", bbox_to_anchor=(1.01, 0.5))
        else:
            panel.legend(loc="lower right", bbox_to_anchor=(1.02, 0.98), ncols=2, title=title, title_fontsize=7)
    figure.supxlabel("frames a second after the light moved [1/s]", fontsize="medium")
    return figure


def _scale(row: dict[str, str]) -> str:
    """Return the size of the images in words, if it is not the published one."""
    scale = int(row["width"]) / int(row["published_width"])
    return "" if scale == 1 else f", here at {100 * scale:.3g} % of its size"


def _panel(panel, rows: list[dict[str, str]]) -> None:
    """Draw a table: a line for each row, on it the published figure and what was measured, a little apart."""
    names = list(dict.fromkeys(row["row"] for row in rows))
    printed = {(value(row, "published_fps"), names.index(row["row"])) for row in rows if row["published_fps"]}
    if printed:
        style = {"color": "black", "linestyle": "none", "marker": "|", "markersize": 9, "markeredgewidth": 1.4}
        panel.plot(*zip(*sorted(printed)), label="published", zorder=1, **style)
    styles: dict[tuple[str, str], dict[str, Any]] = {}
    for row in rows:
        key = (row["method"], row["variant"])
        if key not in styles:
            variant = sum(method == row["method"] for method, _ in styles)
            styles[key] = method_style(row["method"], variant) | {"linestyle": "none"}
            panel.plot([], [], label=row["variant"], **styles[key])
    for place, name in enumerate(names):
        on_line = [row for row in rows if row["row"] == name]
        for number_, row in enumerate(on_line):
            shift = 0.6 * ((number_ + 0.5) / len(on_line) - 0.5)
            _measured(panel, row, place + shift, styles[row["method"], row["variant"]])
    panel.set_yticks(range(len(names)), names)
    panel.set(xscale="log", ylim=(len(names) - 0.5, -0.5))
    panel.grid(False, axis="y")


def _measured(panel, row: dict[str, str], height: float, style: dict[str, Any]) -> None:
    middle, low, high = (value(row, name) for name in ("fps", "fps_low", "fps_high"))
    if middle is not None and low is not None and high is not None:  # a row without a measurement has its name alone
        panel.errorbar([middle], [height], xerr=[[middle - low], [high - middle]], **style)


def tabular(rows: list[dict[str, str]]) -> str:
    """Return the LaTeX table, see `reports.figures.files.plot`."""
    comment = (
        "Frames a second after the light moved, everything rebuilt, medians with the distances to the quartiles; the",
        "error of the airlight is against the quadrature truth.",
    )
    papers = dict.fromkeys(row["table"] for row in rows)
    return latex([_table(paper, [row for row in rows if row["table"] == paper]) for paper in papers], comment=comment)


def _table(title: str, rows: list[dict[str, str]]) -> Table:
    columns = (
        Column("row", "", words=True),
        Column("variant", "", words=True),
        Column("published", "published", "1/s"),
        Column("measured", "measured", "1/s"),
        Column("ratio", "ratio", digits=2),
        Column("relative_rmse", "rel. RMSE", digits=2, share=True),
    )
    return table(title, columns, [_cells(row) for row in rows])


def _cells(row: dict[str, str]) -> tuple[Value, ...]:
    fps, low, high, published = (value(row, name) for name in ("fps", "fps_low", "fps_high", "published_fps"))
    as_published = (row["width"], row["height"]) == (row["published_width"], row["published_height"])
    variant = "" if row["row"].endswith(row["variant"]) else row["variant"]
    size = "" if as_published else f"{', ' if variant else ''}{pixels(row)}"
    shown = None if fps is None or low is None or high is None else Measured(fps, low, high)
    ratio = fps / published if fps and published and as_published else None
    # Published numbers keep the digits that were printed.
    printed = None if published is None else int(published) if published == int(published) else published
    return (row["row"], variant + size, printed, shown, ratio, value(row, "relative_rmse"))
