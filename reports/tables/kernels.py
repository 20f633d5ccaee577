# SPDX-License-Identifier: BSD-3-Clause
"""What kernels cost, which is cheapest at each error, and where they break: studies, the page, documentation."""

from collections.abc import Iterable, Iterator

from reports.tables.table import Column, Measured, Name, Row, Table, Value, numbers, table, words
from validation.kernels.records import ErrorLevel, KernelCost, Rays, RayTime, Stability

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
    """Yield for each phase function the table of costs and the tables of the cheapest kernels at each error."""
    costs, levels = list(costs), list(levels)
    for phase in dict.fromkeys(cost.phase for cost in costs):
        chosen = [cost for cost in costs if cost.phase == phase]
        g = f", g = {chosen[0].g:g}" if phase == "hg" else ""
        yield cost_table(f"{phase}{g}, float32, wide rays", chosen)
        for statistic, phrase in _STATISTICS.items():
            rows = [level for level in levels if (level.phase, level.statistic) == (phase, statistic)]
            yield level_table(f"{phase}: speed against error, {phrase}", rows)


def cost_table(title: str, costs: Iterable[KernelCost], *, code: bool = False) -> Table:
    """Return what kernels cost and how wrong they are; their names as code where they are for typing."""
    return Table(title, COSTS, tuple(_cost_row(cost, code) for cost in costs))


def _cost_row(cost: KernelCost, code: bool) -> Row:
    values: dict[str, Value] = {"kernel": Name(cost.kernel) if code else cost.kernel}
    if cost.refused:
        return Row(values, f"refused: {cost.refused}")
    values |= {"device": _spread(cost.device), "wall": _spread(cost.wall), "rays": cost.rays or None}
    return Row(values | {name: getattr(cost, name) for name in ("median", "p99", "max", "nonfinite")})


def _spread(time: RayTime | None) -> Measured | None:
    return Measured(time.median, time.low, time.high) if time else None


def level_table(title: str, levels: Iterable[ErrorLevel]) -> Table:
    """Return which kernel is cheapest at each error."""
    columns = (Column("level", "error", digits=6), *words("cheapest"), Column("ns", "", "ns/ray"))
    return table(title, columns, [(level.level, level.cheapest or "none", level.ns) for level in levels])


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
        single = rays.single["all"]
        return {**vars(single), "odd": single.odd, "kernel": kernel, "set": rays.name, "double": rays.double["all"].max}

    rows = (row(kernel.kernel, rays) for kernel in found for rays in kernel.sets)
    return table("Robustness of the kernels", columns, rows, explanation="All rays of each set together.")
