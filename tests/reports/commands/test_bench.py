# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench` prints the table that is asked for, ends with its status, and drops no option in silence."""

import json

import numpy as np
import pytest

import validation.estimates.agreement
from reference.storage.exr import read_exr
from reports.commands import main as cli
from tests.helpers.reports import agreement


def printed(capfd, *arguments, status=0):
    assert cli.run(["bench", *arguments, "--json"]) == status
    return json.loads(capfd.readouterr().out)


def test_methods_are_measured_and_an_unconfirmed_truth_ends_with_1(variant, capfd, monkeypatch):
    asked = []

    def agreements(scene, margins, **options):
        asked.append(dict(margins))
        return {"volpath airlight": agreement(False)}

    monkeypatch.setattr(validation.estimates.agreement, "agreements", agreements)
    arguments = ["open-fog", "--method", "unshadowed", "--size", "16x12", "--margin", "0.002"]
    (scene,) = printed(capfd, *arguments, status=1)["scenes"]
    assert asked == [{"single-scatter": 0.0005, "volpath": 0.002}]  # the margin is that of volpath alone
    assert {entry["method"] for entry in scene["methods"]} == {"unshadowed"}
    assert all(entry["times"]["frame"]["median_ms"] > 0 for entry in scene["methods"])


@pytest.mark.claim("error-by-cause", tolerance="1e-5 of the largest error: the format's 32 bits")
def test_errors_by_cause_are_printed_and_drawn(variant, capfd, tmp_path):
    """The parts add up to the whole, in the numbers and in the images; parameters are those that are set."""
    arguments = ["open-fog", "--decompose", "--method", "froxel-fog", "--set", "slices=9", "--set", "width=8"]
    (scene,) = printed(capfd, *arguments, "--size", "16x12", "-o", str(tmp_path))["scenes"]
    (entry,) = scene["methods"]
    assert (scene["size"], entry["parameters"]) == ([16, 12], {"slices": 9, "width": 8})
    assert sum(part["share"] for part in entry["parts"]) == pytest.approx(1, abs=1e-9)
    layers = read_exr(tmp_path / "open-fog" / "decomposition-0.exr").layers
    parts = [layers["error-" + part["cause"].replace(" ", "-")] for part in entry["parts"]]
    error = np.asarray(layers["image"], dtype=float) - layers["truth"]
    np.testing.assert_allclose(np.sum(parts, axis=0), error, atol=1e-5 * np.abs(error).max())
    assert (tmp_path / "open-fog" / "decomposition.png").stat().st_size > 10_000


@pytest.mark.claim("kernels-are-named-by-kernel")
def test_kernels_are_named_by_an_option(variant, capfd, monkeypatch):
    asked = []

    def bench_kernels(names, **options):
        asked.append(names)
        return {"costs": [], "levels": []}

    monkeypatch.setattr("validation.kernels.benchmark.bench_kernels", bench_kernels)
    assert printed(capfd, "--kernels", "--kernel", "exact", "--kernel", "taylor-8")["kernels"] == {
        "costs": [],
        "levels": [],
    }
    printed(capfd, "--kernels")
    assert asked == [["exact", "taylor-8"], None]


def test_scaling_that_grows_more_steeply_than_before_ends_with_1(variant, capfd, monkeypatch, tmp_path):
    from tests.helpers.reports import growth_record

    monkeypatch.setattr("validation.study.growth.study_scaling", lambda *given, **options: [growth_record()])
    monkeypatch.setattr("reports.report.others.scaling_data", lambda name, size, found: found)
    before = tmp_path / "before.json"
    arguments = ["sphere-spot", "--scaling", "size", "--method", "unshadowed", "--against", str(before)]
    for exponent, status in ((0.47, 0), (0.1, 1)):
        before.write_text(json.dumps({"scaling": [growth_record(exponent=exponent)]}))
        assert printed(capfd, *arguments, status=status)["scaling"] == [growth_record()]
