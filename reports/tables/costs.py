# SPDX-License-Identifier: BSD-3-Clause
"""Costs as tables: of kernels, also the cheapest at each error and where they break; of
methods as their work grows.
"""

from collections.abc import Iterable, Iterator
from typing import Any

from airlight.reports.tables.table import (
    Column,
    Measured,
    Name,
    Row,
    Table,
    Value,
    measured,
    numbers,
    table,
    words,
)
from airlight.validation.kernels.records import ErrorLevel, KernelCost, Rays, RayTime, Stability
from airlight.validation.timing import Scaling

COSTS = (
    *words("kernel"),
    Column("device", "", "ns/ray", spread="quartiles"),
    Column("wall", "wall", "ns/ray", spread="quartiles", minor=True),
    *numbers("rays", how={"minor": True}),
    *numbers("median", p99="99 %", max="", how={"digits": 2}),
    *numbers(nonfinite="not finite", how={"alarm": True}),
)
_STATISTICS = {"max": "maximum error", "p99": "99 % of the rays"}


def kernel_tables(costs: Iterable[KernelCost], levels: Iterable[ErrorLevel]) -> Iterator[Table]:
    """Yield for each phase function the table of costs and the tables of the
    cheapest kernels at each error.
    """
    costs, levels = list(costs), list(levels)
    # Each phase function has tables of its own, as a kernel may refuse one or be slower there.
    for phase in dict.fromkeys(cost.phase for cost in costs):
        chosen = [cost for cost in costs if cost.phase == phase]
        g = f", g = {chosen[0].g:g}" if phase == "hg" else ""
        yield cost_table(f"{phase}{g}, float32, wide rays", chosen)
        for statistic, phrase in _STATISTICS.items():
            rows = [
                level for level in levels if (level.phase, level.statistic) == (phase, statistic)
            ]
            yield level_table(f"{phase}: speed against error, {phrase}", rows)


def cost_table(title: str, costs: Iterable[KernelCost], *, code: bool = False) -> Table:
    """Return the costs and errors of kernels, with `code` for names that a reader types."""
    return Table(title, COSTS, tuple(_cost_row(cost, code) for cost in costs))


def _cost_row(cost: KernelCost, code: bool) -> Row:
    values: dict[str, Value] = {"kernel": Name(cost.kernel) if code else cost.kernel}
    # A refusal has neither time nor error.
    if cost.refused:
        return Row(values, f"refused: {cost.refused}")
    values |= {
        "device": _spread(cost.device),
        "wall": _spread(cost.wall),
        "rays": cost.rays or None,
    }
    return Row(
        values | {name: getattr(cost, name) for name in ("median", "p99", "max", "nonfinite")}
    )


def _spread(time: RayTime | None) -> Measured | None:
    return Measured(time.median, time.low, time.high) if time else None


def level_table(title: str, levels: Iterable[ErrorLevel]) -> Table:
    """Return which kernel is cheapest at each error."""
    columns = (Column("level", "error", digits=6), *words("cheapest"), Column("ns", "", "ns/ray"))
    return table(
        title, columns, [(each.level, each.cheapest or "none", each.ns) for each in levels]
    )


def stability_summary(found: Iterable[Stability]) -> Table:
    """Return a row for each kernel and each set of rays, all of these together."""
    columns = (
        *words("kernel", set="rays"),
        *numbers(rays="measured", refused=""),
        *numbers(median="float32 median", p99="99 %", max="largest", how={"digits": 2}),
        *numbers(odd="not finite or negative", how={"alarm": True}),
        *numbers(double="float64 largest", how={"digits": 2}),
    )

    def row(kernel: str, rays: Rays) -> dict[str, Value]:
        # float32 in full, as methods use it; of float64 the largest error alone.
        single = rays.single["all"]
        return {
            **vars(single),
            "odd": single.odd,
            "kernel": kernel,
            "set": rays.name,
            "double": rays.double["all"].max,
        }

    rows = (row(kernel.kernel, rays) for kernel in found for rays in kernel.sets)
    return table(
        "Robustness of the kernels", columns, rows, explanation="All rays of each set together."
    )


WORK = {
    "size": "pixels",
    "triangles": "triangles",
    "lights": "lights",
    "map": "texels on a side of the map",
}
TIMES = {"frame": "frame", "light_moved": "light moved", "objects_moved": "objects moved"}

_MS = {"unit": "ms"}
_EXPONENTS = (
    (key, heading)
    for own, name in TIMES.items()
    for key, heading in ((own, name), (f"{own}_steepest", "steepest"))
)
_GROWTH = (
    *words(kind="work", label="method"),
    *(Column(key, heading) for key, heading in _EXPONENTS),
    *words(cliff="cliff"),
)


def scaling_tables(records: Iterable[Scaling]) -> list[Table]:
    """Return a table of costs for each kind of work in a scene, and one of all exponents."""
    records = list(records)
    # Costs first, by scene and kind of work, then the exponents of each scene.
    kinds = dict.fromkeys((record.scene, record.kind) for record in records)
    tables = [
        _costs(
            scene,
            kind,
            [record for record in records if (record.scene, record.kind) == (scene, kind)],
        )
        for scene, kind in kinds
    ]
    scenes = dict.fromkeys(record.scene for record in records)
    return tables + [
        _exponents(scene, [record for record in records if record.scene == scene])
        for scene in scenes
    ]


def cliffs(records: Iterable[Scaling]) -> list[str]:
    """Return a sentence for every time that jumps."""
    return [
        f"{record.scene}, {record.label}: {TIMES[name]} grows with the power {own.steepest:.2g} of "
        "the "
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
    # One row a step: the work, the times, and the camera rays, below which no frame can be.
    columns = (
        *words(label="method"),
        *numbers(work=WORK[kind], how={"whole": True}),
        *numbers(**TIMES, rays="rays alone", how=_MS),
        *numbers(memory="memory [MiB]"),
    )
    rows = []
    for record in records:
        for cost in record.costs:
            values: dict[str, Value] = {
                "label": record.label,
                "work": cost.work,
                "memory": cost.memory,
            }
            rows.append(
                Row(values | {name: measured(getattr(cost, name)) for name in (*TIMES, "rays")})
            )
        if record.refused:
            rows.append(Row({"label": record.label}, f"refused: {record.refused}"))
    size = "" if kind == "size" else ", {} x {}".format(*records[0].size)
    explanation = (
        "Medians; rays alone: the camera rays without shading, the floor of a frame that casts "
        "them. Memory: what one "
        "frame takes at its peak, prepared again, with its image on the host."
    )
    return table(f"{scene} by {WORK[kind]}{size}", columns, rows, explanation=explanation)


def _exponents(scene: str, records: list[Scaling]) -> Table:
    rows = []
    for record in records:
        # A power needs two steps.
        if len(record.costs) < 2:
            continue
        values: dict[str, Any] = {"kind": WORK[record.kind], "label": record.label}
        for name, own in record.growth.items():
            values |= {name: own.exponent, f"{name}_steepest": own.steepest}
        jumps = [TIMES[name] for name, own in record.growth.items() if own.cliff]
        rows.append(Row(values | {"cliff": ", ".join(jumps) or "no"}))
    explanation = (
        "Exponents e of time ~ work^e, fitted to all steps; steepest: between two steps that "
        "follow one another. "
        "A cliff: steeper than the work asks for by 0.6, in a time above 5 ms."
    )
    return table(f"{scene}: how times grow", _GROWTH, rows, explanation=explanation)
