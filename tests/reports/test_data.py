# SPDX-License-Identifier: BSD-3-Clause
import copy
import json
from dataclasses import dataclass

import numpy as np
import pytest

from reports.data import _fastest, claims, measurement_data, plain
from validation.bench import Measurement
from validation.configurations import Configuration


def timing(median):
    return {"median_ms": median, "low_ms": 0.9 * median, "high_ms": 1.2 * median, "repetitions": 7}


def method(label, rmse, median, *, refused=None):
    """What a report says of a configuration, by hand."""
    if refused:
        return {"label": label, "refused": refused, "error": None, "times": None}
    times = {name: timing(median) for name in ("frame", "surface", "airlight", "rebuild")}
    return {"label": label, "refused": None, "error": {"relative_rmse": rmse}, "times": times}


def agreed(equivalent, detectable, *, layer="airlight", margin=0.005, estimator="volpath"):
    return {
        "estimator": estimator,
        "layer": layer,
        "statistics": {"equivalent": equivalent, "detectable_bias": detectable, "margin": margin},
    }


MULTIPLE = {"medium": {"value": 0.123, "interval": [0.12, 0.126]}, "everything": {"value": 0.2, "interval": [0.1, 0.3]}}

SCENES = [
    {
        "name": "fog",
        "agreement": {"airlight": agreed(True, 0.0031)},
        "multiple": MULTIPLE,
        "methods": [method("fast", 0.02, 1.0), method("good", 0.004, 2.0), method("slow", 0.0001, 8.0)],
    },
    {
        "name": "hall",
        "agreement": {"airlight": agreed(True, 0.0042), "surface": agreed(True, 0.0007, layer="surface")},
        "multiple": MULTIPLE,
        "methods": [method("fast", 0.2, 1.0), method("good", 0.005, 40.0), method("slow", 0.004, 80.0)],
    },
]


def scenes():
    return copy.deepcopy(SCENES)


def test_claims_on_a_truth_that_is_confirmed():
    trust, *fastest, left_out = claims(scenes())
    assert "confirmed by Mitsuba's volpath in 3 of 3 comparisons" in trust
    assert "±0.5 %" in trust
    assert "at worst 0.42 %" in trust
    assert "NOT" not in trust
    assert fastest == [
        "fog: the fastest method within 1 % relative RMSE is good: 2 ms a frame (500 frames/s).",
        "hall: the fastest method within 1 % relative RMSE is good: 40 ms a frame (25 frames/s).",
        "fog: the fastest method within 0.1 % relative RMSE is slow: 8 ms a frame (125 frames/s).",
        "hall: no method reaches a relative RMSE of 0.1 %.",
    ]
    assert left_out.endswith("The share of the airlight that this leaves out: fog 12 %; hall 12 %.")


def test_each_estimator_that_checked_the_truth_has_a_sentence():
    data = scenes()
    data[0]["agreement"]["single-scatter airlight"] = agreed(False, 1e-4, margin=5e-4, estimator="single-scatter")
    trust = claims(data)[0]
    assert "confirmed by Mitsuba's volpath in 3 of 3 comparisons" in trust
    assert "NOT confirmed within 0.05 % by our own Mitsuba integrator in fog (airlight)" in trust


def test_claims_on_a_truth_that_is_not_confirmed():
    data = scenes()
    data[1]["agreement"]["surface"]["statistics"]["equivalent"] = False
    trust = claims(data)[0]
    assert "NOT confirmed within 0.5 % by Mitsuba's volpath in hall (surface)" in trust
    assert "fog" not in trust


def test_claims_when_equivalence_could_not_be_decided():
    """None (a black layer, no variance) is not a yes."""
    data = scenes()
    data[0]["agreement"]["airlight"]["statistics"] = {"equivalent": None, "detectable_bias": None, "margin": 0.005}
    assert "NOT confirmed" in claims(data)[0]
    assert "fog (airlight)" in claims(data)[0]


def test_claims_without_any_comparison_confirm_nothing():
    """A scene that is black has no layer to compare."""
    data = scenes()
    for scene in data:
        scene["agreement"] = {}
    trust = claims(data)[0]
    assert trust.startswith("There is no light to compare with Mitsuba's volpath")


def test_refused_methods_are_named_and_do_not_win():
    data = scenes()
    data[0]["methods"].insert(0, method("taylor", None, 0.0, refused="no series"))
    sentences = claims(data)
    assert sentences[-1] == "Refused, with the reason in the tables: taylor in fog."
    assert not any("method within" in one and "taylor" in one for one in sentences)


def test_claims_on_nothing():
    assert claims([]) == []


def test_fastest_passes_over_methods_without_an_error():
    """A black truth has no relative error; nor has what was refused."""
    scene = {
        "name": "x",
        "methods": [method("none", None, 0.1), method("no", 0, 0, refused="x"), method("best", 0.009, 3.0)],
    }
    assert _fastest(scene, 0.01).startswith("x: the fastest method within 1 % relative RMSE is best: 3 ms")
    scene["methods"].pop()
    assert _fastest(scene, 0.01) == "x: no method reaches a relative RMSE of 1 %."
    assert _fastest({"name": "x", "methods": []}, 0.01) == "x: no method reaches a relative RMSE of 1 %."


def test_error_of_just_the_target_counts():
    scene = {"name": "x", "methods": [method("edge", 0.01, 3.0)]}
    assert "is edge" in _fastest(scene, 0.01)


def test_claims_never_name_a_method_with_nonfinite_pixels():
    """Its RMSE leaves out the very pixels that are wrong."""
    data = scenes()[:1]
    for one in data[0]["methods"]:
        one["error"]["nonfinite"] = 0
    data[0]["methods"][1]["error"]["nonfinite"] = 3
    assert "is slow" in _fastest(data[0], 0.01)


@dataclass(frozen=True)
class Sample:
    number: float
    pair: tuple


def test_plain_makes_what_json_can_hold():
    given = {
        "sample": Sample(np.float64(0.5), (np.int64(3), np.float32(0.25))),
        1: [np.bool_(True), None, "word", float("nan"), float("-inf"), np.float32("inf")],
    }
    found = plain(given)
    assert json.loads(json.dumps(found, allow_nan=False)) == {
        "sample": {"number": 0.5, "pair": [3, 0.25]},
        "1": [True, None, "word", None, None, None],
    }


def test_refused_measurement_has_every_entry():
    refused = Measurement(Configuration("unshadowed", "taylor"), None, None, None, None, refused="no series")
    data = measurement_data(refused)
    assert (data["label"], data["refused"]) == ("unshadowed (taylor)", "no series")
    assert data["times"] is data["error"] is data["surface_error"] is None
    assert data["files"] == {}
    assert data["knows_shadows"] is False
    json.dumps(data, allow_nan=False)


@pytest.mark.parametrize("airlight", [np.zeros((2, 3, 3)), np.full((2, 3, 3), np.inf)])
def test_scene_without_light_that_is_finite_has_no_numbers_rather_than_nan(airlight):
    from types import SimpleNamespace

    from reference.quadrature import TruthImage
    from reports.data import scene_data
    from tests.validation.test_bench import PLAN
    from validation.load import LoadedScene
    from validation.multiple import MultipleScattering, Share
    from validation.study import SceneStudy

    truth = TruthImage(
        airlight, np.zeros_like(airlight), np.zeros_like(airlight), np.ones((2, 3)), np.ones((2, 3)), 0, float("nan")
    )
    multiple = MultipleScattering(Share(0.0, (0.0, 0.0)), Share(0.0, (0.0, 0.0)), 64, 32, 16)
    study = SceneStudy(LoadedScene("x", SimpleNamespace(), "p", ""), PLAN, truth, {}, multiple, ())
    data = scene_data(study)
    json.dumps(data, allow_nan=False)
    assert data["size"] == [3, 2]
    assert data["truth"]["relative_bound"] is None
