# SPDX-License-Identifier: BSD-3-Clause
"""The numbers that papers print beside our own: rates, times of passes, fractions of stages, a panel for each unit.

The machines are not the same: what can be compared are ratios within a paper.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, write_data
from reports.figures.report import reported_papers
from reports.machine.progress import Progress
from reports.plotting.style import COLOURS, WIDTHS
from reports.tables.drawing import latex
from reports.tables.table import Measured, Table, numbers, table, words

NAME = "published"
SUMMARY = "rates, passes and fractions of stages of the papers, published and measured"

_NUMBERS = ("published", "measured", "low", "high")
_HEADER = ("paper", "item", "unit", *_NUMBERS, "why")
_UNITS = ("frames/s", "ms", "%")
_EXPERIMENTS = ("biri tables", "billeter tables", "cloud frames")
_QUICK = _EXPERIMENTS[-1:]


def compute(
    folder: Path | str,
    *,
    report: Path | str | None = None,
    quick: bool = False,
    progress: Progress | None = None,
) -> None:
    """Write `published.csv` into a folder: a row for each number that a paper prints of its times.

    Parameters
    ----------
    report
        The folder of a report: if it holds such rows they are taken from it, else they are measured in some minutes.
    quick
        Measure the rates of clouds alone.
    """
    target = ensure_folder(folder)
    rows, origin = reported_papers(report)
    shown = _shown(rows)
    if not shown:
        shown, origin = _shown(_measured(_QUICK if quick else _EXPERIMENTS, progress)), {}
    write_data(target, NAME, _HEADER, [tuple(row[key] for key in _HEADER) for row in shown], **origin)


def _shown(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    return [row for row in rows if row["published"] is not None and row["measured"] and row["unit"] in _UNITS]


def _measured(names: Sequence[str], progress: Progress | None) -> list[dict[str, Any]]:
    from reports.report.others import decided
    from validation.papers.claims import claims
    from validation.papers.experiments import EXPERIMENTS

    figures = {}
    for number, name in enumerate(names):
        if progress is not None:
            progress(number / len(names), name)
        figures[name] = EXPERIMENTS[name].run()
    return decided(claims(), figures)


def _panels(rows: Sequence[dict[str, str]]) -> dict[str, list[dict[str, str]]]:
    """Return the rows by paper and unit, in words."""
    panels: dict[str, list[dict[str, str]]] = {}
    for row in rows:
        panels.setdefault(f"{row['paper']} [{row['unit']}]", []).append(row)
    return panels


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    panels = _panels(read_data(folder, NAME))
    lines = [len(rows) for rows in panels.values()]
    figure = new_figure(WIDTHS[column], 0.17 * sum(lines) + 0.5 * len(panels) + 0.3)
    for panel, (title, rows) in zip(
        figure.subplots(len(panels), 1, squeeze=False, height_ratios=lines)[:, 0], panels.items()
    ):
        places = range(len(rows))
        printed, middle, low, high = ([float(row[name]) for row in rows] for name in _NUMBERS)
        panel.plot(printed, places, "|", color="black", markersize=8, markeredgewidth=1.4, label="published")
        spread = [[m - a for m, a in zip(middle, low)], [b - m for m, b in zip(middle, high)]]
        panel.errorbar(middle, places, xerr=spread, fmt="o", markersize=3, color=COLOURS["blue"], label="measured")
        panel.set_yticks(places, [row["item"] for row in rows])
        panel.set(xscale="log", ylim=(len(rows) - 0.5, -0.5), title=title)
        panel.grid(False, axis="y")
    figure.axes[0].legend(loc="best")
    return figure


def tabular(rows: list[dict[str, str]]) -> str:
    """Return the LaTeX table, see `reports.figures.files.plot`."""
    comment = ("Medians with the distances to the quartiles.",)
    return latex([_table(title, several) for title, several in _panels(rows).items()], comment=comment)


def _table(title: str, rows: list[dict[str, str]]) -> Table:
    columns = (*words(item=""), *numbers("published", "measured"), *numbers("ratio", how={"digits": 2}))
    cells = []
    for row in rows:
        printed, middle, low, high = (float(row[name]) for name in _NUMBERS)
        shown = int(printed) if printed == int(printed) else printed  # the digits that were printed
        cells.append((row["item"], shown, Measured(middle, low, high), middle / printed))
    return table(title, columns, cells)
