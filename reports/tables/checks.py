# SPDX-License-Identifier: BSD-3-Clause
"""The table of the light that single scattering leaves out."""

from collections.abc import Iterable, Mapping
from typing import Any

from reports.tables.table import Interval, Name, Row, Table, Value, numbers, table, words

Entry = Mapping[str, Any]


def left_out_table(scenes: Iterable[Entry], *, code: bool = False) -> Table:
    """Return for every scene of a report the shares of light that single scattering leaves out."""
    share = {"percent": True}
    columns = (
        *words("scene"),
        *numbers(medium="of the airlight", medium_interval="95 % interval", how=share),
        *numbers(everything="of all light", everything_interval="95 % interval", how=share),
        *numbers(max_depth="max. edges"),
    )
    explanation = (
        "Shares of all light that paths of up to max. edges bring, with 95 % intervals; the second adds surfaces that "
        "light one another."
    )
    rows = (_left_out(scene, Name(scene["name"]) if code else scene["name"]) for scene in scenes)
    return table("Multiple scattering", columns, rows, explanation=explanation)


def _left_out(scene: Entry, name: Value) -> Row:
    multiple = scene["multiple"]
    if not multiple:
        return Row({"scene": name}, "not measured")
    values: dict[str, Value] = {"scene": name, "max_depth": multiple.get("max_depth")}
    for key in ("medium", "everything"):
        values |= {key: multiple[key]["value"], f"{key}_interval": Interval.of(multiple[key]["interval"])}
    return Row(values)
