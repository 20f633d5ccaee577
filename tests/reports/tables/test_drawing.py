# SPDX-License-Identifier: BSD-3-Clause
"""One table drawn five ways carries the same cells, whatever stands in them."""

import re
from dataclasses import replace

import pytest

from airlight.reports.tables.drawing import csv, html, latex, markdown, text
from airlight.reports.tables.table import (
    Column,
    Interval,
    Measured,
    Name,
    Row,
    Table,
    numbers,
    table,
    with_spread,
    words,
)


@pytest.mark.claim("latex-tables")
def test_a_median_has_the_digits_of_its_quartiles():
    assert with_spread(12.347, 12.123, 12.903) == ("12.35", "0.22", "0.56")
    assert with_spread(144.4, 139.2, 153.7) == ("144.4", "5.2", "9.3")
    assert with_spread(140.0, 133.0, 171.0) == ("140", "7", "31")


def _wide() -> Table:
    columns = (
        *words(name="method"),
        *numbers(time="frame", how={"unit": "ms", "spread": "quartiles"}),
        *numbers(other="light moved", how={"unit": "ms", "minor": True}),
        *numbers(*(f"error {n}" for n in range(5))),
    )
    values = {
        "name": "shadow-planes-2006 (exact, order=paper)",
        "time": Measured(1.2345, 1.1, 1.3),
        "other": 3.21,
    }
    return Table(
        "A title that is long " * 6,
        columns,
        (Row(values | {f"error {n}": 1e-5 / 3 for n in range(5)}),),
    )


@pytest.mark.claim("tables-at-80-columns")
@pytest.mark.parametrize("width", [80, 60])
def test_a_narrow_terminal_shows_whole_numbers_and_says_what_it_leaves_out(width):
    drawn = text(_wide(), width=width)
    assert max(map(len, drawn.splitlines())) <= width
    assert "3.33e-06" in drawn
    assert "shadow-planes" in drawn  # no word is broken
    said = " ".join(drawn.split())
    assert f"Left out at {width} columns: quartiles, light moved ms" in said
    whole = max(map(len, text(replace(_wide(), title="")).splitlines()))
    columns = int(re.search(r"or (\d+) columns show all", said)[1])
    assert whole <= columns <= whole + 2
    assert "Left out" not in text(_wide(), width=columns)
    assert "1.1..1.3" in text(_wide(), width=columns)


@pytest.mark.claim("latex-tables")
def test_five_ways_carry_the_same_cells_and_escape_what_means_something_to_them():
    columns = (Column("name", "name", words=True), Column("time", "time", "ms", spread="quartiles"))
    rows = (
        Row({"name": "<b> a|b & c_d 50 %", "time": Measured(12.345, 12.0, 13.0)}),
        Row({"name": "b"}, "no <light>"),
    )
    drawn = Table("t", columns, rows)
    assert " <b> a|b & c_d 50 %      12.3      12..13\n\nb: no <light>\n" in text(drawn)
    assert r"| \<b> a\|b \& c\_d 50 % | 12.3 | 12..13 |" in markdown(drawn)
    assert markdown(drawn).endswith("- b: no \\<light>\n")
    assert (
        '">&lt;b&gt; a|b &amp; c_d 50 %</th><td>12.3 <span class="spread">12 … 13</span></td></tr>'
        in html(drawn)
    )
    assert "no &lt;light&gt;</td>" in html(drawn)
    cells = r"\textless{}b\textgreater{} a|b \& c\_d 50 \% & $\num{12.35}_{-\num{0.35}}^{+\num{0.65}}$ \\"
    refusal = r"b & \multicolumn{1}{l}{no \textless{}light\textgreater{}} \\"
    assert latex([drawn]).splitlines()[-4:-2] == [cells, refusal]
    wanted = (
        "name,time,time_low,time_high,reason\n<b> a|b & c_d 50 %,12.345,12,13,\nb,,,,no <light>\n"
    )
    assert csv(drawn).replace("\r", "") == wanted


def test_an_interval_that_is_not_known_leaves_its_cells_of_csv_empty():
    rows = [("a", Interval(1.0, 2.0)), ("b", None)]
    drawn = csv(table("", (*words("name"), *numbers(bias="bias")), rows))
    assert drawn == "name,bias_low,bias_high\na,1,2\nb,,\n"


@pytest.mark.claim("tables-at-80-columns")
@pytest.mark.parametrize(("styled", "name"), [(False, "planes"), (True, "\x1b[1mplanes\x1b[0m")])
def test_sentences_in_a_narrow_terminal_are_a_list_that_leaves_nothing_out(styled, name):
    columns = (
        *words(name="name"),
        *words(what="what it is for", source="source", how={"long": True}),
        *numbers("cost"),
    )
    sentence = "It draws the silhouettes of occluders as seen from a light of the scene."
    drawn = text(table("", columns, [("planes", sentence, "", 12.5)]), width=34, styled=styled)
    assert drawn.splitlines() == [
        "",
        name,
        "  what it is for: It draws the",
        "    silhouettes of occluders as",
        "    seen from a light of the",
        "    scene.",
        "  cost: 12.5",
        "",
    ]


def test_names_that_one_types_are_code_with_the_address_of_their_page():
    rows = [(Name("a|b_c", "methods.md#a"), 1.0), (Name("d"), 2.0)]
    drawn = table("", (*words("name"), *numbers("cost")), rows)
    assert markdown(drawn).splitlines()[2:] == ["| [`a\\|b_c`](methods.md#a) | 1 |", "| `d` | 2 |"]
    assert '<a href="methods.md#a"><code>a|b_c</code></a>' in html(drawn)
    assert latex([drawn]).splitlines()[5:7] == [
        r"\texttt{a|b\_c} & \num{1.00} \\",
        r"\texttt{d} & \num{2.00} \\",
    ]
    assert csv(drawn) == "name,cost\na|b_c,1\nd,2\n"


@pytest.mark.claim("latex-tables")
def test_tables_with_the_same_columns_are_one_tabular_with_a_line_of_units_where_there_are_some():
    columns = (*words("name"), Column("time", "time", "ms"))
    tables = [
        table(title, columns, [(f"of {title}", value)], explanation="to 1e-3")
        for title, value in (("hall", 1.5), ("fence", float("-inf")))
    ]
    lines = latex(tables, comment=["by hand"]).splitlines()
    assert lines[1:6] == [
        "% by hand",
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"name & time \\",
        r" & [ms] \\",
    ]
    assert lines[6:-2] == [
        r"\midrule",
        r"\multicolumn{2}{l}{\textit{hall}, to \num{1e-3}} \\",
        r"of hall & \num{1.50} \\",
        r"\addlinespace",
        r"\multicolumn{2}{l}{\textit{fence}, to \num{1e-3}} \\",
        r"of fence & $-\infty$ \\",
    ]


def test_a_value_without_a_column_is_refused():
    with pytest.raises(ValueError, match="table 'times': no column for frme"):
        Table("times", numbers("frame"), (Row({"frme": 1.0}),))
