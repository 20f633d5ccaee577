# SPDX-License-Identifier: BSD-3-Clause
"""The figures and the table of Billeter 2010 as far as rows need them: fewer forms and timings than the tables.

What `validation.papers` measures for `airlight published` and for full reports serves the rows as well, and takes much
longer. Here are the mesh as published, the marcher, the walk of Fig. 7 and epipolar slices, and of Table 1 the static
and the adaptive mesh with the passes that the paper prints.
"""

from dataclasses import replace
from typing import Any

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeError
from realtime.scene.read_scene import Scene, read_scene
from validation.configurations.methods import configuration, prepared
from validation.configurations.timing import moved_light, time_repeated
from validation.metrics.errors import plain
from validation.papers.billeter_images import FIGURES, LIMIT, SIZE, FigureEntry, figure_rows, frame_within
from validation.papers.billeter_tessellation import (
    EVALUATIONS,
    MAPS,
    TABLE,
    TableRow,
    expected_missing,
    table_scene,
    view_passes,
)

_SECONDS = 0.1  # for each timing [s]
_PUBLISHED = ("static", "adaptive")


def billeter_tables(size: tuple[int, int] = SIZE) -> dict[str, Any]:
    """Return `figures` and `table` as they stand in `published.billeter` of report.json, with the rows that are needed.

    Parameters
    ----------
    size
        Of the frames [pixels]; that of the paper by default.
    """
    figures = figure_rows([entry for entry in FIGURES if needed(entry)], size=size, seconds=_SECONDS)
    return {"figures": plain(figures), "table": [row for view in TABLE for row in _view(view, size)]}


def needed(entry: FigureEntry) -> bool:
    """Return whether a row of the catalogue asks for an image."""
    values = dict(entry.parameters)
    if entry.method == "light-volumes" and "tolerance" not in values:
        walked = values.get("walls") == "slanted" and entry.where == "Fig. 7c"
        return values.get("evaluation") == "mesh" or walked
    return values.get("sum") == "transitions" or entry.method == "min-max"


def _view(view: Any, size: tuple[int, int]) -> list[dict[str, Any]]:
    scene = read_scene(table_scene(view.scene, size))
    last: dict[str, TableRow] = {}
    rows = []
    for texels in MAPS:
        for evaluation in _PUBLISHED:
            empty = TableRow(view, texels, evaluation, size)
            row = expected_missing(empty, last.get(evaluation), LIMIT) or _timed(empty, scene)
            last[evaluation] = row
            rows.append({name: value for name, value in plain(row).items() if name != "published"})
            rows[-1] |= {"scene": view.scene}
    return rows


def _timed(empty: TableRow, scene: Scene) -> TableRow:
    values = dict(EVALUATIONS[empty.evaluation]) | {"map": empty.map}
    try:
        renderer = prepared(scene, configuration("light-volumes", "exact", values))
        frame_within(renderer, LIMIT)
        timing = time_repeated(moved_light(renderer), seconds=_SECONDS, least=3)
        printed = (empty.map, empty.evaluation) in empty.published.passes
        passes = view_passes(renderer, empty, _SECONDS)[0] if printed else {}
    except (InputError, RealtimeError, MemoryError, TimeoutError) as reason:
        return replace(empty, missing=str(reason) or "out of memory")
    return replace(empty, light_moved=timing, passes=passes)
