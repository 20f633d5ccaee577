# SPDX-License-Identifier: BSD-3-Clause
"""Each sentence at the top of a report follows from its numbers: which there are,
and what they say is good.
"""

import copy

import pytest

from airlight.reports.data.records import Claim
from airlight.reports.report import claims as made
from airlight.validation.timing import Scaling
from tests.helpers.reports import (
    RUN,
    agreement,
    checked,
    engine,
    entry,
    errors,
    flip,
    growth_record,
    record_of,
    report_of,
    scene,
)
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
        agreement={
            "airlight": agreed(True, 0.0042),
            "surface": agreed(True, 0.0007, layer="surface"),
        },
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
    assert (
        "The fraction of the airlight that this leaves out: fog 12 %; hall 12 %."
        in texts(scenes())[1]
    )
    assert claims([]) == []
    data = scenes()
    data[1]["agreement"]["airlight"] = agreed(True, 0.0042, margin=0.0125)
    assert (
        "fills most of its margin, 20 %, is +0..+0.1 %, in fog (airlight, ±0.5 %)."
        in texts(data)[0]
    )


@pytest.mark.claim("claims-follow")
def test_claims_on_a_reference_that_is_not_confirmed():
    data = scenes()
    data[1]["agreement"]["surface"]["statistics"]["equivalent"] = False
    trust = texts(data)[0]
    assert "NOT confirmed by Mitsuba's volpath in hall (surface, ±0.5 %)" in trust
    assert "fog" not in trust


def test_scenes_that_volpath_did_not_check_are_named():
    data = scenes()
    data[1]["agreement"] = {"airlight": agreed(True, 0.004, estimator="single-scatter")}
    assert "Mitsuba's volpath did not check the reference in hall." in texts(data)


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
    # Where nothing was decided, nothing is called confirmed.
    only = claims([scene("hall", [], agreement={"airlight": out_of_time([-0.01, 0.004])})])[0]
    assert only.good is None
    assert only.text.startswith(
        "By Mitsuba's volpath it is not decided within the time in hall (airlight, ±0.5 %)"
    )


def test_the_interval_of_batch_means_counts_where_it_reaches_farther():
    """Both intervals must lie inside the margin, and only that of pixels was shown."""
    data = scenes()
    statistics = data[1]["agreement"]["airlight"]["statistics"]
    statistics["relative_bias_ci_batches"] = [-0.004, 0.002]
    said = "fills most of its margin, 80 %, is -0.4..+0.2 %, in hall (airlight, ±0.5 %)."
    assert said in texts(data)[0]
    # Out of time, an interval that overlaps the margin decides nothing.
    outside = out_of_time([0.006, 0.02])
    for batches, good in ((None, False), ([0.004, 0.022], None)):
        outside["statistics"]["relative_bias_ci_batches"] = batches
        only = claims([scene("hall", [], agreement={"airlight": outside})])[0]
        assert only.good is good


def test_what_failed_is_named_with_its_pixels():
    data = scenes()
    data[0]["methods"][0]["error"] |= {"nonfinite": 3, "negative": 2}
    data[1]["reference"]["left"] = 7
    failed = [claim for claim in claims(data) if claim.kind == "failed"]
    assert [claim.good for claim in failed] == [False] * 3
    assert all(
        words in claim.text
        for words, claim in zip(("fast in fog (3", "fast in fog (2", "hall (7)"), failed)
    )


@pytest.mark.claim("times-of-one-run", "claims-follow")
def test_a_machine_that_changed_while_a_scene_was_timed_is_named():
    data = scenes()
    assert "machine" not in texts(data)[-1]
    for row in data[1]["methods"]:
        row["times"]["run"] = RUN | {
            "started": "2026-11-22 07:00:00 +0000",
            "steady": False,
            "between": 1.7,
        }
    assert texts(data)[-1] == (
        "The times of a scene are of one run, in which its methods took turns: between 2026-11-21 "
        "12:00:00 +0000 and "
        "2026-11-22 07:00:00 +0000. The machine changed meanwhile, so that ratios count there, and "
        "no milliseconds: "
        "hall (1.70 times between rounds, 1.02 within one)."
    )


@pytest.mark.claim("claims-follow")
def test_what_was_refused_and_what_was_left_out_for_its_time_are_named_apart():
    data = scenes()
    data[0]["methods"].append(refused_entry("picky", "no series"))
    data[1]["methods"] += [
        refused_entry("picky", "no series"),
        refused_entry("slow", "one hour", status="left out"),
    ]
    assert [claim.kind for claim in claims(data)] == [
        "reference",
        "left-out",
        "refused",
        "not-measured",
        "times",
    ]
    assert texts(data)[2:4] == [
        "Refused, with the reason in the tables: picky in fog; picky in hall.",
        "Not measured for the time that they take, with the reason in the tables: slow in hall.",
    ]


def test_scenes_that_an_effort_leaves_out_are_named():
    assert made.unstudied(["fog", "hall"], ["hall", "fog"]) == []
    (claim,) = made.unstudied(["hall"], ["fog", "hall", "pens"])
    assert claim.text == (
        "Scenes not studied, for the time that they take: fog, pens. A scene that is named is "
        "studied, `--full` has "
        "all."
    )


@pytest.mark.claim("claims-follow")
def test_a_time_that_jumps_as_the_work_grows_is_bad_and_none_is_good():
    calm, jumps = (record_of(growth_record(cliff=cliff), Scaling) for cliff in (False, True))
    assert made.growth_claims([]) == []
    said = "No time of a frame of hall jumps as the work grows: triangles."
    assert made.growth_claims([calm]) == [Claim(kind="growth", text=said, good=True)]
    (claim,) = made.growth_claims([calm, jumps])
    assert claim.text.startswith(
        "A time jumps: hall, shadow-planes (exact): frame grows with the power 1.9"
    )
    assert claim.good is False


@pytest.mark.claim("claims-follow")
def test_without_light_nothing_is_confirmed_and_nothing_speaks_against_it():
    first = claims([scene("night", [], agreement={})])[0]
    assert (first.kind, first.good) == ("reference", None)
    assert "no airlight and no lit surface in any scene" in first.text


@pytest.mark.claim("claims-follow")
def test_an_engines_image_has_its_errors_and_what_they_are_of():
    data = scenes()
    data[0]["methods"] += [
        engine("unity", error=errors(0.123, relative_bias=-0.045)),
        engine("unreal", 0.02, layer="airlight"),
        engine("black", None),  # of a scene without light nothing is relative
    ]
    found = [claim.text for claim in claims(data) if claim.kind == "image"]
    assert found == [
        "The image unity of fog, judged by its total of airlight and surface: "
        "relative RMSE 12.3 %, relative bias -4.5 %.",
        "The image unreal of fog, judged by its airlight: relative RMSE 2 %, relative bias +0.2 %.",
    ]


def test_errors_that_a_paper_has_too_are_published_and_no_failures():
    data = scenes()
    wrong = errors(0.1, negative=1)
    data[0]["methods"] += [entry("biri (taylor)", error=wrong), entry("mine (exact)", error=wrong)]
    found = [
        (claim.kind, claim.text, claim.good) for claim in claims(data) if "negative" in claim.text
    ]
    assert found == [
        ("failed", "Images with negative values: mine (exact) in fog (1 pixel).", False),
        (
            "published",
            "As the papers have it, images with negative values: biri (taylor) in fog (1 pixel).",
            None,
        ),
    ]


def test_images_without_flip_are_counted_with_the_reason_of_the_first():
    data = scenes()
    data[0]["methods"][0]["flip"] = flip(0.1)
    assert not any("FLIP" in text for text in texts(data))
    data[0]["methods"][1]["flip"] = flip(None, "no package here")
    assert "No HDR-FLIP of 1 image; of good in fog: no package here." in texts(data)
    data[1]["methods"][1]["flip"] = flip(None, "another reason")
    assert "No HDR-FLIP of 2 images; of good in fog: no package here." in texts(data)


@pytest.mark.claim("own-method-faults")
def test_faults_of_user_methods_are_told_once_and_refusals_are_none():
    def row(method, reason, **changes):
        return refused_entry(method, reason, method=method, **{"kind": "function"} | changes)

    fault = "method mine.py:f: line 3: KeyError: 'x'"
    rows = [
        row("mine.py:f", fault),
        row("mine.py:f", fault),
        row("mine.py:g", "method mine.py:f: of another"),
        row("mine.py:h", "the medium has bounds"),
        row("ray-march", "method ray-march: no", kind="built-in"),
        entry("mine.py:i", method="mine.py:i", kind="function"),
    ]
    assert made.own_faults(checked(report_of([scene("fog", rows)])).scenes[0].methods) == [fault]
