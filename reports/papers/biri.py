# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 of Biri 2006 beside our own figures, for a terminal, a README and as JSON."""

from collections.abc import Sequence
from typing import Any

from reports.papers.labels import biri_variant
from reports.tables.bench import RATES, print_heading, print_markdown, rate, rate_cells
from reports.tables.terminal import number, print_table


def rows_data(rows: Sequence, costs: Sequence) -> dict[str, Any]:
    """Return the rows and the costs of what is not needed as JSON-ready data."""
    from reports.data.serialize import plain
    from validation.papers.biri import STAGES

    return {
        "stages": list(STAGES),
        "rows": [plain(row) | {"shares": [float(share) for share in row.shares]} for row in rows],
        "needless": plain(costs),
    }


def print_biri(rows: Sequence, costs: Sequence, *, markdown: bool = False) -> None:
    """Print the tables.

    Parameters
    ----------
    rows
        From `validation.papers.biri.biri_rows`.
    costs
        From `validation.frames.zero_cost.zero_costs`, or none.
    markdown
        Print Markdown, with the date and the machine.
    """
    show = print_markdown if markdown else print_table
    if markdown:
        print_heading()
    _print_shares(rows, show)
    _print_rates(rows, show)
    for note in dict.fromkeys(f"{row.published.where}: {row.published.note}" for row in rows if row.published.note):
        print(f"\n{note}.")
    if costs:
        _print_costs(costs, show)


def _print_shares(rows: Sequence, show) -> None:
    from validation.papers.biri import STAGES

    headers = ("share of a frame", *(f"{place} {name}" for place, name in enumerate(STAGES, 1)), "sum ms")
    cells = []
    shown = set()
    for row in rows:
        one = row.published
        if one.shares is not None and one.scene not in shown:
            shown.add(one.scene)
            cells.append((f"{one.scene}: Table 1, {one.where}", *(f"{share:g} %" for share in one.shares), "-"))
        cells.append((_name(row), *(f"{share:.3g} %" for share in row.shares), number(sum(row.stages_ms))))
    show(headers, cells, "Table 1 of Biri 2006 again: share of each stage in their sum, after the light moved")


def _print_rates(rows: Sequence, show) -> None:
    headers = (
        "frames a second",
        "triangles",
        "published",
        *RATES,
        "camera rays alone",
        "rel. RMSE",
        "rel. bias",
        "p99",
    )
    cells = []
    for row in rows:
        error = row.error
        cells.append(
            (
                _name(row),
                str(row.triangles),
                number(row.published.fps),
                *rate_cells(row, row.published.fps if row.size == row.published.size else None),
                rate(row.rays.median_ms),
                number(error.relative_rmse, 2),
                number(error.relative_bias, 2),
                number(error.p99, 2),
            )
        )
    show(headers, cells, "Table 2 of Biri 2006 again: frames a second, and the error of the airlight")


def _print_costs(costs: Sequence, show) -> None:
    headers = ("what is not needed", "with ms", "without ms", "ratio", "quartiles", "turns")
    cells = [
        (
            cost.what,
            number(cost.with_ms),
            number(cost.without_ms),
            f"{cost.ratio:.3f}",
            f"{cost.low:.3f}..{cost.high:.3f}",
            str(cost.turns),
        )
        for cost in costs
    ]
    show(headers, cells, "What is not needed: a frame with it against one without, in turns")


def _name(row) -> str:
    width, height = row.size
    return f"{row.published.scene}, {width} x {height} ({biri_variant(vars(row))})"
