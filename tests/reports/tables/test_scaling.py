# SPDX-License-Identifier: BSD-3-Clause
"""Tables of scaling hold every step and exponent, and a jump becomes a sentence."""

from reports.tables.drawing import markdown
from reports.tables.scaling import cliffs, grown, scaling_tables
from tests.helpers.reports import growth_record as record


def test_a_table_for_each_kind_and_one_of_exponents():
    costs, exponents = scaling_tables([record(cliff=True)])
    assert costs.title == "hall by triangles, 80 x 60"
    assert [row.values["work"] for row in costs.rows] == [100, 400]
    assert "71.5" in markdown(costs)
    drawn = markdown(exponents).splitlines()[-1]
    assert "0.47" in drawn
    assert drawn.endswith("| frame |")
    assert markdown(scaling_tables([record(cliff=False)])[1]).splitlines()[-1].endswith("| no |")


def test_who_refuses_is_named_and_has_no_exponent():
    costs, exponents = scaling_tables([record(cliff=False, works=(), refused="method x: no")])
    assert "refused: method x: no" in markdown(costs)
    assert exponents.rows == ()


def test_a_jump_is_a_sentence():
    (sentence,) = cliffs([record(cliff=True), record(cliff=False)])
    assert sentence == "hall, shadow-planes (exact): frame grows with the power 1.9 of the triangles up to 400"


def test_a_higher_power_than_before_is_a_sentence():
    old = [record(cliff=False)]
    assert grown(old, [record(cliff=False, exponent=0.66)]) == []
    sentences = grown(old, [record(cliff=False, exponent=0.69)])
    assert len(sentences) == 3  # one for each time
    assert sentences[0] == (
        "hall, shadow-planes (exact): frame grows with the power 0.69 of the triangles, and did with 0.47"
    )
    assert grown(old, [record(cliff=False, exponent=0.1)]) == []  # that is better
    assert grown(old, [record(cliff=False, exponent=0.9, size=(160, 120))]) == []  # another image
