# SPDX-License-Identifier: BSD-3-Clause
"""The stages of collectors for clouds, what they keep in memory, and how many searches have not converged."""

from collections.abc import Mapping
from typing import Any

from reports.tables.table import Column, Measured, Row, Table, numbers, table, words

Record = Mapping[str, Any]

STAGES = (
    *words(name="stage"),
    *numbers(time="time [ms]", processor="processor [ms]", goal="goal [ms]", first="first frame [s]"),
)


def cloud_stages_tables(record: Record) -> list[Table]:
    """Return the tables of a scene of `airlight bench --stages --json`."""
    size = "{} x {}".format(*record["size"])
    rows = []
    for stage in record["stages"]:
        time, first = stage["time"], stage["first_ms"]
        rows.append(
            {
                "name": stage["name"],
                "time": Measured(time["median_ms"], time["low_ms"], time["high_ms"]),
                "processor": stage["processor_ms"],
                "goal": stage["goal_ms"],
                "first": None if first is None else 1e-3 * first,
            }
        )
    memory = ", ".join(f"{name} {size / 1e6:.3g} MB" for name, size in record["memory"].items())
    title = f"cloud-collectors, {record['scene']}, {size}, {100 * record['cloud']:.0f} % of it cloud"
    explanation = (
        "Processor time is the least sum over all threads. The first frame makes or loads its tables, compiles and "
        f"records. Kept from frame to frame: {memory}."
    )
    return [
        table(title, STAGES, [Row(row) for row in rows], explanation=explanation),
        _convergence(record),
    ]


def _convergence(record: Record) -> Table:
    sets = list(record["convergence"][0]["by_set"])
    columns = (
        *words(start="start"),
        *numbers(iterations="iterations"),
        Column("any_set", "any set", percent=True),
        *(Column(name, f"order {name}", percent=True) for name in sets),
    )
    rows = [
        Row({name: row[name] for name in ("start", "iterations", "any_set")} | row["by_set"])
        for row in record["convergence"]
    ]
    title = (
        "Pixels of the cloud whose collector is further than 0.05 sigma from its fixed point, the sun 1 degree a frame"
    )
    return table(title, columns, rows)
