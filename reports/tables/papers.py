# SPDX-License-Identifier: BSD-3-Clause
"""The claims of papers with their verdicts, and the numbers that papers print beside ours.

The rows stand under `papers` in report.json.
"""

import itertools
from collections import Counter
from collections.abc import Sequence

from airlight.reports.tables.table import Interval, Table, Value, numbers, table, words
from airlight.validation.papers.claims import VERDICTS, Claim, papers

_COLUMNS = (
    *words(item="item"),
    *words(words="claim", how={"long": True}),
    *words(verdict="verdict"),
    *numbers(published="published", measured="measured"),
    *numbers(ends="between"),
    *words(interval="which is"),
    *words(unit="unit"),
    *words(why="why", how={"long": True}),
)


def paper_tables(rows: Sequence[Claim], *, plain: bool = True) -> list[Table]:
    """Return for each paper a table of verdicts, then with `plain` one of its
    numbers without a verdict.
    """
    made = []
    names = dict.fromkeys(row.paper for row in rows)
    # First the verdicts of all papers, then their numbers without one.
    for judged, paper in itertools.product((True, False) if plain else (True,), names):
        several = [
            row for row in rows if row.paper == paper and (row.verdict is not None) == judged
        ]
        name = papers().get(paper, paper)
        if several and judged:
            made.append(
                table(name, _COLUMNS, map(_cells, several), explanation=f"{count_words(several)}.")
            )
        elif several:
            shown = table(f"{name}: numbers beside ours", _COLUMNS, map(_cells, several))
            made.append(
                shown.only(
                    "item", "words", "published", "measured", "ends", "interval", "unit", "why"
                )
            )
    return made


def _cells(row: Claim) -> dict[str, Value]:
    ends = Interval.of((row.low, row.high))
    values = {
        name: getattr(row, name)
        for name in ("item", "words", "verdict", "published", "measured", "unit", "why")
    }
    return values | (
        {"ends": ends, "interval": row.interval} if ends and ends.low < ends.high else {}
    )


def count_words(rows: Sequence[Claim]) -> str:
    """Return how many rows have each verdict, in words."""
    counts = Counter(row.verdict for row in rows)
    return f"{len(rows)} claims: " + ", ".join(
        f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]
    )
