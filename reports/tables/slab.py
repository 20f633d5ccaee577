# SPDX-License-Identifier: BSD-3-Clause
"""Tables of a slab by order of scattering."""

from collections.abc import Iterator, Mapping
from typing import Any

from reports.tables.table import Column, Table, table

Record = Mapping[str, Any]

_ORDERS = (
    ("reflectance", "reflected"),
    ("reflected_mean", "mean"),
    ("reflected_rms", "rms"),
    ("transmittance", "transmitted"),
    ("transmitted_mean", "mean"),
    ("transmitted_rms", "rms"),
)


def slab_tables(record: Record) -> list[Table]:
    """Return the tables of what `airlight slab --json` prints."""
    tables = [_orders_table("By order; lengths in mean free paths", record["orders"])]
    photons = record.get("photons")
    if photons:
        tables.append(_orders_table(f"By {photons['count']} photons", photons["orders"]))
        tables.append(_orders_table("Standard errors of the photons", photons["standard_error"]["orders"], digits=2))
    fluence = [{"orders": row["orders"], **each} for row in record["orders"] for each in row["fluence"]]
    if fluence:
        columns = (Column("orders", "orders", words=True), *_numbers("depth", "value", "mean", "rms"))
        tables.append(table("Fluence for unit flux across the beam", columns, fluence))
    total = record["total"]
    if total["flux"]:
        columns = _numbers("depth", "up", "down")
        tables.append(table("Diffuse flux of all orders for a flux of pi across the beam", columns, total["flux"]))
    if total["radiance"]:
        rows = [
            {**row, "error": change["value"]}
            for row, change in zip(total["radiance"], record["error"]["total"]["radiance"], strict=True)
        ]
        columns = (*_numbers("depth", "mu", "phi", "value"), Column("error", "error", digits=2))
        tables.append(table("Radiance of all orders for a flux of pi across the beam", columns, rows))
    return tables


def slab_sentence(record: Record) -> str:
    """Return what is reflected and transmitted of all light, and how exact the numbers are."""
    total = record["total"]
    worst = max(_relative_errors(record, record["error"]), default=0.0)
    return (
        f"All orders: reflectance {total['reflectance']:.7g}, transmittance {total['transmittance']:.7g} (with the "
        f"light that was never scattered). Largest relative error of all numbers, estimated: {worst:.1g}."
    )


def _relative_errors(numbers: Any, errors: Any) -> Iterator[float]:
    if isinstance(errors, Mapping):
        for name in errors:
            if name not in ("depth", "mu", "phi"):
                yield from _relative_errors(numbers[name], errors[name])
    elif isinstance(errors, list):
        for pair in zip(numbers, errors, strict=True):
            yield from _relative_errors(*pair)
    elif isinstance(errors, float) and numbers:
        yield errors / abs(numbers)


def _orders_table(title: str, rows: list[Any], *, digits: int = 6) -> Table:
    columns = (
        Column("orders", "orders", words=True),
        *(Column(key, heading, digits=digits) for key, heading in _ORDERS),
    )
    return table(title, columns, rows)


def _numbers(*keys: str) -> tuple[Column, ...]:
    return tuple(Column(key, key, digits=6) for key in keys)
