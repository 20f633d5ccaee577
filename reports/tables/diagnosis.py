# SPDX-License-Identifier: BSD-3-Clause
"""The table of planted faults against what a diagnosis answered."""

from collections.abc import Mapping, Sequence
from typing import Any

from reports.tables.table import Column, Table, table

_COLUMNS = (
    Column("words", "what is wrong", words=True),
    Column("planted", "should be named", words=True),
    Column("scenes", "scenes", places=0),
    Column("named", "named first", places=0),
    Column("others", "answers that are not it", words=True),
)

Row = Mapping[str, Any]


def answers_table(rows: Sequence[Row]) -> Table:
    """Return the table of what `airlight bench --diagnosis --json` prints, a row for each fault."""
    faults = list(dict.fromkeys((row["planted"], row["words"]) for row in rows))
    return table("Planted faults and what a diagnosis answers", _COLUMNS, [_fault(rows, *fault) for fault in faults])


def answers_sentence(rows: Sequence[Row]) -> str:
    """Return how many faults were named first, and whether right images were left in peace."""
    faults = [row for row in rows if row["planted"] != "right"]
    right = [row for row in rows if row["planted"] == "right"]
    named = sum(row["right"] for row in faults)
    share = 100 * named / len(faults) if faults else 0.0
    return (
        f"{named} of {len(faults)} faults are named first ({share:.3g} %); {sum(row['right'] for row in right)} of "
        f"{len(right)} right images are called right."
    )


def _fault(rows: Sequence[Row], planted: str, words: str) -> dict[str, Any]:
    own = [row for row in rows if (row["planted"], row["words"]) == (planted, words)]
    others = [f"{row['first']} ({row['scene']})" for row in own if not row["right"]]
    return {
        "words": words,
        "planted": planted,
        "scenes": len(own),
        "named": sum(row["right"] for row in own),
        "others": ", ".join(others) or "-",
    }
