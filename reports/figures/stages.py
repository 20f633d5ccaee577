# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the stages: Table 1 of Biri, Arques, Michelin 2006, the share of each in a frame, published and here.

The shares are of the sum of the stages of a frame after the light moved. How the stages are told apart:
`validation.papers.biri`.
"""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, pixels, read_data, value, values, write_data
from reports.figures.report import reported_papers
from reports.machine.progress import Progress
from reports.papers.biri import biri_variant
from reports.plotting.style import COLOURS, WIDTHS
from reports.tables.drawing import latex
from reports.tables.table import Column, Row, Table, Value, table

NAME = "stages"
SUMMARY = "share of each stage of shadow planes in a frame: Table 1 of Biri 2006, published and measured"

_PAPER = "published"
_HEADER = ("scene", "where", "row", "width", "height", "stage", "share_percent", "ms", "frame_ms", "low_ms", "high_ms")
_COLOURS = ("purple", "sky", "blue", "orange", "vermillion")
_HATCHES = ("", "....", "", "////", "")  # hatches tell the stages apart in grey prints


def compute(
    folder: Path | str,
    *,
    report: Path | str | None = None,
    quick: bool = False,
    progress: Progress | None = None,
) -> None:
    """Write `stages.csv` into a folder: the share of every stage in every row of the table.

    Parameters
    ----------
    report
        The folder of a report: if it holds Biri's tables they are taken from it, else they are measured.
    quick
        Measure at a quarter of the published size.
    """
    target = ensure_folder(folder)
    papers, origin = reported_papers(report)
    biri = papers.get("biri")
    if not biri or not any(row["published"]["shares"] for row in biri["rows"]):
        biri, origin = _measured(0.25 if quick else 1.0, progress), {}
    rows: list[tuple] = []
    shown = set()
    for row in biri["rows"]:
        published = row["published"]
        if published["shares"] is None:
            continue
        if published["scene"] not in shown:
            shown.add(published["scene"])
            named = (published["scene"], published["where"], _PAPER, *published["size"])
            rows += [(*named, stage, share, *[None] * 4) for stage, share in zip(biri["stages"], published["shares"])]
        frame = tuple(row["light_moved"][name] for name in ("median_ms", "low_ms", "high_ms"))
        named = (published["scene"], published["where"], biri_variant(row), *row["size"])
        parts = zip(biri["stages"], row["shares"], row["stages_ms"])
        rows += [(*named, stage, share, ms, *frame) for stage, share, ms in parts]
    write_data(target, NAME, _HEADER, rows, **origin)


def _measured(scale: float, progress: Progress | None) -> dict[str, Any]:
    from reports.papers.biri import biri_data
    from validation.papers.biri import PUBLISHED, biri_rows

    return biri_data(biri_rows([row for row in PUBLISHED if row.shares], scale=scale, progress=progress), [])


def _groups(rows: list[dict[str, str]]) -> dict[tuple[str, str], list[dict[str, str]]]:
    """Return the rows by scene and by what was measured, in their order."""
    groups: dict[tuple[str, str], list[dict[str, str]]] = {}
    for row in rows:
        groups.setdefault((row["scene"], row["row"]), []).append(row)
    return groups


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    groups = _groups(rows)
    stages = list(dict.fromkeys(row["stage"] for row in rows))
    # A stage that cannot be told apart has no bar.
    shares = np.nan_to_num([values(group, "share_percent") for group in groups.values()])
    width = WIDTHS[column]
    double = column == "double"
    figure = new_figure(width, 0.24 * len(groups) + (0.9 if double else 1.25))
    panel = figure.subplots()
    rows_at = np.arange(len(groups)) + 0.4 * np.cumsum([name == _PAPER for _, name in groups])  # a gap before a scene
    start = np.zeros(len(groups))
    for place, stage in enumerate(stages):
        bars = panel.barh(rows_at, shares[:, place], left=start, height=0.8, label=stage, edgecolor="white")
        for bar in bars:
            bar.set(facecolor=COLOURS[_COLOURS[place % 5]], hatch=_HATCHES[place % 5])
        start += shares[:, place]
    panel.set_yticks(rows_at, [_words(*name, group) for name, group in groups.items()])
    panel.invert_yaxis()
    panel.set(xlabel="share of all stages after the light moved [%]", xlim=(0, 100))
    panel.grid(False, axis="y")
    figure.legend(loc="outside lower center", ncols=len(stages) if double else 2)
    return figure


def _words(scene: str, row: str, group: list[dict[str, str]]) -> str:
    where = group[0]["where"]
    if row == _PAPER:
        return f"{scene}: published, {where}"
    return f"{row}, {pixels(group[0])}, {value(group[0], 'frame_ms'):.3g} ms"


def tabular(rows: list[dict[str, str]]) -> str:
    """Return the LaTeX table, see `reports.figures.files.plot`."""
    scenes: dict[str, list[list[dict[str, str]]]] = {}
    for (scene, _), group in _groups(rows).items():
        scenes.setdefault(scene, []).append(group)
    comment = ("Table 1 of Biri, Arques, Michelin 2006, published and measured.",)
    return latex([_table(scene, groups) for scene, groups in scenes.items()], comment=comment)


def _table(scene: str, groups: list[list[dict[str, str]]]) -> Table:
    stages = [row["stage"] for row in groups[0]]
    columns = [Column("name", "share of a frame", words=True), *(Column(stage, stage, "%") for stage in stages)]
    table_rows = []
    for group in groups:
        name, printed = group[0]["row"], group[0]["row"] == _PAPER
        cells: dict[str, Value] = {"name": name if printed else f"{name}, {pixels(group[0])}"}
        cells |= {row["stage"]: value(row, "share_percent") for row in group}
        table_rows.append(Row(cells | {"frame": value(group[0], "frame_ms")}, published=printed))
    return table(scene, [*columns, Column("frame", "frame", "ms")], table_rows, explanation=groups[0][0]["where"])
