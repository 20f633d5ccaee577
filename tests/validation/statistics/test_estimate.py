# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what is not known answers no question, and is not taken for zero or for true."""

import math

import pytest

from airlight.validation.statistics.estimate import UNKNOWN, Answer, Estimate, fact

YES, NO, WHO_KNOWS = Answer.YES, Answer.NO, Answer.UNKNOWN


@pytest.mark.parametrize(
    ("estimate", "limit", "answer"),
    [
        (Estimate(1.0, 0.2), 0.5, YES),
        (Estimate(1.0, 0.2), 0.9, WHO_KNOWS),  # two errors are 0.4
        (Estimate(1.0, 0.2, "proven"), 0.9, WHO_KNOWS),  # a bound is 0.2
        (Estimate(1.0, 0.2, "proven"), 0.7, YES),
        (Estimate(1.0, 0.2, "estimated"), 0.7, YES),
        (Estimate(1.0, 0.2), 1.4, NO),
        (Estimate(1.0, 0.2), 1.5, NO),
        (fact(1.0), 1.0, NO),
        (Estimate(1.0), 0.5, WHO_KNOWS),
        (UNKNOWN, 0.0, WHO_KNOWS),
        (Estimate(math.nan, 0.1), 0.0, WHO_KNOWS),
        (Estimate(1.0, math.inf), 0.0, WHO_KNOWS),
    ],
)
def test_a_number_exceeds_a_limit_with_its_interval(estimate, limit, answer):
    assert estimate.exceeds(limit) is answer


@pytest.mark.parametrize(
    ("estimate", "margin", "answer"),
    [
        (Estimate(0.1, 0.05), 0.3, YES),
        (Estimate(-0.1, 0.05), 0.3, YES),
        (Estimate(0.1, 0.2), 0.3, WHO_KNOWS),
        (Estimate(-0.9, 0.2), 0.3, NO),
        (Estimate(0.0, 2.0), 0.3, WHO_KNOWS),  # the interval holds all of the margin
        (Estimate(0.0), 0.3, WHO_KNOWS),
        (UNKNOWN, 0.3, WHO_KNOWS),
        (fact(0.0), 0.0, YES),
    ],
)
def test_a_number_is_within_a_margin_with_its_interval(estimate, margin, answer):
    assert estimate.within(margin) is answer


def test_more_errors_are_asked_of_statistics_alone():
    assert Estimate(1.0, 0.2).exceeds(0.5, errors=4) is WHO_KNOWS
    assert Estimate(1.0, 0.2, "proven").exceeds(0.5, errors=4) is YES


def test_an_answer_has_no_truth():
    with pytest.raises(TypeError, match="compare it with Answer"):
        assert Estimate(1.0).within(2.0)


def test_an_error_that_is_not_known_is_said():
    assert Estimate(0.1234567).percent() == "12.35 % (its error is unknown)"
    assert Estimate(0.5, 0.012).percent() == "50 +- 1.2 %"
    assert UNKNOWN.percent() == "unknown"
