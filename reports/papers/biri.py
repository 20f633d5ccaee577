# SPDX-License-Identifier: BSD-3-Clause
"""Tables 1 and 2 of Biri 2006 beside our own figures.

The data are `published.biri` of report.json, as `airlight published --json` prints them.
"""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from reports.papers.rates import COLUMNS, rates, size_words
from reports.tables.methods import per_second
from reports.tables.table import Column, Interval, Row, Table, Value, measured, table

Data = Mapping[str, Any]


def biri_data(rows: Sequence[Any], costs: Sequence[Any]) -> dict[str, Any]:
    """Return what was measured as JSON-ready data.

    Parameters
    ----------
    rows
        From `validation.papers.biri.biri_rows`.
    costs
        From `validation.frames.zero_cost.zero_costs`, or none.
    """
    from validation.metrics.errors import plain
    from validation.papers.biri import STAGES

    return {
        "stages": list(STAGES),
        "rows": [plain(row) | {"shares": [float(share) for share in row.shares]} for row in rows],
        "needless": plain(costs),
    }


def biri_tables(data: Data) -> list[Table]:
    """Return the tables: shares of the stages, frames a second, and what is not needed if that was measured."""
    costs = [_cost_table(data["needless"])] if data["needless"] else []
    return [_share_table(data), _rate_table(data["rows"]), *costs]


def biri_notes(data: Data) -> list[str]:
    """Return what there is to know of the published figures, each once."""
    published = [row["published"] for row in data["rows"]]
    return list(dict.fromkeys(f"{one['where']}: {one['note']}." for one in published if one["note"]))


def biri_variant(row: Data) -> str:
    """Return the kernel of a row, and the parameters that differ from their defaults."""
    return ", ".join([row["kernel"], *(f"{name}={row[name]}" for name in ("cone", "tolerance") if row.get(name))])


def _name(row: Data) -> str:
    return f"{row['published']['scene']}, {size_words(row)} ({biri_variant(row)})"


def _share_table(data: Data) -> Table:
    stages = [f"stage_{place}" for place in range(1, len(data["stages"]) + 1)]
    columns = [Column("name", "share of a frame", words=True)]
    columns += [
        Column(key, f"{place} {name}", percent=True)
        for place, (key, name) in enumerate(zip(stages, data["stages"]), start=1)
    ]
    columns.append(Column("sum", "sum", "ms"))
    rows: list[Row] = []
    for row, published in _with_published(data["rows"]):
        if published:
            name = f"{published['scene']}: Table 1, {published['where']}"
            shares = {key: share / 100 for key, share in zip(stages, published["shares"])}
            rows.append(Row({"name": name, **shares}, published=True))
        shares = {key: share / 100 for key, share in zip(stages, row["shares"])}
        rows.append(Row({"name": _name(row), **shares, "sum": sum(row["stages_ms"])}))
    return table("Table 1 of Biri 2006 again: share of each stage in their sum, after the light moved", columns, rows)


def _with_published(rows: Sequence[Data]) -> Iterator[tuple[Data, Data | None]]:
    """Yield every row, with what was published of the shares in its scene before the first of that scene."""
    shown = set()
    for row in rows:
        published = row["published"]
        first = bool(published["shares"]) and published["scene"] not in shown
        shown |= {published["scene"]} if first else set()
        yield row, published if first else None


def _rate_table(rows: Sequence[Data]) -> Table:
    columns = (
        Column("name", "frames a second", words=True),
        Column("triangles", "triangles"),
        *COLUMNS,
        Column("rays", "camera rays alone", whole=True),
        Column("relative_rmse", "rel. RMSE", digits=2, share=True),
        Column("relative_bias", "rel. bias", digits=2, share=True),
        Column("p99", "p99", digits=2, share=True),
    )
    found = []
    for row in rows:
        published, error = row["published"], row["error"]
        values: dict[str, Value] = {"name": _name(row), "triangles": row["triangles"]}
        values |= rates(row, published["fps"], comparable=list(row["size"]) == list(published["size"]))
        values |= {"rays": per_second(measured(row.get("rays")))}
        found.append(Row(values | {name: error[name] for name in ("relative_rmse", "relative_bias", "p99")}))
    return table("Table 2 of Biri 2006 again: frames a second, and the error of the airlight", columns, found)


def _cost_table(costs: Sequence[Data]) -> Table:
    columns = (
        Column("what", "what is not needed", words=True),
        Column("with", "with", "ms"),
        Column("without", "without", "ms"),
        Column("ratio", "ratio", places=3),
        Column("quartiles", "quartiles", places=3),
        Column("turns", "turns"),
    )
    rows = [
        (one["what"], one["with_ms"], one["without_ms"], one["ratio"], Interval(one["low"], one["high"]), one["turns"])
        for one in costs
    ]
    return table("What is not needed: a frame with it against one without, in turns", columns, rows)
