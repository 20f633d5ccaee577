# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare`: the margin decides the status, masks leave out, differences
are values and pictures.
"""

import json
import re
import shlex

import numpy as np
import pytest

import airlight
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.storage.build import build
from airlight.reference.storage.exr import Image, read_exr, write_exr
from airlight.reports.commands.main import run
from airlight.validation.scenes.loading import load_scene

SHAPE = (16, 20, 3)


@pytest.fixture
def files(tmp_path):
    """Write a reference with standard errors of 2 %, a test image that is 1
    % too bright, and a mask.
    """
    rng = np.random.default_rng(4)
    reference = rng.gamma(2.0, 0.3, SHAPE)
    error = 0.02 * reference
    layers = {"airlight": reference + error * rng.standard_normal(SHAPE), "airlight_se": error}
    mask = np.ones(SHAPE)
    mask[:2] = 0
    for name, image in (
        ("reference", Image(layers, attributes={"airlight:batches": 32})),
        ("test", Image({"airlight": 1.01 * reference})),
        ("mask", Image({"total": mask})),
    ):
        write_exr(tmp_path / f"{name}.exr", image)
    return [str(tmp_path / "reference.exr"), str(tmp_path / "test.exr")], str(tmp_path / "mask.exr")


def printed(capsys, *arguments, status=0):
    assert run(["compare", *arguments, "--json"]) == status
    return json.loads(capsys.readouterr().out)["result"]


@pytest.mark.claim("agreement-inside-the-margin", "exit-status")
def test_the_margin_decides(files, capsys):
    images, _ = files
    assert printed(capsys, *images, "--margin", "0.03")["statistics"]["equivalent"] is True
    assert (
        printed(capsys, *images, "--margin", "0.001", status=1)["statistics"]["equivalent"] is False
    )
    assert run(["compare", *images]) == 0


def test_text_and_json_name_the_errors_that_both_files_state(tmp_path, capsys):
    paths = []
    for name, kind, value in (("a", "proven", 2.0), ("b", "estimated", 2.02)):
        layers = {"airlight": np.full(SHAPE, value), "airlight_bound": np.full(SHAPE, 0.02)}
        paths.append(str(tmp_path / f"{name}.exr"))
        write_exr(tmp_path / f"{name}.exr", Image(layers, attributes={"airlight:bound": kind}))
    values = printed(capsys, *paths, "--margin", "0.05")["stated"]
    assert run(["compare", *paths, "--margin", "0.05"]) == 0
    text = capsys.readouterr().out
    for side in (values["reference"], values["test"]):
        assert f"{side['value']:.4g} +- {side['error']:.2g} W/(m^2 sr) ({side['kind']})" in text
    assert f"{100 * values['bias_error']:.4g} % at most ({values['kind']})" in text
    assert (values["margin"], values["equivalent"]) == (0.05, True)
    assert "+-5 %: inside" in text
    assert run(["compare", *paths, "--margin", "0.02"]) == 1


@pytest.mark.claim("engine-margin", "scenes-stand-first")
def test_a_scene_stands_in_place_of_the_reference(variant, tmp_path, capsys):
    """The reference is found at the size of the file; upside down it is
    suspected, and the margin decides.
    """
    path, difference = tmp_path / "open-fog.exr", tmp_path / "difference.exr"
    airlight = reference_image(load_scene("open-fog", (32, 24)).scene).airlight
    write_exr(path, Image({"airlight": airlight}))
    values = printed(capsys, "open-fog", str(path), "--margin", "1e-6", "-o", str(difference))
    assert (values["scene"], values["size"], values["hints"]["words"]) == ("open-fog", [32, 24], [])
    assert values["metrics"]["relative_rmse"] < 1e-6  # the file is float32
    assert np.abs(read_exr(difference).layers["relative"]).max() < 1e-5
    write_exr(path, Image({"total": airlight[::-1]}))
    turned = printed(capsys, "open-fog", str(path), "--margin", "1e-6")  # a turn moves no light
    assert any("upside down" in hint for hint in turned["hints"]["words"])
    write_exr(path, Image({"airlight": 1.01 * airlight}))
    printed(capsys, "open-fog", str(path), "--margin", "0.005", status=1)
    write_exr(path, Image({"airlight": airlight[:20]}))
    assert run(["compare", "open-fog", str(path)]) == 2
    assert "open-fog is 800 x 600, 1.333 to 1" in capsys.readouterr().err


def test_from_python_a_result_or_an_array_is_judged_against_a_scene(variant):
    exact = reference_image(load_scene("open-fog", (32, 24)).scene).airlight
    compared = airlight.compare("open-fog", 1.01 * exact, pixel="centre", margin=0.005)
    assert compared.metrics.relative_bias == pytest.approx(0.01, rel=1e-4)
    assert compared.metrics == compared.compared.comparison.metrics
    assert compared.status == 1
    # and no file that is gone
    assert compared.title == "airlight of the test image against open-fog"
    with pytest.raises(airlight.InputError, match=r"^the test image: 0 pixels"):
        airlight.compare("open-fog", np.full((24, 32, 3), np.nan), diagnose=True)
    with pytest.raises(
        airlight.InputError, match="under a mask that is an EXR file; save it first"
    ):
        airlight.compare("open-fog", exact, mask=np.ones((24, 32), bool))


@pytest.mark.claim("diagnosis-right")
def test_a_diagnosis_is_of_each_layer_and_its_text_has_the_words_of_its_data(
    variant, tmp_path, capsys
):
    """Both layers as they should be: no fault is looked for, which would take seconds."""
    path = str(airlight.reference("sphere-spot", size=(32, 24)).save(tmp_path / "spot.exr"))
    asked = ["sphere-spot", path, "--diagnose", "--pixel", "centre"]
    data = printed(capsys, *asked)
    assert [(each["layer"], each["first"]) for each in data["layers"]] == [
        ("airlight", "right"),
        ("surface", "right"),
    ]
    assert data["diagnosis"] == data["layers"][0]
    assert run(["compare", *asked]) == 0
    first, said, second, also = capsys.readouterr().out.splitlines()
    assert first.startswith(f"- {path}, airlight, against sphere-spot")
    assert second.startswith(f"- {path}, surface, against sphere-spot")
    for line, each in ((said, data["layers"][0]), (also, data["layers"][1])):
        assert line == f"- Nothing is wrong with it: {each['verdict']}."
    again = airlight.compare(
        "sphere-spot", airlight.reference("sphere-spot", size=(32, 24)), diagnose=True
    )
    assert [each.path for each in again.diagnoses] == [
        "sphere-spot, the reference by quadrature"
    ] * 2


@pytest.mark.claim("difference-image")
def test_a_difference_is_written_as_values_and_as_a_picture(files, tmp_path, capsys):
    from PIL import Image as Picture

    images, mask = files
    values, picture = tmp_path / "out" / "difference.exr", tmp_path / "difference.png"
    assert printed(capsys, *images, "-o", str(values), "--mask", mask)["difference"] == str(values)
    reference, test = (read_exr(path).layers["airlight"].astype(float) for path in images)
    layers = read_exr(values).layers
    assert read_exr(values).attributes["airlight:commit"] == build().commit
    np.testing.assert_allclose(layers["total"][2:], (test - reference)[2:], atol=1e-6)
    mean = reference[2:].mean()
    relative = (test - reference) / np.maximum(reference, 1e-3 * mean)
    np.testing.assert_allclose(layers["relative"][2:], relative[2:], rtol=1e-4, atol=1e-6)
    assert not layers["total"][:2].any()
    both = printed(capsys, *images, "-o", str(values), "-o", str(picture))
    assert both["differences"] == [str(values), str(picture)]
    shown = np.asarray(Picture.open(picture))
    assert shown.shape == SHAPE
    red, blue = shown[..., 0].astype(int), shown[..., 2].astype(int)
    brighter = (relative > 0.005).all(axis=-1)
    assert brighter.any()
    assert (red > blue)[brighter].all()


def test_the_command_and_python_find_the_fog_that_made_an_image(variant, tmp_path, capsys):
    path = tmp_path / "fog.exr"
    write_exr(
        path, Image({"airlight": reference_image(load_scene("open-fog", (32, 24)).scene).airlight})
    )
    arguments = ["open-fog", str(path), "--fit", "sigma_t=0.9,intensity"]
    data = printed(capsys, *arguments)
    assert {"parameters", "residual", "explained", "confounded"} <= set(data)
    sigma_t, intensity = data["parameters"]
    assert (sigma_t["name"], intensity["name"]) == ("sigma_t", "intensity")
    assert sigma_t["low"] < 0.173 < sigma_t["high"]
    assert sigma_t["value"] == pytest.approx(0.173, rel=1e-4)
    assert run(["compare", *arguments]) == 0
    assert "95 % interval" in capsys.readouterr().out
    fit = airlight.compare("open-fog", str(path), fit="sigma_t, intensity")
    assert fit["sigma_t"].value == pytest.approx(sigma_t["value"], rel=1e-4)
    assert "<table" in fit._repr_html_()
    with pytest.raises(airlight.InputError, match="did you mean"):
        airlight.compare("open-fog", str(path), fit=["albdo"])


@pytest.mark.parametrize("how", [[], ["--diagnose"], ["--fit", "sigma_t"]], ids=" ".join)
def test_a_changed_scene_is_described_and_judged_as_it_was_rendered(
    variant, tmp_path, monkeypatch, capsys, how
):
    """The command that `describe` prints has the change, and judges the image that has it."""
    monkeypatch.chdir(tmp_path)
    change = ["--change", "medium.sigma_t=0.3"]
    size = ["--size", "16x12"]
    assert run(["reference", "open-fog", *size, *change, "-o", "open-fog.exr"]) == 0
    capsys.readouterr()
    assert run(["describe", "open-fog", *size, *change]) == 0
    (line,) = (each for each in capsys.readouterr().out.splitlines() if "to judge it" in each)
    words = shlex.split(line.partition("airlight ")[2])
    assert words[-2:] == change
    assert run([*words, "--pixel", "centre", *how]) == 0
    said = capsys.readouterr().out
    assert "open-fog with medium.sigma_t=0.3" in said
    assert re.search(r"(verdict +|: )right: |sigma_t +0\.3 ", said), said
    assert run(["describe", "open-fog", *size, *change, "--json"]) == 0
    described = json.loads(capsys.readouterr().out)["result"]
    assert described["changes"] == ["medium.sigma_t=0.3"]
    assert described["medium"]["sigma_t"] == pytest.approx([0.3] * 3)


def test_two_images_have_no_scene_to_change(files, capsys):
    assert run(["compare", *files[0], "--change", "medium.sigma_t=0.3"]) == 2
    assert "two images have no scene; leave out change" in capsys.readouterr().err
