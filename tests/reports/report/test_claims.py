# SPDX-License-Identifier: BSD-3-Clause
import copy

import pytest

from reports.report import claims as made
from tests.helpers.reports import RUN, agreement, checked, entry, report_of, scene
from tests.helpers.reports import refused as refused_entry


def method(label, rmse, median, *, refused=None):
    """The entry of a configuration in a report."""
    return refused_entry(label, refused) if refused else entry(label, rmse, median)


def agreed(equivalent, detectable, *, layer="airlight", margin=0.005, estimator="volpath"):
    return agreement(equivalent, estimator, layer=layer, detectable=detectable, margin=margin)


def claims(scenes):
    return made.claims(checked(report_of(scenes)).scenes)


def confirmed(scenes):
    return made.confirmed(checked(report_of(scenes)).scenes)


def texts(scenes):
    return [claim.text for claim in claims(scenes)]


SCENES = [
    scene(
        "fog",
        [method("fast", 0.02, 1.0), method("good", 0.004, 2.0), method("slow", 0.0001, 8.0)],
        agreement={"airlight": agreed(True, 0.0031)},
    ),
    scene(
        "hall",
        [method("fast", 0.2, 1.0), method("good", 0.005, 40.0), method("slow", 0.004, 80.0)],
        agreement={"airlight": agreed(True, 0.0042), "surface": agreed(True, 0.0007, layer="surface")},
    ),
]


def scenes():
    return copy.deepcopy(SCENES)


@pytest.mark.claim("claims-follow")
def test_claims_on_a_reference_that_is_confirmed():
    kinds = [("reference", True), ("left-out", None), ("times", None)]
    assert [(claim.kind, claim.good) for claim in claims(scenes())] == kinds
    assert "confirmed by Mitsuba's volpath in 3 of 3 comparisons" in texts(scenes())[0]
    # 0.123 of the airlight, which is the headline; 0.21 of everything, which is not.
    assert "The fraction of the airlight that this leaves out: fog 12 %; hall 12 %." in texts(scenes())[1]
    assert claims([]) == []
    data = scenes()
    data[1]["agreement"]["airlight"] = agreed(True, 0.0042, margin=0.0125)
    assert "fills most of its margin, 20 %, is +0..+0.1 %, in fog (airlight, ±0.5 %)." in texts(data)[0]


@pytest.mark.claim("claims-follow")
def test_claims_on_a_reference_that_is_not_confirmed():
    data = scenes()
    data[1]["agreement"]["surface"]["statistics"]["equivalent"] = False
    trust = texts(data)[0]
    assert "NOT confirmed by Mitsuba's volpath in hall (surface, ±0.5 %)" in trust
    assert "fog" not in trust


def out_of_time(interval):
    comparison = agreed(False, 0.02, margin=0.005)
    comparison["statistics"]["relative_bias_ci"] = interval
    return comparison | {"finished": False}


def test_out_of_time_is_neither_confirmed_nor_against_the_reference():
    data = scenes()
    data[1]["agreement"]["airlight"] = out_of_time([-0.01, 0.004])
    first = claims(data)[0]
    assert first.good is None
    assert "confirmed by Mitsuba's volpath in 2 of 3 comparisons" in first.text
    assert "not decided within the time in hall (airlight, ±0.5 %)" in first.text
    assert "is +0..+0.1 %, in fog (airlight, ±0.5 %)" in first.text  # of those that were decided
    # No other estimator says anything about the airlight of the hall.
    assert not confirmed(data)
    data[1]["agreement"]["single-scatter airlight"] = agreed(True, 1e-5, estimator="single-scatter")
    assert confirmed(data)


def test_what_failed_is_named_with_its_pixels():
    data = scenes()
    data[0]["methods"][0]["error"] |= {"nonfinite": 3, "negative": 2}
    data[1]["reference"]["left"] = 7
    failed = [claim for claim in claims(data) if claim.kind == "failed"]
    assert [claim.good for claim in failed] == [False] * 3
    assert all(words in claim.text for words, claim in zip(("fast in fog (3", "fast in fog (2", "hall (7)"), failed))


@pytest.mark.claim("times-of-one-run", "claims-follow")
def test_a_machine_that_changed_while_a_scene_was_timed_is_named():
    data = scenes()
    assert "machine" not in texts(data)[-1]
    for row in data[1]["methods"]:
        row["times"]["run"] = RUN | {"started": "2026-11-22 07:00:00 +0000", "steady": False, "between": 1.7}
    assert texts(data)[-1] == (
        "The times of a scene are of one run, in which its methods took turns: between 2026-11-21 12:00:00 +0000 and "
        "2026-11-22 07:00:00 +0000. The machine changed meanwhile, so that ratios count there, and no milliseconds: "
        "hall (1.70 times between rounds, 1.02 within one)."
    )
