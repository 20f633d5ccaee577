# SPDX-License-Identifier: BSD-3-Clause
"""The error of methods by its causes."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Row, Table, Value, numbers, table, words

_SHARE = {"digits": 2, "share": True}
COLUMNS = (
    *words(label="method", cause="error by", without="gone with"),
    *numbers(relative_rmse="rel. RMSE", relative_bias="rel. bias", how=_SHARE),
    *numbers(share="share of the whole", how={"percent": True, "places": 1}),
)


def decomposition_table(title: str, methods: Iterable[Mapping[str, Any]]) -> Table:
    """Return the errors of methods by cause, each after the whole of which they are parts.

    `methods` have a `label` and either the reason why they are `refused`, or the `whole` and its `parts`, as
    `airlight bench --decompose --json` prints them.
    """
    rows: list[Row] = []
    for entry in methods:
        if entry.get("refused"):
            rows.append(Row({"label": entry["label"]}, reason=entry["refused"]))
            continue
        for number, part in enumerate((entry["whole"], *entry["parts"])):
            values: dict[str, Value] = {column.key: part.get(column.key) for column in COLUMNS}
            rows.append(Row(values | {"label": "" if number else entry["label"]}))
    return table(title, COLUMNS, rows)
