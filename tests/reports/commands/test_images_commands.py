# SPDX-License-Identifier: BSD-3-Clause
"""`integrate`, `slab`, `clouds` and `maps`: one call each, its JSON and its tables."""

import csv
import json

import pytest

import airlight
from reports.commands import main as cli


def printed(capfd, *arguments, status=0):
    assert cli.run([*arguments, "--json"]) == status
    return json.loads(capfd.readouterr().out)


@pytest.mark.claim("droplets-by-name")
def test_integrate_takes_a_phase_function_by_words(variant, capfd, tmp_path):
    from analytic.cases import integrate_cases, read_cases

    rays, written = tmp_path / "rays.csv", tmp_path / "results.csv"
    rays.write_text("t,h,x0,x1,sigma_t,value\n1,0.5,0,3,0.2,7\n-1,0.25,0.5,inf,0.1,7\n")
    assert cli.run(["integrate", str(rays), "--phase", "hg-draine:12", "-o", str(written)]) == 0
    assert "2 rows with exact" in capfd.readouterr().out
    with written.open() as file:
        results = list(csv.DictReader(file))
    assert {row["phase"] for row in results} == {"hg-draine:12"}
    expected, _ = integrate_cases(read_cases(rays, phase="hg-draine:12"))
    assert [float(row["result"]) for row in results] == pytest.approx(expected, rel=1e-5)


def test_slab_by_command_and_from_python(capfd):
    slab = ["slab", "--tau", "2", "--sun", "30", "--phase", "hg:0.75", "--albedo", "0.9", "--orders", "1"]
    data = printed(capfd, *slab, "--photons", "50")
    assert (data["tau"], data["sun"], data["albedo"], data["phase"]) == (2, 30, 0.9, "hg:0.75")
    assert [row["orders"] for row in data["orders"]] == [row["orders"] for row in data["photons"]["orders"]] == ["1"]
    assert data["error"]["orders"][0]["reflectance"] < 1e-6
    light = airlight.slab(2.0, 30.0, phase="hg:0.75", albedo=0.9, orders=[1], photons=50)
    assert light.to_dict() == data
    assert light[1]["reflectance"] == data["orders"][0]["reflectance"]
    assert "<table" in light._repr_html_()
    with pytest.raises(airlight.InputError, match="wavelength"):
        airlight.slab(2.0, 30.0, phase="mie:6:2:0.7")


def test_maps_print_errors_and_flicker_by_size(variant, capfd):
    arguments = ["maps", "omni-box", "--size", "16x12", "--sizes", "32,16", "--flicker", "--frames", "2"]
    march = ["--method", "ray-march", "--set", "shadow=map", "--set", "steps=16"]
    (scene,) = printed(capfd, *arguments, *march)["scenes"]
    assert (scene["name"], scene["method"]) == ("omni-box", "ray-march (shadow=map, steps=16)")
    assert scene["errors"]["sizes"] == scene["flicker"]["sizes"] == [16, 32]
    assert all(metrics["relative_rmse"] > 0 for metrics in scene["errors"]["metrics"])
    assert all(value > 0 for value in scene["flicker"]["flicker"])
    assert scene["flicker"]["truth_change"] > 0
