# SPDX-License-Identifier: BSD-3-Clause
"""Claims of papers: a table of verdicts for each paper, its numbers without a verdict
apart, and their counts.
"""

from airlight.reports.tables.papers import count_words, paper_tables
from airlight.reports.tables.table import Interval
from airlight.validation.papers.claims import Claim


def claim(item, verdict=None, paper="biri", **changes):
    return Claim(paper, item, f"words of {item}", verdict=verdict, **changes)


ROWS = [
    claim(
        "eq. 1", "reproduced", measured=1.0, published=1.0, low=0.9, high=1.1, interval="quartiles"
    ),
    claim("fig. 2", "impossible", why="no figure"),
    claim(
        "table 3",
        published=60.0,
        measured=41.0,
        low=41.0,
        high=41.0,
        interval="quartiles",
        unit="frames/s",
    ),
    claim("eq. 4", "not reproduced", paper="ali"),
    claim("fig. 5", paper="unheard of"),
]


def test_each_paper_has_its_verdicts_and_then_its_numbers_beside_ours():
    tables = paper_tables(ROWS)
    assert [[row.values["item"] for row in table.rows] for table in tables] == [
        ["eq. 1", "fig. 2"],
        ["eq. 4"],
        ["table 3"],
        ["fig. 5"],
    ]
    assert tables[0].explanation == "2 claims: 1 reproduced, 1 impossible."
    assert tables[2].title == f"{tables[0].title}: numbers beside ours"
    assert tables[3].title == "unheard of: numbers beside ours"
    assert "verdict" not in {column.key for column in tables[2].columns}
    assert [table.title for table in paper_tables(ROWS, plain=False)] == [
        tables[0].title,
        tables[1].title,
    ]


def test_a_figure_has_the_interval_that_was_measured_and_none_where_both_ends_are_one():
    values = [row.values for table in paper_tables(ROWS) for row in table.rows]
    assert (values[0]["ends"], values[0]["interval"]) == (Interval(0.9, 1.1), "quartiles")
    (number,) = (each for each in values if each["item"] == "table 3")
    assert (number["published"], number["measured"], number["unit"]) == (60.0, 41.0, "frames/s")
    assert number.get("ends") is None
    assert number.get("interval") is None


def test_verdicts_that_no_row_has_are_not_counted():
    assert count_words(ROWS[:1]) == "1 claims: 1 reproduced"
