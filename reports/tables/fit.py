# SPDX-License-Identifier: BSD-3-Clause
"""Tables of parameters that explain an image."""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Column, Interval, Table, table

_COLUMNS = (
    Column("name", "parameter", words=True),
    Column("value", "value", digits=6),
    Column("interval", "95 % interval", digits=6),
    Column("scene", "in the scene", digits=6),
)


def parameters_table(record: Mapping[str, Any]) -> Table:
    """Return the table of what `airlight fit --json` prints; channels have a row each."""
    rows = [row for name, each in record["parameters"].items() for row in _rows(name, each)]
    return table("Parameters that explain the image", _COLUMNS, rows)


def _rows(name: str, each: Mapping[str, Any]) -> list[dict[str, Any]]:
    if not isinstance(each["value"], list):
        return [_row(name, each)]
    word, colon, place = name.partition(":")
    return [
        _row(f"{word}.{channel}{colon}{place}", {key: values[number] for key, values in each.items()})
        for number, channel in enumerate("rgb")
    ]


def _row(name: str, each: Mapping[str, Any]) -> dict[str, Any]:
    return {"name": name, **each, "interval": Interval.of((each["low"], each["high"]))}
