# SPDX-License-Identifier: BSD-3-Clause
import math

import pytest

from reports.tables.latex import escape, number, table, with_quartiles


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.0, "$0$"),
        (1234.5, "$1230$"),
        (999.9, "$1000$"),
        (12.34, "$12.3$"),
        (0.00123, "$0.00123$"),
        (0.00099996, "$0.00100$"),
        (-4.56e-7, r"$-4.56\times10^{-7}$"),
        (8.9996e-5, r"$9.00\times10^{-5}$"),
        (123456.0, r"$1.23\times10^{5}$"),
        (None, "--"),
        (math.nan, "--"),
        (math.inf, r"$\infty$"),
    ],
)
def test_numbers(value, text):
    assert number(value) == text


@pytest.mark.claim("latex-tables")
def test_a_median_has_the_digits_of_its_quartiles():
    assert with_quartiles(12.347, 12.123, 12.903) == "$12.35_{-0.22}^{+0.56}$"
    assert with_quartiles(144.4, 139.2, 153.7) == "$144.4_{-5.2}^{+9.3}$"
    assert with_quartiles(140.0, 133.0, 171.0) == "$140_{-7}^{+31}$"
    assert with_quartiles(None, 1.0, 2.0) == "--"


def test_what_means_something_to_latex_is_escaped():
    assert escape(r"a_b & 50 % of {$x^2$} \n") == (r"a\_b \& 50 \% of \{\$x\textasciicircum{}2\$\} \textbackslash{}n")


@pytest.mark.claim("latex-tables")
def test_tables_have_the_rules_of_booktabs():
    text = table("lr", (("name", "[ms]"),), ["group", ("a", "$1$"), "other", ("b", "$2$")], comment=("why",))
    assert text.splitlines() == [
        "% why",
        r"\begin{tabular}{lr}",
        r"\toprule",
        r"name & [ms] \\",
        r"\midrule",
        r"\multicolumn{2}{l}{group} \\",
        r"a & $1$ \\",
        r"\addlinespace",
        r"\multicolumn{2}{l}{other} \\",
        r"b & $2$ \\",
        r"\bottomrule",
        r"\end{tabular}",
    ]
