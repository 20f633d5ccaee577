# SPDX-License-Identifier: BSD-3-Clause
"""Claim: each verdict on a paper follows from the measured figure, in the direction of the paper's words.

`figures.json` has the figure of every claim as it was measured: claims are tested without their experiments.
"""

import json
from pathlib import Path

import pytest

from validation.papers.claims import (
    DIRECTIONS,
    EFFORTS,
    Claim,
    Figure,
    claims,
    experiments,
    judged,
    papers,
    verdict,
)

MEASURED = json.loads(Path(__file__).with_name("figures.json").read_text(encoding="utf-8"))
JUDGED = [claim for claim in claims() if claim.direction]


def key(claim: Claim) -> str:
    return f"{claim.paper}: {claim.item}"


def measured(claim: Claim) -> Figure:
    value = MEASURED[key(claim)]
    return tuple(value) if isinstance(value, list) else (value, value, value)


def claim(direction: str, limit: float | list[float], **more) -> Claim:
    return Claim("biri", "eq. 0", "words", "experiment", "figure", direction, limit=limit, **more)


@pytest.mark.claim("verdicts-are-computed")
@pytest.mark.parametrize("each", JUDGED, ids=key)
def test_a_change_of_the_figure_changes_the_verdict(each):
    """A verdict that half, double and negative figures leave as it is, and the claim's own number, carries nothing."""
    figure = measured(each)
    own = (each.goal, each.goal, each.goal)
    scaled = [tuple(factor * end for end in figure) for factor in (0.5, 2, -1)]
    changed = {verdict(each, other) for other in (*scaled, own)}
    assert changed - {verdict(each, figure)}


def test_the_recorded_figures_are_those_of_the_claims():
    assert list(MEASURED) == [key(each) for each in JUDGED]


def test_every_claim_is_whole():
    assert {each.paper for each in claims()} == set(papers())
    assert len({key(each) for each in claims()}) == len(claims())
    assert {each.experiment for each in claims() if each.experiment} == set(experiments())
    assert {each.effort for each in experiments().values()} == set(EFFORTS)
    for each in claims():
        assert each.figure if each.experiment else each.why and not each.direction, each.item
        if each.direction:
            assert each.direction in DIRECTIONS
            assert (each.published is None) != (each.limit is None), each.item  # one number decides
            assert isinstance(each.limit, list) == (each.direction == "within")
            assert each.holds(each.goal) == (each.direction != "unequal")
            assert each.why, each.item


def test_what_the_paper_calls_far_from_accurate_is_reproduced_where_it_is():
    """Bouthors 2008, 2.2: the two verdicts on Henyey and Greenstein's function were inverted."""
    found = {each.item: verdict(each, measured(each)) for each in JUDGED if "Henyey-Greenstein" in each.item}
    assert found == {
        "2.2, Henyey-Greenstein, g = .99, 50 m": "reproduced",
        "2.2, Henyey-Greenstein, g of Mie, 300 m": "not reproduced",
    }


@pytest.mark.parametrize(
    ("each", "inside", "outside"),
    [
        (claim("at most", 2.0), (2.0, -9.0), (2.1,)),
        (claim("at least", 2.0), (2.0, 9.0), (1.9, -9.0)),
        (claim("equal", 2.0, tolerance=0.1), (1.81, 2.19), (1.79, 2.21, -2.0)),
        (claim("equal", 0.0, tolerance=0.1), (0.09, -0.09), (0.11,)),  # of 0 the tolerance is absolute
        (claim("unequal", 2.0, tolerance=0.1), (1.79, 2.21, -2.0), (1.81, 2.0)),
        (claim("within", [0.0, 5.0]), (0.0, 5.0), (-0.1, 5.1)),
    ],
)
def test_rules(each, inside, outside):
    assert {value: each.holds(value) for value in (*inside, *outside)} == {
        **dict.fromkeys(inside, True),
        **dict.fromkeys(outside, False),
    }


def test_an_interval_that_holds_both_answers_tells_nothing():
    each = claim("at most", 1.0)
    assert verdict(each, (0.9, 0.8, 0.99)) == "reproduced"
    assert verdict(each, (0.9, 0.8, 1.01)) == "impossible"
    assert verdict(each, (1.2, 1.1, 1.3)) == "not reproduced"
    assert verdict(claim("at most", 1.0, ours=True), (1.2, 1.1, 1.3)) == "differs"


def test_figures_are_divided_with_their_intervals_and_reasons_stay():
    each = Claim("biri", "eq. 0", "words", "experiment", "a / b", "at least", limit=3.0, unit="times", why="so")
    row = judged(each, {"a": [8.0, 6.0, 10.0], "b": [2.0, 1.0, 3.0]})
    assert (row["measured"], row["low"], row["high"], row["verdict"]) == (4.0, 2.0, 10.0, "impossible")
    assert row["why"] == "cannot be told apart, the figure lies between 2 and 10; at least 3: so"
    row = judged(each, {"a": "not measured: too slow", "b": 1.0})
    assert (row["measured"], row["verdict"], row["why"]) == (None, "impossible", "not measured: too slow")
    assert judged(each, {"a": float("inf"), "b": 1.0})["verdict"] == "impossible"
