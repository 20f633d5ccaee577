# SPDX-License-Identifier: BSD-3-Clause
"""What a method costs as its work grows, and the exponents of its times."""

from collections.abc import Iterable
from typing import Any

from reports.tables.table import Column, Row, Table, Value, measured, numbers, table, words
from validation.timing import Scaling

WORK = {
    "size": "pixels",
    "triangles": "triangles",
    "lights": "lights",
    "map": "texels on a side of the map",
}
TIMES = {"frame": "frame", "light_moved": "light moved", "objects_moved": "objects moved"}

_MS = {"unit": "ms"}
_EXPONENTS = (
    (key, heading) for own, name in TIMES.items() for key, heading in ((own, name), (f"{own}_steepest", "steepest"))
)
_GROWTH = (
    *words(kind="work", label="method"),
    *(Column(key, heading) for key, heading in _EXPONENTS),
    *words(cliff="cliff"),
)


def scaling_tables(records: Iterable[Scaling]) -> list[Table]:
    """Return a table of costs for each kind of work in a scene, and one of all exponents."""
    records = list(records)
    kinds = dict.fromkeys((record.scene, record.kind) for record in records)
    tables = [
        _costs(scene, kind, [record for record in records if (record.scene, record.kind) == (scene, kind)])
        for scene, kind in kinds
    ]
    scenes = dict.fromkeys(record.scene for record in records)
    return tables + [_exponents(scene, [record for record in records if record.scene == scene]) for scene in scenes]


def cliffs(records: Iterable[Scaling]) -> list[str]:
    """Return a sentence for every time that jumps."""
    return [
        f"{record.scene}, {record.label}: {TIMES[name]} grows with the power {own.steepest:.2g} of the "
        f"{WORK[record.kind]} up to {own.at:g}"
        for record in records
        for name, own in record.growth.items()
        if own.cliff
    ]


def same_records(old: Iterable[Scaling], new: Iterable[Scaling]) -> list[tuple[Scaling, Scaling]]:
    """Return the pairs of records of one method, scene, size and kind of work."""

    def place(record: Scaling) -> tuple:
        return record.scene, *record.size, record.kind, record.label

    known = {place(record): record for record in old}
    return [(known[place(record)], record) for record in new if place(record) in known]


def _costs(scene: str, kind: str, records: list[Scaling]) -> Table:
    columns = (
        *words(label="method"),
        *numbers(work=WORK[kind], how={"whole": True}),
        *numbers(**TIMES, rays="rays alone", how=_MS),
        *numbers(memory="memory [MiB]"),
    )
    rows = []
    for record in records:
        for cost in record.costs:
            values: dict[str, Value] = {"label": record.label, "work": cost.work, "memory": cost.memory}
            rows.append(Row(values | {name: measured(getattr(cost, name)) for name in (*TIMES, "rays")}))
        if record.refused:
            rows.append(Row({"label": record.label}, f"refused: {record.refused}"))
    size = "" if kind == "size" else ", {} x {}".format(*records[0].size)
    explanation = (
        "Medians; rays alone: the camera rays without shading, the floor of a frame that casts them. Memory: what one "
        "frame takes at its peak, prepared again, with its image on the host."
    )
    return table(f"{scene} by {WORK[kind]}{size}", columns, rows, explanation=explanation)


def _exponents(scene: str, records: list[Scaling]) -> Table:
    rows = []
    for record in records:
        if len(record.costs) < 2:
            continue
        values: dict[str, Any] = {"kind": WORK[record.kind], "label": record.label}
        for name, own in record.growth.items():
            values |= {name: own.exponent, f"{name}_steepest": own.steepest}
        jumps = [TIMES[name] for name, own in record.growth.items() if own.cliff]
        rows.append(Row(values | {"cliff": ", ".join(jumps) or "no"}))
    explanation = (
        "Exponents e of time ~ work^e, fitted to all steps; steepest: between two steps that follow one another. "
        "A cliff: steeper than the work asks for by 0.6, in a time above 5 ms."
    )
    return table(f"{scene}: how times grow", _GROWTH, rows, explanation=explanation)
