# SPDX-License-Identifier: BSD-3-Clause
"""`airlight fit`: its JSON, its tables, what it refuses, and the same from Python."""

import json

import numpy as np
import pytest

import airlight
from reference.storage.exr import Image, write_exr
from reports.commands.main import DONE, WRONG_INPUT, run
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene


@pytest.fixture
def image(variant, tmp_path):
    truth = truth_image(load_scene("open-fog", (32, 24)).scene)
    path = tmp_path / "fog.exr"
    write_exr(path, Image({"airlight": truth.airlight}))
    return path


def test_json_has_the_names_of_the_page(image, capsys):
    arguments = ["fit", str(image), "--scene", "open-fog", "--parameters", "sigma_t,albedo,intensity", "--json"]
    assert run([*arguments, "--start", "sigma_t=0.9"]) == DONE
    data = json.loads(capsys.readouterr().out)
    assert {"parameters", "residual", "explained", "confounded"} <= set(data)
    assert set(data["parameters"]) == {"sigma_t", "albedo", "intensity"}
    sigma_t = data["parameters"]["sigma_t"]
    assert sigma_t["low"] < 0.173 < sigma_t["high"]
    assert sigma_t["value"] == pytest.approx(0.173, rel=1e-4)
    assert data["confounded"][0]["held"] == ["intensity"]


def test_people_read_a_table_and_sentences(image, capsys):
    assert run(["fit", str(image), "--scene", "open-fog", "--parameters", "sigma_t,albedo,exposure"]) == DONE
    printed = capsys.readouterr().out
    for words in ("95 % interval", "variance is explained", "does not tell apart", "Way out"):
        assert words in printed


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--parameters", "sigma_t,,albedo"], "none of them empty"),
        (["--parameters", "sigmat"], "did you mean"),
        (["--parameters", "sigma_t", "--start", "sigma_t"], "wanted NAME=VALUE"),
        (["--parameters", "sigma_t", "--start", "sigma_t=1,sigma_t=2"], "each name once"),
        (["--parameters", "sigma_t", "--layer", "fog"], "fog"),
    ],
)
def test_mistakes_have_one_line(image, capsys, arguments, words):
    assert run(["fit", str(image), "--scene", "open-fog", *arguments]) == WRONG_INPUT
    error = capsys.readouterr().err
    assert words in error
    assert error.strip().count("\n") == 0


def test_from_python_it_is_the_same(image, capsys):
    assert run(["fit", str(image), "--scene", "open-fog", "--parameters", "sigma_t,intensity", "--json"]) == DONE
    printed = json.loads(capsys.readouterr().out)
    fit = airlight.fit(str(image), "open-fog", "sigma_t, intensity")
    assert fit.to_dict()["parameters"] == printed["parameters"]
    assert fit["sigma_t"]["value"] == printed["parameters"]["sigma_t"]["value"]
    assert "sigma_t=0.173" in repr(fit)
    assert "<table" in fit._repr_html_()
    frame = airlight.render("open-fog", "unshadowed", "exact", size=(32, 24))
    assert airlight.fit(frame, "open-fog", ["sigma_t"])["sigma_t"]["value"] == pytest.approx(0.173, rel=1e-3)
    with pytest.raises(airlight.InputError, match="did you mean"):
        airlight.fit(np.ones((24, 32, 3)), "open-fog", ["albdo"])
