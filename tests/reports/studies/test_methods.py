# SPDX-License-Identifier: BSD-3-Clause
"""Studies of methods and of their noise: what they measure, by command and from
Python, and their exit status.
"""

import json
import math

import numpy as np
import pytest

import airlight
from airlight.realtime.kernels.exact import exact
from airlight.realtime.methods.unshadowed import unshadowed
from airlight.reference.storage.files import temporary_folder
from airlight.reports.commands import main as cli
from airlight.validation.columns import record_of
from airlight.validation.timing import Scaling
from tests.helpers.api import TINY, brighter
from tests.helpers.reports import growth_record


def printed(capfd, *arguments, status=0):
    with temporary_folder() as folder:
        assert cli.run(["study", *arguments, "-o", str(folder / "study.json")]) == status
        capfd.readouterr()
        return json.loads((folder / "study.json").read_text())["result"]


def test_methods_are_measured_by_the_command(variant, capfd):
    rows = printed(capfd, "methods", "open-fog", "--method", "unshadowed", "--size", "16x12")[
        "rows"
    ]
    assert {(row["scene"], row["method"]) for row in rows} == {("open-fog", "unshadowed")}
    assert all(row["times"]["frame"]["median_ms"] > 0 for row in rows)


def test_python_gives_functions_and_configurations_and_gets_rows(variant):
    told = []
    table = airlight.study(
        "methods",
        airlight.load_scene("open-fog", TINY),
        method=[airlight.configuration("unshadowed", "taylor"), brighter],
        seconds=0.01,
        progress=lambda fraction, what: told.append(fraction),
    )
    taylor, own = table
    assert taylor.label == "unshadowed (taylor)"
    exact = airlight.reference("open-fog", size=TINY).airlight
    # Twice as bright: the error is the reference.
    assert own.error.relative_rmse == pytest.approx(
        np.sqrt(np.mean(exact**2)) / exact.mean(), rel=1e-5
    )
    assert own.error.relative_bias == pytest.approx(1.0, rel=1e-5)
    for row in table:
        assert row.scene == "open-fog"
        assert 0 < row.times.frame.low_ms <= row.times.frame.median_ms <= row.times.frame.high_ms
        assert row.reason is None
        assert row.error.nonfinite == row.error.negative == 0
    columns = table.columns()
    assert set(map(len, columns.values())) == {2}
    assert columns["kernel"] == ["taylor", "exact"]
    assert told == sorted(told)
    assert "unshadowed (taylor)" in table._repr_html_()
    with pytest.raises(airlight.InputError, match="did you mean 'unshadowed'"):
        airlight.study("methods", "open-fog", method="unshadow")
    with pytest.raises(airlight.InputError, match="did you mean 'open-fog'"):
        airlight.study("methods", ["open-fog", "openfog"], method="unshadowed", size=TINY)


@pytest.mark.claim("error-by-cause", tolerance="1e-5 of the largest error: rounding")
def test_errors_by_cause_are_printed_and_drawn(variant, capfd, tmp_path):
    """The parts add up to the whole; parameters are those that are set."""
    arguments = [
        "decomposition",
        "open-fog",
        "--method",
        "froxel-fog",
        "--set",
        "slices=9",
        "--set",
        "width=8",
    ]
    (scene,) = printed(capfd, *arguments, "--size", "16x12", "-o", str(tmp_path / "parts.png"))[
        "scenes"
    ]
    (entry,) = scene["methods"]
    assert (scene["size"], entry["parameters"]) == ([16, 12], {"slices": 9, "width": 8})
    assert sum(part["fraction"] for part in entry["parts"]) == pytest.approx(1, abs=1e-9)
    assert sum(part["relative_bias"] for part in entry["parts"]) == pytest.approx(
        entry["whole"]["relative_bias"], 1e-5
    )
    assert (tmp_path / "parts.png").stat().st_size > 10_000


def test_scaling_that_jumps_ends_with_1_and_is_drawn(variant, capfd, monkeypatch, tmp_path):
    arguments = [
        "scaling",
        "sphere-spot",
        "--kinds",
        "size",
        "--method",
        "unshadowed",
        "--size",
        "80x60",
    ]
    arguments += ["-o", str(tmp_path / "growth.png")]
    for jump, status in ((False, 0), (True, 1)):
        found = growth_record(cliff=jump) | {"scene": "sphere-spot", "run": None}
        monkeypatch.setattr(
            "airlight.validation.study.growth.study_growth",
            lambda *given, found=found, **options: [record_of(found, Scaling)],
        )
        assert printed(capfd, *arguments, status=status)["scaling"] == [found]
        assert (tmp_path / "growth.png").stat().st_size > 1000


def speckled(view, *, kernel=exact, bias=0.0):
    """All of the airlight, times a random number of each ray from 0 to 2."""
    return (1 + bias) * 2 * view.uniform()[0] * unshadowed(view, kernel=kernel)


speckled.noisy = True


@pytest.mark.claim("noise-methods")
def test_noise_and_bias_of_methods_are_told_apart(variant, tmp_path):
    runs = 24
    study = airlight.study(
        "noise",
        "open-fog",
        runs=runs,
        size=TINY,
        method=[airlight.configuration("unshadowed", "exact"), speckled],
    )
    still, noisy = (row.noise for row in study)
    reference = airlight.reference("open-fog", size=TINY).airlight.astype(np.float64)
    assert still.runs == 1
    assert still.variance.value == 0
    assert still.relative_rmse < 1e-5  # float32 beside the light
    assert math.isnan(still.low_fraction)
    # A number even in [0, 2] has the variance 1/3. All channels share it:
    # values are a third as many.
    variance = np.mean(reference**2) / reference.mean() ** 2 / 3
    assert noisy.runs == runs
    assert abs(noisy.variance.value - variance) < 4 * noisy.variance.error
    assert abs(noisy.bias.value) < 4 * noisy.bias.error
    assert abs(noisy.squared_bias.value) < 4 * noisy.squared_bias.error
    assert noisy.efficiency == pytest.approx(1 / (noisy.variance.value * noisy.seconds))
    assert study.to_dict()["rows"][0]["noise"]["low_fraction"] is None
    assert study.save(tmp_path / "noise.png").stat().st_size > 1000
    brighter = airlight.study(
        "noise", "open-fog", runs=runs, size=TINY, method=speckled, settings="bias=0.5"
    )[0].noise
    assert abs(brighter.bias.value - 0.5) < 4 * brighter.bias.error
    # The noise is that of the same random numbers, once and a half as large.
    assert math.sqrt(brighter.variance.value / noisy.variance.value) == pytest.approx(1.5, rel=1e-5)
    with pytest.raises(airlight.InputError, match="runs: got 1, expected at least two"):
        airlight.study("noise", "open-fog", runs=1, size=TINY)
