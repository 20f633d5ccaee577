# SPDX-License-Identifier: BSD-3-Clause
"""`airlight advise`, and the method `auto`, which takes what it names."""

import json

import pytest

import airlight
from reports.commands.main import DONE, FAILED, WRONG_INPUT, run
from validation.advise.model import read_model

SMALL = ["--size", "32x24"]


def _advice(capsys, *arguments, status=DONE):
    assert run(["advise", *arguments, "--json"]) == status
    return json.loads(capsys.readouterr().out)


@pytest.mark.claim("advise-command", tolerance="none: the same method, kernel and parameters")
def test_auto_takes_what_advise_names(variant, capsys):
    advice = _advice(capsys, "sphere-spot", "--error", "1e-2", *SMALL)
    assert run(["render", "sphere-spot", "--method", "auto", "--set", "error=1e-2", *SMALL, "--json"]) == DONE
    printed = capsys.readouterr()
    best = advice["best"]
    assert advice["holds"]
    assert json.loads(printed.out)["method"].startswith(best["method"])
    assert "--method auto takes" in printed.err
    assert best["error_bound"] <= 1e-2
    frame = airlight.render("sphere-spot", "auto", size=(32, 24), error=1e-2)
    assert (frame.method, frame.kernel) == (best["method"], best["kernel"])


def test_json_has_the_names_of_the_page(variant, capsys):
    advice = _advice(capsys, "open-fog", "--error", "1e-2", *SMALL)
    names = {"scene", "error", "share", "holds", "best", "command", "candidates", "beyond", "fitted_to"}
    assert names == set(advice)
    assert len(advice["candidates"]) == len(read_model().configurations)
    assert advice["candidates"][0] == advice["best"]
    assert advice["command"].startswith("airlight render open-fog --method ")
    held = [each["cost_ms"] for each in advice["candidates"] if (each["error_bound"] or 1) <= advice["error"]]
    assert advice["best"]["cost_ms"] == min(held)


def test_an_error_that_none_holds_ends_with_1(variant, capsys):
    advice = _advice(capsys, "windows", "--error", "1e-9", *SMALL, status=FAILED)
    assert not advice["holds"]
    assert run(["advise", "windows", "--error", "1e-9", *SMALL]) == FAILED
    assert "none is predicted to hold 1e-09; the likeliest does" in capsys.readouterr().out


def test_a_method_that_refuses_says_why(variant, capsys, tmp_path):
    scene = tmp_path / "ball.xml"
    scene.write_text(
        """<scene version="3.0.0">
        <medium type="homogeneous" id="fog"><float name="sigma_t" value="0.13"/>
          <rgb name="albedo" value="0.9"/></medium>
        <sensor type="perspective"><ref name="medium" id="fog"/><float name="fov" value="43.1"/>
          <transform name="to_world"><lookat origin="0, -4, 1" target="0, 0, 0" up="0, 0, 1"/></transform>
          <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/></film></sensor>
        <emitter type="point"><point name="position" x="0.3" y="0.2" z="2.1"/>
          <rgb name="intensity" value="3"/></emitter>
        <shape type="sphere" id="ball"><float name="radius" value="0.5"/><bsdf type="diffuse"/></shape></scene>"""
    )
    advice = _advice(capsys, str(scene), "--error", "0.3")
    refused = {each["method"]: each["refused"] for each in advice["candidates"] if each["refused"]}
    assert set(refused) == {"shadow-planes"}
    assert "ball" in refused["shadow-planes"]
    assert run(["advise", str(scene), "--error", "0.3"]) == DONE
    assert "refuses because" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ([], "wanted a scene, or --fit with the folder of a sweep"),
        (["open-fog", "--error", "2"], "--error: got 2.0, wanted a relative RMSE between 0 and 1"),
        (["open-fog", "--share", "1"], "--share: got 1, wanted a share from 0.5 to below 1"),
        (["open-fog", "--model", "/nowhere.json"], "cannot read /nowhere.json"),
        (["--fit", "/nowhere"], "cannot read /nowhere"),
        (["--fit", "/nowhere", "--cost", "frame_s"], "--cost: got 'frame_s', wanted frame_ms or frame_cpu_ms"),
    ],
)
def test_what_cannot_be_asked_is_refused(arguments, words, capsys):
    assert run(["advise", *arguments]) == WRONG_INPUT
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--kernel", "taylor"], "got the kernel 'taylor'"),
        (["--set", "steps=16"], "got 'steps', wanted --set error=SHARE or nothing"),
        (["--set", "error=small"], "error: got small, wanted a relative RMSE"),
    ],
)
def test_auto_chooses_the_rest_itself(variant, arguments, words, capsys):
    assert run(["render", "open-fog", "--method", "auto", *arguments, *SMALL]) == WRONG_INPUT
    assert words in capsys.readouterr().err
