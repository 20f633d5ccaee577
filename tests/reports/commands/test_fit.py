# SPDX-License-Identifier: BSD-3-Clause
"""`airlight fit`: its JSON, its tables, and the same from Python."""

import json

import pytest

import airlight
from reference.storage.exr import Image, write_exr
from reports.commands.main import DONE, run
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene


def test_the_command_and_python_find_what_made_the_image(variant, tmp_path, capsys):
    path = tmp_path / "fog.exr"
    write_exr(path, Image({"airlight": truth_image(load_scene("open-fog", (32, 24)).scene).airlight}))
    arguments = ["fit", str(path), "--scene", "open-fog", "--parameters", "sigma_t,intensity"]
    assert run([*arguments, "--json", "--start", "sigma_t=0.9"]) == DONE
    data = json.loads(capsys.readouterr().out)
    assert {"parameters", "residual", "explained", "confounded"} <= set(data)
    assert set(data["parameters"]) == {"sigma_t", "intensity"}
    sigma_t = data["parameters"]["sigma_t"]
    assert sigma_t["low"] < 0.173 < sigma_t["high"]
    assert sigma_t["value"] == pytest.approx(0.173, rel=1e-4)
    assert run(arguments) == DONE
    assert "95 % interval" in capsys.readouterr().out
    fit = airlight.fit(str(path), "open-fog", "sigma_t, intensity")
    assert fit["sigma_t"]["value"] == pytest.approx(sigma_t["value"], rel=1e-4)
    assert "<table" in fit._repr_html_()
    with pytest.raises(airlight.InputError, match="did you mean"):
        airlight.fit(str(path), "open-fog", ["albdo"])
