# SPDX-License-Identifier: BSD-3-Clause
"""The claims of papers with their verdicts, and the numbers that papers print beside ours.

Rows are those that stand under `papers` of report.json.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

from reports.tables.table import Interval, Row, Table, Value, numbers, table, words
from validation.papers.claims import VERDICTS, Claim, papers

_COLUMNS = (
    *words(item="item"),
    *words(words="claim", how={"long": True}),
    *words(verdict="verdict"),
    *numbers(published="published", measured="measured"),
    *numbers(interval="between"),
    *words(unit="unit"),
    *words(why="why", how={"long": True}),
)


def paper_tables(rows: Sequence[Claim]) -> list[Table]:
    """Return for each paper a table of verdicts and one of numbers without a verdict."""
    return [*verdict_tables(rows), *number_tables(rows)]


def verdict_tables(rows: Sequence[Claim]) -> list[Table]:
    """Return a table of verdicts for each paper."""
    judged = [row for row in rows if row.verdict is not None]
    return [
        replace(_table(paper, several), explanation=f"{count_words(several)}.")
        for paper, several in _by_paper(judged).items()
    ]


def number_tables(rows: Sequence[Claim]) -> list[Table]:
    """Return a table of the numbers without a verdict for each paper."""
    plain = [row for row in rows if row.verdict is None]
    return [
        _table(f"{paper}: numbers beside ours", several).only(
            "item", "words", "published", "measured", "interval", "unit", "why"
        )
        for paper, several in _by_paper(plain).items()
    ]


def _by_paper(rows: Sequence[Claim]) -> dict[str, list[Claim]]:
    named = papers()
    found: dict[str, list[Claim]] = {}
    for row in rows:
        found.setdefault(named.get(row.paper, row.paper), []).append(row)
    return found


def _table(title: str, rows: Sequence[Claim]) -> Table:
    return table(title, _COLUMNS, [Row(_cells(row)) for row in rows])


def _cells(row: Claim) -> dict[str, Value]:
    interval = Interval.of((row.low, row.high))
    values = {name: getattr(row, name) for name in ("item", "words", "verdict", "published", "measured", "unit", "why")}
    return values | ({"interval": interval} if interval and interval.low < interval.high else {})


def count_words(rows: Sequence[Claim]) -> str:
    """Return how many rows have each verdict, in words."""
    counts = Counter(row.verdict for row in rows)
    return f"{len(rows)} claims: " + ", ".join(
        f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict]
    )
