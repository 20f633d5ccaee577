# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a verdict is computed from the published and the measured figure by the rule of its row."""

import math

import pytest

from validation.fidelity.row import VERDICTS, AtLeast, AtMost, Bound, Equal, NotMeasured, Row, Spread, judge


def row(figure, rule, published=10.0):
    return Row("biri", "eq. 1", "words", published, "nothing", lambda evidence: figure, rule, unit="m")


@pytest.mark.claim("verdicts-are-computed", tolerance="by hand")
@pytest.mark.parametrize(
    ("rule", "measured", "verdict"),
    [
        (Equal(0.1, "so"), 10.9, "reproduced"),
        (Equal(0.1, "so"), 11.1, "refuted"),
        (Equal(0.1, "so", "differs"), 8.9, "differs"),
        (Equal(0, "so"), 10.0, "reproduced"),
        (AtMost("so"), 10.0, "reproduced"),
        (AtMost("so"), 10.1, "refuted"),
        (AtLeast("so"), 10.0, "reproduced"),
        (AtLeast("so", "differs"), 9.9, "differs"),
    ],
)
def test_a_rule_decides(rule, measured, verdict):
    judged = judge(row(measured, rule), {})
    assert (judged["verdict"], judged["measured"], judged["published"]) == (verdict, measured, 10.0)
    assert judged["why"].startswith("wanted ")
    assert judged["why"].endswith(": so")
    assert judged["command"] == "airlight fidelity --paper biri"
    assert judged["verdict"] in VERDICTS


def test_a_spread_on_both_sides_of_the_bound_decides_nothing():
    judged = judge(row(Spread(11.0, 9.0, 12.0), AtLeast("so")), {})
    assert (judged["verdict"], judged["measured"]) == ("impossible", 11.0)
    assert judged["why"] == "cannot be told apart: the measured figure lies between 9 and 12"
    assert judge(row(Spread(11.0, 10.5, 12.0), AtLeast("so")), {})["verdict"] == "reproduced"
    assert judge(row(Spread(8.0, 7.0, 9.0), AtLeast("so")), {})["verdict"] == "refuted"


def test_what_was_not_measured_is_impossible_with_its_reason():
    judged = judge(row(NotMeasured("no such card"), None, None), {})
    assert (judged["verdict"], judged["measured"], judged["why"]) == ("impossible", None, "no such card")


@pytest.mark.parametrize("value", [math.inf, math.nan])
def test_a_figure_that_is_not_finite_decides_nothing(value):
    judged = judge(row(value, AtMost("so")), {})
    assert (judged["verdict"], judged["measured"]) == ("impossible", None)


def test_a_number_read_out_of_words_is_not_published():
    judged = judge(row(3.0, AtMost("so"), Bound(2.0)), {})
    assert (judged["published"], judged["verdict"], judged["why"]) == (None, "refuted", "wanted at most 2: so")
