# SPDX-License-Identifier: BSD-3-Clause
"""One table drawn five ways carries the same cells, whatever stands in them."""

import re
from dataclasses import replace

import pytest

from reports.tables.drawing import csv, html, latex, markdown, text
from reports.tables.table import Column, Measured, Row, Table, numbers, with_spread, words


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
    values = {"name": "shadow-planes (exact, order=paper)", "time": Measured(1.2345, 1.1, 1.3), "other": 3.21}
    return Table("A title that is long " * 6, columns, (Row(values | {f"error {n}": 1e-5 / 3 for n in range(5)}),))


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
    rows = (Row({"name": "<b> a|b & c_d 50 %", "time": Measured(12.345, 12.0, 13.0)}), Row({"name": "b"}, "no <light>"))
    drawn = Table("t", columns, rows)
    assert " <b> a|b & c_d 50 %      12.3      12..13\n\nb: no <light>\n" in text(drawn)
    assert r"| \<b> a\|b \& c\_d 50 % | 12.3 | 12..13 |" in markdown(drawn)
    assert markdown(drawn).endswith("- b: no \\<light>\n")
    assert '">&lt;b&gt; a|b &amp; c_d 50 %</th><td>12.3 <span class="spread">12 … 13</span></td></tr>' in html(drawn)
    assert "no &lt;light&gt;</td>" in html(drawn)
    cells = r"\textless{}b\textgreater{} a|b \& c\_d 50 \% & $\num{12.35}_{-\num{0.35}}^{+\num{0.65}}$ \\"
    refusal = r"b & \multicolumn{1}{l}{no \textless{}light\textgreater{}} \\"
    assert latex([drawn]).splitlines()[-4:-2] == [cells, refusal]
    wanted = "name,time,time_low,time_high,reason\n<b> a|b & c_d 50 %,12.345,12,13,\nb,,,,no <light>\n"
    assert csv(drawn).replace("\r", "") == wanted
