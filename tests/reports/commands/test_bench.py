# SPDX-License-Identifier: BSD-3-Clause
import json

import pytest

import validation.estimates.agreement
from reports.commands import main as cli


@pytest.mark.parametrize(("options", "expected"), [([], 0.01), (["--margin", "0.002"], 0.002)])
def test_the_margin_is_that_of_volpath_alone(variant, capfd, monkeypatch, options, expected):
    asked = []

    def agreements(scene, margins, **options):
        asked.append(dict(margins))
        options["progress"](0.5, "volpath")
        return {}

    monkeypatch.setattr(validation.estimates.agreement, "agreements", agreements)
    arguments = ["bench", "open-fog", "--methods", "unshadowed", "--size", "16x12", "--json"]
    assert cli.run([*arguments, *options]) == 0
    (scene,) = json.loads(capfd.readouterr().out)["scenes"]
    assert scene["agreement"] == {}
    assert {entry["method"] for entry in scene["methods"]} == {"unshadowed"}
    assert asked == [{"single-scatter": 0.0005, "volpath": expected}]


@pytest.mark.parametrize("margin", ["0", "1", "-0.1", "nan"])
def test_a_margin_that_is_none_is_refused_before_any_work(capfd, margin):
    assert cli.run(["bench", "open-fog", f"--margin={margin}"]) == 2
    assert f"--margin: got {float(margin):g}, wanted a share between 0 and 1" in capfd.readouterr().err
