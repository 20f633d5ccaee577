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


@pytest.mark.claim("error-by-cause", tolerance="1e-5 of the largest error: the format's 32 bits")
def test_errors_by_cause_are_printed_and_drawn(variant, capfd, tmp_path):
    import numpy as np

    from reference.storage.exr import read_exr

    arguments = ["bench", "colonnade", "--decompose", "--methods", "min-max,froxel-fog", "--size", "32x24"]
    assert cli.run([*arguments, "--json", "-o", str(tmp_path)]) == 0
    (scene,) = json.loads(capfd.readouterr().out)["scenes"]
    assert scene["size"] == [32, 24]
    for number, entry in enumerate(scene["methods"]):
        assert sum(part["share"] for part in entry["parts"]) == pytest.approx(1, abs=1e-9)
        layers = read_exr(tmp_path / "colonnade" / f"decomposition-{number}.exr").layers
        parts = [layers["error-" + part["cause"].replace(" ", "-")] for part in entry["parts"]]
        error = np.asarray(layers["image"], dtype=float) - layers["truth"]
        np.testing.assert_allclose(np.sum(parts, axis=0), error, atol=1e-5 * np.abs(error).max())
    assert (tmp_path / "colonnade" / "decomposition.png").stat().st_size > 10_000
    assert cli.run([*arguments, "--markdown"]) == 0
    printed = capfd.readouterr().out
    assert "| froxel-fog | whole | truth |" in printed
    assert "resolution | width=32, height=24 |" in printed


def test_a_folder_is_for_errors_by_cause_alone(capfd, tmp_path):
    assert cli.run(["bench", "open-fog", "-o", str(tmp_path)]) == 2
    assert "--output: got a folder without --decompose" in capfd.readouterr().err


def test_named_methods_are_benched_with_the_parameters_that_are_set(variant, capfd):
    arguments = ["bench", "open-fog", "--decompose", "--size", "16x12", "--json", "--methods", "froxel-fog"]
    assert cli.run([*arguments, "--set", "slices=9", "--set", "width=8"]) == 0
    (scene,) = json.loads(capfd.readouterr().out)["scenes"]
    assert [entry["parameters"] for entry in scene["methods"]] == [{"slices": 9, "width": 8}]
    assert cli.run([*arguments[:-2], "--set", "slices=9"]) == 2
    assert "--set: got no single method that it is for; name methods by --method" in capfd.readouterr().err
    assert cli.run([*arguments, "--set", "slice=9"]) == 2
    assert "did you mean 'slices'" in capfd.readouterr().err


def test_the_older_list_of_methods_means_the_same(variant, capfd):
    arguments = ["bench", "open-fog", "--decompose", "--size", "16x12", "--json", "--set", "width=8"]
    printed = []
    for words in (["--methods", "froxel-fog"], ["--method", "froxel-fog"]):
        assert cli.run([*arguments, *words]) == 0
        printed.append(json.loads(capfd.readouterr().out)["scenes"])
    assert printed[0] == printed[1]


@pytest.mark.claim("kernels-are-named-by-kernel")
@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["hall"], "got the scene 'hall', but kernels are timed without a scene: leave it out"),
        (["taylor-8"], "'taylor-8' is a kernel and stands where scenes stand: write --kernel taylor-8"),
        (["exact", "fog.py:mine"], "write --kernel exact --kernel fog.py:mine"),
    ],
)
def test_scenes_are_not_taken_for_kernels(capfd, arguments, words):
    assert cli.run(["bench", *arguments, "--kernels"]) == 2
    printed = capfd.readouterr().err
    assert words in printed
    assert printed.count("\n") == 1


@pytest.mark.claim("kernels-are-named-by-kernel")
def test_kernels_are_named_by_an_option(variant, capfd, monkeypatch):
    import validation.kernels.benchmark

    asked = []

    def bench_kernels(names, **options):
        asked.append(names)
        return {"costs": [], "levels": []}

    monkeypatch.setattr(validation.kernels.benchmark, "bench_kernels", bench_kernels)
    monkeypatch.setattr("validation.kernels.convergence.declared", lambda: [])
    for words in ([], ["--kernel", "exact"], ["--kernel", "exact,table", "--kernel", "taylor-8"]):
        assert cli.run(["bench", "--kernels", *words, "--json"]) == 0
    assert asked == [None, ["exact"], ["exact", "table", "taylor-8"]]


def test_scaling_is_compared_with_an_earlier_run(variant, capfd, tmp_path):
    """The earlier run's times did not grow at all: pixels cost more than that, however busy the machine."""
    flat = {"exponent": -1.0, "standard_error": 0.0, "steepest": 0.0, "at": 1.0, "cliff": False}
    arguments = ["bench", "sphere-spot", "--scaling", "size", "--size", "48x36", "--method", "ray-march", "--json"]
    assert cli.run(arguments) in (0, 1)
    data = json.loads(capfd.readouterr().out)
    for record in data["scaling"]:
        record["growth"] = dict.fromkeys(record["growth"], flat)
    earlier = tmp_path / "earlier.json"
    earlier.write_text(json.dumps(data))
    assert cli.run([*arguments, "--against", str(earlier)]) == 1
    assert "of the pixels, and did with -1" in capfd.readouterr().err
    for broken in ({}, {"scaling": []}, {"scaling": [7]}, {"scaling": [{"scene": "x"}]}, []):
        earlier.write_text(json.dumps(broken))
        assert cli.run([*arguments, "--against", str(earlier)]) == 2
        assert "it holds no `scaling`" in capfd.readouterr().err
    assert cli.run(["bench", "open-fog", "--against", str(earlier)]) == 2
    assert "--against: got a file without --scaling or --fit-octaves" in capfd.readouterr().err


def test_scaling_prints_steps_and_exponents(variant, capfd):
    arguments = ["bench", "sphere-spot", "--scaling", "size", "--size", "16x12", "--method", "unshadowed"]
    assert cli.run([*arguments, "--kernel", "taylor", "--json"]) in (0, 1)  # a busy machine may show a jump
    (record,) = json.loads(capfd.readouterr().out)["scaling"]
    assert [cost["work"] for cost in record["costs"]] == [8 * 6, 16 * 12, 32 * 24, 64 * 48]
    assert set(record["growth"]) == {"frame", "light_moved", "objects_moved"}
    assert all(cost["frame"]["median_ms"] > 0 for cost in record["costs"])
    assert cli.run(["bench", "open-fog", "--scaling", "size,speed"]) == 2
    assert "--scaling: got 'speed', wanted some of size,triangles,lights,media,map" in capfd.readouterr().err
    assert cli.run(["bench", "open-fog", "--scaling", "media"]) == 2
    assert "0 bounded media" in capfd.readouterr().err
