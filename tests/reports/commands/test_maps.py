# SPDX-License-Identifier: BSD-3-Clause
import json

import pytest

from reports.commands import main as cli
from reports.commands.maps import parse_map_sizes


def test_command_prints_errors_with_their_slope(variant, capfd):
    arguments = ["maps", "omni-box", "--size", "32x24", "--sizes", "64,256,128"]
    assert cli.run([*arguments, "--json"]) == 0
    printed = json.loads(capfd.readouterr().out)
    (scene,) = printed["scenes"]
    errors = scene["errors"]
    assert (scene["name"], scene["method"]) == ("omni-box", "light-volumes (exact)")
    assert errors["sizes"] == [64, 128, 256]
    rmse = [metrics["relative_rmse"] for metrics in errors["metrics"]]
    assert rmse[0] > rmse[1] > rmse[2] > 0
    # 1.5 by corners of outlines; a map of 64 texels resolves few of these, and 768 pixels scatter.
    assert 1.2 < errors["slope"]["order"] < 2.2
    assert scene["flicker"] is None
    assert cli.run([*arguments, "--markdown"]) == 0
    out = capfd.readouterr().out
    assert "**omni-box, 32 x 24, light-volumes (exact): error**" in out
    assert f"The relative RMSE falls as size^-{errors['slope']['order']:.2f} +- " in out


def test_command_measures_the_flicker_of_another_method(variant, capfd):
    arguments = ["maps", "omni-box", "--size", "16x12", "--sizes", "16,32", "--flicker", "--frames", "2"]
    march = ["--method", "ray-march", "--set", "shadow=map", "--set", "steps=16"]
    assert cli.run([*arguments, *march, "--json"]) == 0
    (scene,) = json.loads(capfd.readouterr().out)["scenes"]
    assert scene["method"] == "ray-march (shadow=map, steps=16)"
    assert scene["flicker"]["sizes"] == [16, 32]
    assert all(value > 0 for value in scene["flicker"]["flicker"])
    assert scene["flicker"]["truth_change"] > 0


def test_a_scene_without_shadows_has_no_slope(variant, capfd):
    assert cli.run(["maps", "open-fog", "--size", "16x12", "--sizes", "16,32"]) == 0
    assert "The relative RMSE does not depend on the size." in capfd.readouterr().out


def test_sizes_are_read_in_ascending_order():
    assert parse_map_sizes("--sizes", "128,16,128") == [16, 128]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--sizes", "a"], "--sizes: got 'a', wanted sizes in texels, for example 128,256,512"),
        (["--sizes", "12"], "map: got 12, wanted a power of two"),
        (["--method", "unshadowed"], "got a parameter 'map'"),
        (["--set", "map=64"], "--set: got map=64, wanted it in --sizes"),
    ],
)
def test_wrong_options_are_refused(variant, arguments, words, capfd):
    assert cli.run(["maps", "omni-box", "--size", "8x8", *arguments]) == cli.WRONG_INPUT
    assert words in capfd.readouterr().err


@pytest.mark.claim("own-method-process")
def test_a_method_of_ones_own_that_ends_its_process_is_one_line(variant, capfd, tmp_path, monkeypatch):
    (tmp_path / "ending.py").write_text(
        "import os\nfrom dataclasses import replace\nfrom realtime.methods.registry import METHODS\n"
        "def render(view, state, lists, *, kernel, parameters):\n    os.abort()\n"
        "OWN = replace(METHODS['light-volumes'], name='ending', render=render)\n"
    )
    monkeypatch.chdir(tmp_path)
    arguments = ["maps", "sphere-spot", "--size", "16x12", "--sizes", "16", "--method", "ending:OWN", "--json"]
    assert cli.run(arguments) == 2
    out, err = capfd.readouterr()
    assert out == ""
    assert "method ending:OWN: ended its process, killed by SIGABRT" in err
