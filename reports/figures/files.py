# SPDX-License-Identifier: BSD-3-Clause
"""The files of a figure: its data as CSV, where they come from as JSON, the drawing as PDF and PNG.

A figure is a module `reports/figures/*.py` with `NAME`, `SUMMARY` and these functions:

    compute(folder, *, report, quick, progress, ...)
        writes `NAME.csv` and `NAME.json` into a folder. It takes those of the arguments that it needs: `report`, the
        folder of a report from which the data come; `quick`, to measure less where it measures; `progress`, called
        with the share done and what comes next; and its own.
    draw(folder, column)
        returns the figure from nothing but these data, for a column of `reports.plotting.style.WIDTHS`.
    tabular(rows)
        returns a LaTeX table from the rows of the data.

`draw` and `tabular` may each be missing; `plot` writes what they return. What varies from run to run, the date above
all, is in the JSON alone: the same data give the same bytes.
"""

import csv
import io
import json
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from analytic.errors import InputError
from reference.storage.files import write_bytes, write_text
from reports.plotting.style import figure_style
from reports.tables.drawing import csv as draw_csv
from reports.tables.table import Column, table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

Row = Mapping[str, str]

#: Metadata without anything that differs from one run to the next.
_METADATA: Mapping[str, dict[str, Any]] = {".pdf": {"CreationDate": None}, ".png": {"Software": None}}


def plot(
    figure: ModuleType,
    folder: Path | str,
    *,
    column: str = "double",
    extra: Sequence[str] = (),
    output: Path | str | None = None,
) -> None:
    """Draw a figure from its data as PDF and PNG, and write its table as LaTeX.

    Parameters
    ----------
    figure
        Its module, see above.
    folder
        Where the data are.
    column, extra
        See `reports.plotting.style.figure_style`; a table does not depend on them.
    output
        Where the drawings go; the folder of the data by default.
    """
    source, target = Path(folder), Path(output or folder)
    if hasattr(figure, "draw"):
        with figure_style(column, extra):
            drawn = figure.draw(source, column)
            for suffix, metadata in _METADATA.items():
                buffer = io.BytesIO()
                drawn.savefig(buffer, format=suffix[1:], metadata=metadata)
                write_bytes(target / f"{figure.NAME}{suffix}", buffer.getvalue())
    if hasattr(figure, "tabular"):
        write_text(target / f"{figure.NAME}.tex", figure.tabular(read_data(source, figure.NAME)))


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of this size [inches], without overlaps, window or global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def name_sizes(panel: "Axes", sizes: Iterable[float]) -> None:
    """Name these sizes along the axis and nothing else: what lies between powers of ten would overlap."""
    from matplotlib.ticker import FixedLocator, NullLocator

    shown = sorted(set(sizes))
    panel.xaxis.set_major_locator(FixedLocator(shown))
    panel.xaxis.set_minor_locator(NullLocator())
    panel.set_xticklabels([f"{size:g}" for size in shown])


def write_data(folder: Path, name: str, header: Sequence[str], rows: Iterable[Sequence[Any]], **made_by: Any) -> None:
    """Write the data of a figure, `NAME.csv`, and what made them, when and on what, `NAME.json`."""
    write_csv(folder / f"{name}.csv", header, rows)
    _write_provenance(folder, name, **made_by)


def read_data(folder: Path | str, name: str) -> list[dict[str, str]]:
    """Return the rows of a figure's data by column; raises InputError if they are missing."""
    return read_csv(Path(folder) / f"{name}.csv", name)


def write_csv(path: Path, header: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table: nine digits of every number, nothing for None."""
    write_text(path, draw_csv(table("", (Column(name, name) for name in header), rows)))


def read_csv(path: Path, figure: str) -> list[dict[str, str]]:
    """Return the rows of a table by column.

    Raises
    ------
    InputError
        If it is missing or empty: it says how the data of this figure are made.
    """
    try:
        with open(path, newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    except (FileNotFoundError, NotADirectoryError):
        raise InputError(
            f"{path} is missing: the data of the figure {figure} are not there; write them with "
            f"`airlight figures {figure} -o {path.parent}`"
        ) from None
    if not rows:
        raise InputError(f"{path} has no rows; write it again with `airlight figures {figure} -o {path.parent}`")
    return rows


def values(rows: Iterable[Row], name: str) -> list[float]:
    """Return a column as numbers, NaN where there is none."""
    return [float(row[name] or "nan") for row in rows]


def value(row: Row, name: str) -> float | None:
    """Return a number of a row, None where there is none."""
    return float(row[name]) if row[name] else None


def pixels(row: Row) -> str:
    """Return the size of an image as a figure names it, from the columns `width` and `height`."""
    return f"{row['width']} \N{MULTIPLICATION SIGN} {row['height']}"


def _write_provenance(folder: Path, name: str, **made_by: Any) -> None:
    from reports.machine.environment import describe_environment

    content = {
        "figure": name,
        "created": time.strftime("%Y-%m-%d %H:%M:%S %z"),
        **made_by,
        "environment": made_by.get("environment") or describe_environment(),
    }
    text = json.dumps(content, indent=1, ensure_ascii=False, default=str)
    write_text(folder / f"{name}.json", text + "\n")
