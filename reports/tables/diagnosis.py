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


def answers_table(rows: Sequence[Row], title: str = "Planted faults and what a diagnosis answers") -> Table:
    """Return the table of what `airlight bench --diagnosis --json` prints, a row for each fault."""
    faults = list(dict.fromkeys((row["planted"], row["words"]) for row in rows))
    return table(title, _COLUMNS, [_fault(rows, *fault) for fault in faults])


def answers_sentence(rows: Sequence[Row]) -> str:
    """Return how many faults were named first, and whether right images were left in peace."""
    single = [row for row in rows if row["planted"] != "right" and not row["pair"]]
    right = [row for row in rows if row["planted"] == "right"]
    pairs = [row for row in rows if row["pair"]]
    share = 100 * _count(single) / max(len(single), 1)
    sentences = [
        f"{_count(single)} of {len(single)} faults are named first ({share:.3g} %)",
        f"{_count(right)} of {len(right)} right images are called right",
    ]
    if pairs:
        sentences.append(f"of {len(pairs)} pairs of faults both are named in {_count(pairs)}")
    return "; ".join(sentences) + "."


def _count(rows: Sequence[Row]) -> int:
    return sum(row["right"] for row in rows)


def _fault(rows: Sequence[Row], planted: str, words: str) -> dict[str, Any]:
    own = [row for row in rows if (row["planted"], row["words"]) == (planted, words)]
    others = [f"{row['answer']} ({row['scene']})" for row in own if not row["right"]]
    return {
        "words": words,
        "planted": planted,
        "scenes": len(own),
        "named": sum(row["right"] for row in own),
        "others": ", ".join(others) or "-",
    }
