# SPDX-License-Identifier: BSD-3-Clause
import json

import numpy as np
import pytest

from reference.storage.exr import Image, read_exr, write_exr
from reports.commands.main import run

SHAPE = (16, 20, 3)


@pytest.fixture
def files(tmp_path):
    """Write a reference with standard errors of 2 %, a test image that is 1 % too bright, and a mask."""
    rng = np.random.default_rng(4)
    truth = rng.gamma(2.0, 0.3, SHAPE)
    error = 0.02 * truth
    layers = {"airlight": truth + error * rng.standard_normal(SHAPE), "airlight_se": error}
    mask = np.ones(SHAPE)
    mask[:2] = 0
    for name, image in (
        ("reference", Image(layers, attributes={"airlight:batches": 32})),
        ("test", Image({"airlight": 1.01 * truth})),
        ("mask", Image({"total": mask})),
    ):
        write_exr(tmp_path / f"{name}.exr", image)
    return [str(tmp_path / "reference.exr"), str(tmp_path / "test.exr")], str(tmp_path / "mask.exr")


@pytest.mark.claim("agreement-inside-the-margin", "exit-status")
def test_the_margin_decides(files, capsys):
    images, _ = files
    assert run(["compare", *images, "--margin", "0.03", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["equivalent"] is True
    assert run(["compare", *images, "--margin", "0.001"]) == 1
    assert "not shown to be within +-0.001" in capsys.readouterr().out
    assert run(["compare", *images]) == 0


def test_everything_at_once(files, capsys):
    images, mask = files
    assert run(["compare", *images, "--mask", mask, "--metrics", "all", "--flip", "--exposure", "-0.5", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert (values["pixels"], values["masked"]) == (14 * 20, 2 * 20)
    assert values["errors"]["values"] == 14 * 20 * 3
    assert values["errors_normalised"]["unit"] != 1
    assert values["colour"]["exposure"] == -0.5
    # With a note where the package is missing, with a value where it is not.
    assert (values["flip"]["value"] is None) == bool(values["flip"]["note"])


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--metrics", "some"], "--metrics some; wanted 'basic' or 'all'"),
        (["--exposure", "1"], "an exposure is for the colour differences and FLIP"),
        (["--margin", "0"], "margin: got 0.0, wanted a relative bias above 0"),
        (["--mask", "nowhere.exr"], "nowhere.exr"),
    ],
)
def test_wrong_options_are_refused(files, capsys, arguments, message):
    assert run(["compare", *files[0], *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.claim("engine-margin")
def test_a_file_is_compared_with_the_truth_of_a_scene(tmp_path, capsys):
    """The truth at another size is written by `reference`, and found again; upside down it is suspected."""
    path, turned = tmp_path / "open-fog.exr", tmp_path / "turned.exr"
    assert run(["reference", "open-fog", "--size", "32x24", "-o", str(path)]) == 0
    airlight = read_exr(path).layers["airlight"]
    write_exr(turned, Image({"total": airlight[::-1]}))
    capsys.readouterr()
    assert run(["compare", "--scene", "open-fog", str(path), "--margin", "1e-6", "--json"]) == 0
    values = json.loads(capsys.readouterr().out)
    assert (values["scene"], values["size"], values["hints"]) == ("open-fog", [32, 24], [])
    assert values["relative_rmse"] < 1e-6  # the file is float32
    assert run(["compare", str(turned), "--scene", "open-fog", "--margin", "1e-6"]) == 0  # a turn moves no light
    assert "suspect          the image is upside down" in capsys.readouterr().out
    write_exr(turned, Image({"airlight": 1.01 * airlight}))
    assert run(["compare", str(turned), "--scene", "open-fog", "--margin", "0.005"]) == 1
    assert "failed           the relative bias, +0.01, is not within +-0.005" in capsys.readouterr().out
    write_exr(turned, Image({"airlight": airlight[:20]}))
    assert run(["compare", str(turned), "--scene", "open-fog"]) == 2
    assert "open-fog is 800 x 600, 1.333 to 1" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["a.exr"], "got 1 file, wanted REFERENCE.exr TEST.exr, or SCENE TEST.exr"),
        (["a.exr", "b.exr", "--scene", "open-fog"], "got 2 files, wanted one EXR file beside --scene"),
        (["a.exr", "b.exr", "--pixel", "area"], "this option goes with a scene"),
        (["a.exr", "--scene", "open-fog", "--pixel", "corner"], "--pixel corner; wanted 'centre' or 'area'"),
        (["a.exr", "--scene", "open-fog"], "cannot read a.exr"),
    ],
)
def test_wrong_files_are_refused(capsys, arguments, message):
    assert run(["compare", *arguments]) == 2
    assert message in capsys.readouterr().err


@pytest.mark.claim("difference-image")
def test_a_difference_is_written_as_values_and_as_a_picture(files, tmp_path, capsys):
    from PIL import Image as Picture

    images, mask = files
    values, picture = tmp_path / "out" / "difference.exr", tmp_path / "difference.png"
    assert run(["compare", *images, "--difference", str(values), "--mask", mask]) == 0
    assert f"wrote            {values}: test - reference" in capsys.readouterr().out
    reference, test = (read_exr(path).layers["airlight"].astype(float) for path in images)
    layers = read_exr(values).layers
    np.testing.assert_allclose(layers["total"][2:], (test - reference)[2:], atol=1e-6)
    mean = reference[2:].mean()
    relative = (test - reference) / np.maximum(reference, 1e-3 * mean)
    np.testing.assert_allclose(layers["relative"][2:], relative[2:], rtol=1e-4, atol=1e-6)
    assert not layers["total"][:2].any()
    assert run(["compare", *images, "--difference", str(picture), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["difference"] == str(picture)
    shown = np.asarray(Picture.open(picture))
    assert shown.shape == SHAPE
    red, blue = shown[..., 0].astype(int), shown[..., 2].astype(int)
    brighter = (relative > 0.005).all(axis=-1)
    assert brighter.any()
    assert (red > blue)[brighter].all()


@pytest.mark.claim("difference-image")
def test_a_difference_of_pixels_that_are_not_finite_is_finite(files, tmp_path, capsys):
    from reference.storage.exr import Image

    images, _ = files
    broken = np.array(read_exr(images[1]).layers["airlight"])
    broken[3, 4] = np.nan
    write_exr(images[1], Image({"airlight": broken}), finite=False)
    assert run(["compare", *images, "--difference", str(tmp_path / "d.exr")]) == 1
    image = read_exr(tmp_path / "d.exr")
    assert image.attributes["airlight:not_finite"] == 1
    assert all(np.isfinite(layer).all() for layer in image.layers.values())


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--difference", "d.jpg"], "--difference: got 'd.jpg', wanted a name that ends in .exr (values) or .png"),
        (["--difference", "."], "wanted a name that ends in"),
        (["--layer", "nothing", "--difference", "d.exr"], "has no layer 'nothing'"),
    ],
)
def test_a_difference_that_cannot_be_written_leaves_no_file(files, tmp_path, monkeypatch, capsys, words, message):
    monkeypatch.chdir(tmp_path)
    assert run(["compare", *files[0], *words]) == 2
    assert message in capsys.readouterr().err
    assert not list(tmp_path.glob("d.*"))


@pytest.mark.claim("scenes-stand-first")
def test_a_scene_stands_in_place_of_the_reference(tmp_path, capsys):
    path, difference = tmp_path / "open-fog.exr", tmp_path / "difference.exr"
    assert run(["reference", "open-fog", "--size", "16x12", "-o", str(path)]) == 0
    capsys.readouterr()
    printed = []
    for words in (["open-fog", str(path), "--difference", str(difference)], ["--scene", "open-fog", str(path)]):
        assert run(["compare", *words, "--json"]) == 0
        printed.append(json.loads(capsys.readouterr().out))
    assert printed[0].pop("difference") == str(difference)
    assert printed[0] == printed[1]
    assert np.abs(read_exr(difference).layers["relative"]).max() < 1e-5
    for words, message in (
        ([str(path), "open-fog"], "the scene stands first: airlight compare open-fog"),
        (["opn-fog", str(path)], "did you mean 'open-fog'"),
        (["nowhere.xml", str(path)], "there is no file nowhere.xml"),
        (["nowhere.exr", str(path)], "nowhere.exr"),
    ):
        assert run(["compare", *words]) == 2
        assert message in capsys.readouterr().err
