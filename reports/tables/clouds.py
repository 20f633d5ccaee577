# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the canonical transport: what is kept, and its errors by set of orders."""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Column, Table, table

Record = Mapping[str, Any]

_QUANTITIES = (("T", "T, relative"), ("c", "c, of sigma"), ("sigma", "sigma, relative"))


def clouds_tables(record: Record) -> list[Table]:
    """Return the tables of what `airlight clouds --tables --json` prints."""
    columns = (Column("orders", "orders", words=True), Column("coefficients", "products"), Column("mb", "MB"))
    rows = [{**row, "mb": row["bytes"] / 1e6} for row in record["sets"]]
    tables = [table("Tables of the canonical transport by set of orders", columns, rows)]
    for name, title in (
        ("check", "Errors of the tables, against the computation at random points"),
        ("fit", "Errors of the paper's 22 functions, against the tables at random points"),
    ):
        if name in record:
            tables.append(_errors(f"{title} ({record[name]['points']})", record[name]["sets"]))
    return tables


def clouds_sentence(record: Record) -> str:
    """Return how large the tables are and how long they took."""
    where = "from the cache" if record["kept"] else "made now"
    return (
        f"{record['phase']}, albedo {record['albedo']:g}: {record['bytes'] / 1e6:.1f} MB, {where}; they took "
        f"{record['seconds']:.0f} s to make."
    )


def _errors(title: str, sets: Any) -> Table:
    columns = [Column("orders", "orders", words=True), Column("points", "points")]
    for name, words in _QUANTITIES:
        columns += [Column(f"{name}_{share}", f"{words}, {share[1:]} %", digits=2) for share in ("p50", "p95")]
    rows = [
        {**row, **{f"{name}_{share}": row[name][share] for name, _ in _QUANTITIES for share in ("p50", "p95")}}
        for row in sets
    ]
    return table(title, columns, rows)
