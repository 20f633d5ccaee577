# SPDX-License-Identifier: BSD-3-Clause
"""Rows of the figure of the published results, from what `airlight published` measures or a report holds."""

from collections.abc import Sequence
from typing import Any

from reports.machine.progress import Progress, part_of
from reports.papers.billeter import SIZE, billeter_data
from reports.papers.biri import biri_data, biri_variant

HEADER = (
    "paper",
    "table",
    "row",
    "variant",
    "method",
    "width",
    "height",
    "published_width",
    "published_height",
    "published_fps",
    "fps",
    "fps_low",
    "fps_high",
    "relative_rmse",
    "missing",
)
_LIMIT = 10.0  # a frame that takes longer is left out [s]


def measured_papers(quick: bool, progress: Progress | None) -> dict[str, Any]:
    """Measure the tables of both papers, as `published` in report.json.

    Parameters
    ----------
    quick
        A quarter of the published width and height, and one size of the map in Billeter's Table 1.
    progress
        Called with the share done and what comes next.
    """
    from validation.papers.billeter_images import figure_rows
    from validation.papers.billeter_tessellation import MAPS, table_rows
    from validation.papers.biri import biri_rows

    scale = 0.25 if quick else 1.0
    size = (round(scale * SIZE[0]), round(scale * SIZE[1]))
    seconds = 0.1 if quick else 0.6

    biri = biri_data(biri_rows(scale=scale, seconds=seconds, progress=part_of(progress, 0.0, 0.3)), [])
    figures = figure_rows(size=size, seconds=seconds, limit=_LIMIT, progress=part_of(progress, 0.3, 0.6))
    maps = MAPS[:1] if quick else MAPS
    step = part_of(progress, 0.6, 1.0)
    views = table_rows(maps=maps, size=size, seconds=seconds, limit=_LIMIT, progress=step)
    return {"biri": biri, "billeter": billeter_data(figures, views)}


def biri_entries(data: dict[str, Any]) -> list[tuple]:
    """Return the rows of Table 2 of Biri 2006 and of the scene that its section 6 adds."""
    entries = []
    for row in data.get("rows", ()):
        published = row["published"]
        size = f", {_size(published['size'])}" if published["size"] != [800, 600] else ""
        name = f"{published['scene']}, {published['where']}{size}"
        variant = biri_variant(row)
        what = ("biri", "Biri 2006, Table 2", name, variant, "shadow-planes")
        entries.append((*what, *_figures(row, published["size"], published["fps"], row["error"])))
    return entries


def billeter_entries(data: dict[str, Any]) -> list[tuple]:
    """Return the rows of Figures 6 and 7 and Table 1 of Billeter 2010."""
    entries = []
    for row in data.get("figures", ()):
        entry = row["entry"]
        figure = entry["where"] if entry["where"].startswith("Fig") else "Fig. 7"  # peers share the scene of Fig. 7
        table = f"Billeter 2010, {figure.rstrip('abc')}"
        values = dict(entry["parameters"])
        variant = values.get("evaluation") or (f"{values['steps']} steps" if "steps" in values else "default")
        line, method = f"{entry['where']}, map {entry['map']}", entry["method"]
        what = ("billeter", table, line, f"{method}, {variant}", method)
        entries.append((*what, *_figures(row, SIZE, entry["fps"], row["error"])))
    for row in data.get("table", ()):
        name = f"{row['scene']}, map {row['map']}"
        for_table = "Billeter 2010, Table 1"
        # The published figure differs by evaluation here, so each evaluation has a line of its own.
        line = f"{name}, {row['evaluation']}"
        what = ("billeter", for_table, line, row["evaluation"], "light-volumes")
        entries.append((*what, *_figures(row, SIZE, row["published"]["fps"], None)))
    return entries


def _figures(row: dict[str, Any], size: Sequence[int], fps: float | None, error: dict[str, Any] | None) -> tuple:
    """Return size, published and measured frames a second, error, and why nothing was measured."""
    light_moved = row["light_moved"]
    # The third quartile of the time is the first of the rate.
    rates = [1000 / light_moved[name] for name in ("median_ms", "high_ms", "low_ms")] if light_moved else [None] * 3
    relative = error["relative_rmse"] if error else None
    return (*row["size"], *size, fps, *rates, relative, row.get("missing"))


def _size(size: list[int]) -> str:
    return f"{size[0]} \N{MULTIPLICATION SIGN} {size[1]}"
