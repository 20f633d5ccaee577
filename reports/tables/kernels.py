# SPDX-License-Identifier: BSD-3-Clause
"""The tables of `airlight bench --kernels`: what kernels cost, and which is cheapest at each error."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

from reports.tables.terminal import number, print_table

if TYPE_CHECKING:
    from validation.kernels.benchmark import KernelBench, KernelCost, Level, Spread
    from validation.kernels.convergence import Convergence

_COSTS = ("kernel", "ns/ray", "quartiles", "wall ns/ray", "quartiles", "rays", "median", "99 %", "max", "not finite")
_LEVELS = ("error", "cheapest", "ns/ray", "cheapest uniform", "costs", "cheapest table", "costs")
_WORDS = {"max": "maximum error", "p99": "99 % of the rays"}

Show = Callable[[Sequence[str], Sequence[Sequence[str]], str], None]


def print_kernel_bench(found: "KernelBench", *, show: Show = print_table) -> None:
    """Print what `validation.kernels.benchmark.bench_kernels` found.

    Parameters
    ----------
    found
        Costs and levels.
    show
        Prints a table from headers, rows and a title.
    """
    for phase in dict.fromkeys(cost.phase for cost in found.costs):
        costs = [cost for cost in found.costs if cost.phase == phase]
        for cost in costs:
            if cost.refused:
                print(f"{cost.kernel}, {phase}: refused: {cost.refused}")
        g = f", g = {costs[0].g:g}" if phase == "hg" else ""
        show(_COSTS, [_cost_row(cost) for cost in costs if not cost.refused], f"{phase}{g}, float32, wide rays")
        for statistic, words in _WORDS.items():
            levels = [one for one in found.levels if (one.phase, one.statistic) == (phase, statistic)]
            show(_LEVELS, [_level_row(one) for one in levels], f"{phase}: speed against error, {words}")
    print("ns/ray: the kernel alone by Dr.Jit's history, median; ~ is extrapolated from fewer steps.")


def print_convergence(found: "Sequence[Convergence]", *, show: Show = print_table) -> None:
    """Print declared and measured orders and rates."""
    rows = [
        (
            one.kernel,
            one.declared.kind if one.declared else "-",
            number(one.declared.value) if one.declared else "-",
            number(one.measured),
            f"{one.sizes[0]}..{one.sizes[-1]}",
        )
        for one in found
    ]
    show(("kernel", "law", "declared", "measured", "sizes"), rows, "convergence in float64")


def convergence_data(found: "Convergence") -> dict[str, Any]:
    """Return one convergence for JSON: what is declared and measured, without the rays."""
    from validation.metrics.errors import plain

    declared = found.declared
    return {
        "kernel": found.kernel,
        "sizes": list(found.sizes),
        "errors": plain(found.errors),
        "declared": {"kind": declared.kind, "value": declared.value, "power": declared.power} if declared else None,
        "measured": plain(found.measured),
    }


def _cost_row(cost: "KernelCost") -> tuple[str, ...]:
    about = "" if cost.rays else "~"
    return (
        cost.kernel,
        *_spread(cost.device, about),
        *_spread(cost.wall, about),
        str(cost.rays or "-"),
        number(cost.median),
        number(cost.p99),
        number(cost.max),
        str(cost.nonfinite or ""),
    )


def _spread(spread: "Spread | None", about: str) -> tuple[str, str]:
    if spread is None:
        return "-", "-"
    return about + number(spread.median), f"{number(spread.low)}..{number(spread.high)}"


def _level_row(level: "Level") -> tuple[str, ...]:
    cells = [f"{level.level:g}", level.cheapest or "none", number(level.ns)]
    for family in ("uniform", "table"):
        ratio = level.ratios.get(family)
        cells += [level.rivals.get(family) or "none", "-" if ratio is None else f"{number(ratio)} x"]
    return tuple(cells)
