# SPDX-License-Identifier: BSD-3-Clause
"""Tables of the canonical transport: what is kept, by set of orders."""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Column, Table, table

Record = Mapping[str, Any]


def clouds_table(record: Record) -> Table:
    """Return the table of what `airlight clouds --tables --json` prints."""
    columns = (Column("orders", "orders", words=True), Column("coefficients", "products"), Column("mb", "MB"))
    rows = [{**row, "mb": row["bytes"] / 1e6} for row in record["sets"]]
    return table("Tables of the canonical transport by set of orders", columns, rows)


def clouds_sentence(record: Record) -> str:
    """Return how large the tables are and how long they took."""
    where = "from the cache" if record["kept"] else "made now"
    return (
        f"{record['phase']}, albedo {record['albedo']:g}: {record['bytes'] / 1e6:.1f} MB, {where}; they took "
        f"{record['seconds']:.0f} s to make."
    )
