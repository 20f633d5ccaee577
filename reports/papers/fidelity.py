# SPDX-License-Identifier: BSD-3-Clause
"""The verdicts on the claims of papers as tables, from `fidelity` of report.json."""

from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

from reports.tables.table import Table, numbers, table, words

Data = Mapping[str, Any]
VERDICTS = ("reproduced", "refuted", "differs", "impossible")


def fidelity_tables(rows: Sequence[Data]) -> list[Table]:
    """Return a table for each paper: item, claim, verdict, both figures and why."""
    from validation.fidelity.catalogue import PAPERS

    columns = (
        *words("item"),
        *words("claim", how={"long": True}),
        *words("verdict"),
        *numbers("published", "measured"),
        *words("unit"),
        *words("command"),
        *words("why", how={"long": True}),
    )
    papers = dict.fromkeys(row["paper"] for row in rows)
    return [
        table(
            PAPERS.get(paper, paper),
            columns,
            [row for row in rows if row["paper"] == paper],
            explanation=f"{count_words([row for row in rows if row['paper'] == paper])}.",
        )
        for paper in papers
    ]


def count_words(rows: Sequence[Data]) -> str:
    """Return how many rows have each verdict, in words."""
    counts = Counter(row["verdict"] for row in rows)
    return f"{len(rows)} rows: " + ", ".join(f"{counts[verdict]} {verdict}" for verdict in VERDICTS if counts[verdict])
