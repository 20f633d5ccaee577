# SPDX-License-Identifier: BSD-3-Clause
"""One table drawn five ways carries the same cells, whatever stands in them."""

import csv as comma_separated
import io
import math
import re
from dataclasses import replace
from html.parser import HTMLParser

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reports.tables.drawing import DASH, csv, html, latex, markdown, text
from reports.tables.table import (
    Column,
    Interval,
    Measured,
    Row,
    Table,
    Verdict,
    numbers,
    table,
    with_spread,
    words,
)

COLUMNS = (
    Column("name", "what is_it", words=True),
    Column("time", "time", "ms", spread="quartiles"),
    Column("rate", "frames/s", whole=True),
    Column("bias", "bias", percent=True, sign=True, places=3),
    Column("ends", "95 % interval"),
    Column("count", "not finite", alarm=True),
    Column("agrees", "agrees"),
)
HARD = ["a|b & c_d", "<b>\"50 %\" 'q'</b>", "a\nb", "\\{x}$y^2$ ~ #1", "*_`code`_*", "[a](b)", "&amp; \\& \\|", "2 x 3"]


def unescaped_latex(cell):
    for written, read in (
        (r"\textbackslash{}", "\0"),
        (r"\textasciitilde{}", "~"),
        (r"\textasciicircum{}", "^"),
        (r"\textless{}", "<"),
        (r"\textgreater{}", ">"),
        (r"\textquotedbl{}", '"'),
        (r"$\times$", "\N{MULTIPLICATION SIGN}"),
    ):
        cell = cell.replace(written, read)
    return re.sub(r"\\([{}$&%#_])", r"\1", cell).replace("\0", "\\")


def latex_rows(drawn):
    """The cells of each row between the rules; a bare & ends a cell."""
    body = drawn.split("\\midrule\n")[1].split("\\bottomrule")[0]
    lines = [line.removesuffix(r" \\") for line in body.splitlines() if not line.startswith(r"\multicolumn")]
    return [re.split(r"(?<!\\) & ", line) for line in lines]


def markdown_rows(drawn):
    rows = [line for line in drawn.splitlines() if line.startswith("|")][2:]
    cells = [re.findall(r"\| ((?:\\.|[^|\\])*) (?=\|)", row) for row in rows]
    return [[re.sub(r"\\([\\|`*_<&\[\]])", r"\1", cell) for cell in row] for row in cells]


class _Cells(HTMLParser):
    def __init__(self):
        super().__init__(convert_charrefs=True)
        self.rows, self.classes, self.inside, self.tags = [], [], False, set()

    def handle_starttag(self, tag, attrs):
        self.tags.add(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
            self.classes.append(dict(attrs).get("class"))
            self.inside = True

    def handle_endtag(self, tag):
        if tag in ("td", "th"):
            self.inside = False

    def handle_data(self, data):
        if self.inside:
            self.rows[-1][-1] += data


def html_rows(drawn):
    parser = _Cells()
    parser.feed(drawn)
    return parser.rows[1:]


def csv_rows(drawn):
    return list(comma_separated.DictReader(io.StringIO(drawn)))


def as_number(cell):
    """A number as its digits in any of the five say it; None for a dash."""
    cell = re.sub(r"\\num\{([^}]*)\}", r"\1", cell).replace(r"\,\%", "").replace(" %", "").strip()
    if cell in ("-", "--", DASH, ""):
        return None
    power = re.fullmatch(r"(.*)·10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+)", cell)
    if power:
        cell = f"{power[1]}e{power[2].translate(str.maketrans('⁻⁰¹²³⁴⁵⁶⁷⁸⁹', '-0123456789'))}"
    return {"nan": math.nan, r"$\infty$": math.inf, r"$-\infty$": -math.inf}.get(cell) or float(cell)


FINITE = st.floats(min_value=-1e12, max_value=1e12, allow_subnormal=False)
WORDS = st.text(st.characters(codec="ascii", exclude_categories=["Cc"]), min_size=1).map(
    lambda words: " ".join(words.split()) or "x"
)


@settings(deadline=None)  # the first imports rich
@given(rows=st.lists(st.tuples(WORDS, FINITE | st.none(), st.integers(0, 10**9)), max_size=4))
def test_five_ways_carry_the_same_cells(rows):
    """Words come back as they went in, numbers to the digits of their column."""
    columns = (Column("name", "name", words=True), Column("value", "value", digits=4), Column("count", "count"))
    drawn = table("", columns, rows)
    drawings = [markdown_rows(markdown(drawn)), html_rows(html(drawn)), latex_rows(latex([drawn]))]
    drawings.append([list(row.values()) for row in csv_rows(csv(drawn))])
    assert [len(drawing) for drawing in drawings] == [len(rows)] * 4
    for place, (name, value, count) in enumerate(rows):
        words = [drawing[place][0] for drawing in drawings]
        words[2] = unescaped_latex(words[2])
        assert {" ".join(re.sub(r" \N{MULTIPLICATION SIGN}(?= \d|$)", " x", word).split()) for word in words} == {name}
        for cells in (drawing[place] for drawing in drawings):
            shown = as_number(cells[1])
            assert shown is None if value is None else shown == pytest.approx(value, rel=1e-3)
            assert int(as_number(cells[2])) == count
    assert all(str(count) in text(drawn) for _, _, count in rows)


@pytest.mark.parametrize("words", HARD)
def test_what_means_something_to_a_format_is_escaped(words):
    drawn = table(words, (Column("a", words, words=True), Column("b", "b")), [(words, 1), ("second", 2)])
    flat = " ".join(words.split())
    (first, _), (second, _) = markdown_rows(markdown(drawn))
    assert (first, second) == (flat, "second")
    parser = _Cells()
    parser.feed(html(drawn))
    assert parser.tags == {"div", "table", "caption", "thead", "tbody", "tr", "th", "td"}
    assert parser.rows[1][0].replace("\N{MULTIPLICATION SIGN}", "x") == words
    (cell, _), _ = latex_rows(latex([drawn]))
    assert unescaped_latex(cell) == flat
    assert not re.search(r"(?<!\\)[_%#&~^<>\"]", cell)
    cell = next(line for line in markdown(drawn).splitlines() if line.endswith("| 1 |")).removesuffix(" | 1 |")[2:]
    assert not re.search(r"(?<!\\)(\\\\)*[|`*_<&\[\]]", cell)
    assert csv_rows(csv(drawn))[0]["a"] == words
    assert flat.split()[0] in text(drawn)


def drawn_row(**values):
    return Table("title", COLUMNS, (Row(values),))


def test_values_are_written_by_their_column():
    row = drawn_row(
        name="a",
        time=Measured(12.345, 12.0, 13.0),
        rate=857.3,
        bias=-1.2345e-3,
        ends=Interval(1.0, 2.5),
        count=3,
        agrees=Verdict(False, "±1 %"),
    )
    cells = ["a", "12.3", "12..13", "857", "-0.123 %", "1..2.5", "3", "NO, ±1 %"]
    assert markdown_rows(markdown(row)) == [cells]
    assert re.split(r"  +", text(row).splitlines()[4].strip()) == cells
    assert html_rows(html(row)) == [["a", "12.3 12 … 13", "857", "-0.123 %", "1 … 2.5", "3", "NO, ±1 %"]]
    assert '<td class="bad">3</td><td class="bad">NO, ±1 %</td>' in html(row)
    assert latex_rows(latex([row])) == [
        [
            "a",
            r"$\num{12.35}_{-\num{0.35}}^{+\num{0.65}}$",
            r"\num{857}",
            r"\num{-0.123}\,\%",
            r"\num{1.00}--\num{2.50}",
            r"\num{3}",
            r"NO, $\pm$1 \%",
        ]
    ]
    (read,) = csv_rows(csv(row))
    assert (read["time"], read["time_low"], read["ends_high"], read["bias"]) == ("12.345", "12", "2.5", "-0.0012345")


def test_a_row_that_ends_early_says_why():
    """In the row where cells can be joined, below it elsewhere; a name alone is no row there."""
    rows = (Row({"name": "a", "time": Measured(1, 1, 1)}, "no <light>"), Row({"name": "b"}, "no_room", ("slow",)))
    drawn = Table("t", COLUMNS, rows)
    assert '<td class="words" colspan="5">no &lt;light&gt;</td>' in html(drawn)
    assert '<th scope="row" style="text-align:left">b <span class="quiet">(slow)</span></th>' in html(drawn)
    assert latex_rows(latex([drawn]))[1] == ["b (slow)", r"\multicolumn{6}{l}{no\_room}"]
    assert [row[0] for row in markdown_rows(markdown(drawn))] == ["a"]
    assert markdown(drawn).splitlines()[-3:] == ["- a: no \\<light>", "- b: slow", "- b: no\\_room"]
    assert text(drawn).splitlines()[-3:] == ["a: no <light>", "b: slow", "b: no_room"]
    assert [(row["reason"], row["remarks"]) for row in csv_rows(csv(drawn))] == [
        ("no <light>", ""),
        ("no_room", "slow"),
    ]


@pytest.mark.claim("latex-tables")
def test_latex_has_the_rules_of_booktabs_and_says_what_it_needs():
    columns = (Column("a", "name", words=True), Column("b", "time", "ms"))
    drawn = latex(
        [table("one_1", columns, [("a", 1)], explanation="to 4.0e-11"), table("two", columns, [("b", 2.5)])],
        comment=("why",),
    )
    assert drawn.splitlines() == [
        r"% Needs \usepackage{booktabs,siunitx}.",
        "% why",
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"name & time \\",
        r" & [ms] \\",
        r"\midrule",
        r"\multicolumn{2}{l}{\textit{one\_1}, to \num{4.0e-11}} \\",
        r"a & \num{1} \\",
        r"\addlinespace",
        r"\multicolumn{2}{l}{\textit{two}} \\",
        r"b & \num{2.50} \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]


@pytest.mark.claim("latex-tables")
def test_a_median_has_the_digits_of_its_quartiles():
    assert with_spread(12.347, 12.123, 12.903) == ("12.35", "0.22", "0.56")
    assert with_spread(144.4, 139.2, 153.7) == ("144.4", "5.2", "9.3")
    assert with_spread(140.0, 133.0, 171.0) == ("140", "7", "31")


def _wide(*, long: bool = False) -> Table:
    columns = (
        *words(name="method", how={"long": long}),
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


@pytest.mark.claim("tables-at-80-columns")
def test_sentences_are_wrapped_and_listed_where_they_are_too_many():
    from reports.tables.lists import kernel_list, method_list, scene_list

    for made in (scene_list, method_list, kernel_list):
        drawn = text(made(), width=80)
        assert max(map(len, drawn.splitlines())) <= 80
        assert "Left out" not in drawn
        for row in made().rows:  # nothing is lost, no word is broken
            for value in row.values.values():
                if isinstance(value, str):
                    assert all(word in drawn for word in value.split()), value
    assert "\nmin-max\n  what: epipolar slices" in text(method_list(), width=80)
