# SPDX-License-Identifier: BSD-3-Clause
"""Figures 6 and 7 and Table 1 of Billeter 2010 beside our own figures, for a terminal, a README and as JSON."""

from collections.abc import Sequence
from typing import Any

from reports.tables.bench import RATES, print_heading, print_markdown, rate_cells
from reports.tables.terminal import number, print_table


def billeter_data(figures: Sequence, table: Sequence) -> dict[str, Any]:
    """Return the rows and what follows from them as JSON-ready data."""
    from reports.data.serialize import plain
    from validation.papers.billeter_conclusions import conclusions

    return {
        "figures": plain(figures),
        "table": [
            plain(row)
            | {
                "published": {
                    "what": row.published.what,
                    "fps": row.published_fps,
                    "passes": plain(row.published.passes.get((row.map, row.evaluation), {})),
                },
                "scene": row.published.scene,
            }
            for row in table
        ],
        "conclusions": conclusions(figures, table),
    }


def print_billeter(figures: Sequence, table: Sequence, *, markdown: bool = False) -> None:
    """Print the tables and what follows from them.

    Parameters
    ----------
    figures
        From `validation.papers.billeter_images.figure_rows`.
    table
        From `validation.papers.billeter_tessellation.table_rows`.
    markdown
        Print Markdown, with the date and the machine.
    """
    from validation.papers.billeter_conclusions import conclusions

    show = print_markdown if markdown else print_table
    if markdown:
        print_heading()
    if figures:
        _print_figures(figures, show)
    if table:
        _print_rates(table, show)
        _print_passes(table, show)
    missing = [(f"{row.entry.where}, {_image(row)}", row.missing) for row in figures if row.missing]
    missing += [(_view(row), row.missing) for row in table if row.missing]
    if missing:
        print("\nNot measured:\n")
        for name, reason in missing:
            print(f"- {name}: {reason}.")
    found = conclusions(figures, table)
    if found:
        print("\nWhat follows:\n")
        for sentence in found:
            print(f"- {sentence}")


def _print_figures(rows: Sequence, show) -> None:
    headers = (
        "frames a second",
        "published",
        *RATES,
        "rel. RMSE",
        "p99",
        "against the map",
        "p99",
    )
    cells = []
    for row in rows:
        name, fps = f"{row.entry.where}, {_image(row)}", row.entry.fps
        if row.light_moved is None:
            cells.append((name, number(fps), *["-"] * 9))
            continue
        errors = [number(value, 2) for one in (row.error, row.map_error) for value in (one.relative_rmse, one.p99)]
        cells.append((name, number(fps), *_rates(row, fps), *errors))
    show(headers, cells, "Figures 6 and 7 of Billeter 2010 again: frames a second, and the error of the airlight")


def _print_rates(rows: Sequence, show) -> None:
    headers = (
        "frames a second",
        "triangles",
        "published",
        *RATES,
        "rel. RMSE to the static mesh",
    )
    cells = []
    for row in rows:
        if row.light_moved is None:
            cells.append((_view(row), "-", number(row.published_fps), *["-"] * 6))
            continue
        against = "-" if row.against_static is None else number(row.against_static.relative_rmse, 2)
        triangles = str(row.triangles) if row.triangles else "-"
        rates = _rates(row, row.published_fps)
        cells.append((_view(row), triangles, number(row.published_fps), *rates, against))
    what = dict.fromkeys(f"{row.published.scene} for {row.published.what}" for row in rows)
    show(headers, cells, f"Table 1 of Billeter 2010 again, {'; '.join(what)}: frames a second")


def _print_passes(rows: Sequence, show) -> None:
    from validation.papers.billeter_tessellation import PASSES

    cells = []
    for row in rows:
        published = row.published.passes.get((row.map, row.evaluation))
        if published:
            name = f"{row.published.scene}, map {row.map}, {row.evaluation}: published"
            cells.append((name, *(number(published.get(one)) for one in PASSES)))
        if row.passes:
            cells.append((_view(row), *(number(row.passes.get(one)) for one in PASSES)))
    show(("ms of each pass", *PASSES), cells, "Table 1 of Billeter 2010 again: the passes")


def _rates(row, fps: float | None) -> tuple[str, ...]:
    from validation.papers.billeter_images import SIZE

    return rate_cells(row, fps if row.size == SIZE else None)


def _image(row) -> str:
    entry = row.entry
    values = ", ".join(f"{name}={value}" for name, value in (("map", entry.map), *entry.parameters))
    return f"{entry.scene}, {row.size[0]} x {row.size[1]}: {entry.method} ({values})"


def _view(row) -> str:
    return f"{row.published.scene}, {row.size[0]} x {row.size[1]}, map {row.map}: {row.evaluation}"
