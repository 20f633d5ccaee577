# SPDX-License-Identifier: BSD-3-Clause
"""How the page names the rows of the papers' tables; the terminal's names are in biri_tables and billeter_tables."""

from collections.abc import Callable, Mapping
from typing import Any

Row = Mapping[str, Any]

#: Of the published images of Billeter 2010 [pixels]; only at this size are rates compared.
BILLETER_SIZE = [1024, 1024]
BILLETER_PASSES = ["surface", "shadow map", "laplacian", "edge map", "tessellate", "vertices", "prepare", "volume"]


def biri_name(row: Row) -> str:
    """Return the name of a row of `reports.papers.biri.rows_data`."""
    width, height = row["size"]
    return f"{row['published']['scene']}, {width} \N{MULTIPLICATION SIGN} {height} ({biri_variant(row)})"


def biri_variant(row: Row) -> str:
    """Return the kernel of such a row, and the parameters that differ from their defaults."""
    return ", ".join([row["kernel"], *(f"{name}={row[name]}" for name in ("cone", "tolerance") if row.get(name))])


def billeter_image(row: Row) -> str:
    """Return the name of one of the `figures` of `reports.papers.billeter.billeter_data`."""
    entry, (width, height) = row["entry"], row["size"]
    values = ", ".join(f"{name}={value}" for name, value in (("map", entry["map"]), *entry["parameters"]))
    return f"{entry['scene']}, {width} \N{MULTIPLICATION SIGN} {height}: {entry['method']} ({values})"


def billeter_view(row: Row) -> str:
    """Return the name of a row of its `table`."""
    width, height = row["size"]
    return f"{row['scene']}, {width} \N{MULTIPLICATION SIGN} {height}, map {row['map']}: {row['evaluation']}"


def times(ratio: float | None) -> str:
    """Return a ratio of rates."""
    return "\N{EN DASH}" if ratio is None else f"{ratio:.2g} \N{MULTIPLICATION SIGN}"


FILTERS: Mapping[str, Callable[..., str]] = {
    "biri_name": biri_name,
    "billeter_image": billeter_image,
    "billeter_view": billeter_view,
    "times": times,
}
