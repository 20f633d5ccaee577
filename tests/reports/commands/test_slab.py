# SPDX-License-Identifier: BSD-3-Clause
"""`airlight slab`: its JSON, its tables, and what it refuses."""

import json

import pytest

import airlight
from reports.commands.main import DONE, WRONG_INPUT, run

SLAB = ["slab", "--tau", "2", "--sun", "30", "--phase", "hg:0.75", "--albedo", "0.9"]


def test_json_has_the_names_of_the_page(capsys):
    assert run([*SLAB, "--orders", "1,2", "--depths", "0,1", "--directions", "0.5:0,-1:90", "--json"]) == DONE
    data = json.loads(capsys.readouterr().out)
    assert list(data) == ["tau", "sun", "albedo", "phase", "orders", "total", "error"]
    assert (data["tau"], data["sun"], data["albedo"], data["phase"]) == (2, 30, 0.9, "hg:0.75")
    assert [row["orders"] for row in data["orders"]] == ["1", "2"]
    lengths = ["reflected_mean", "reflected_rms", "transmitted_mean", "transmitted_rms"]
    assert list(data["orders"][0]) == ["orders", "reflectance", "transmittance", *lengths, "fluence"]
    assert list(data["orders"][0]["fluence"][1]) == ["depth", "value", "mean", "rms"]
    total = data["total"]
    assert list(total) == ["reflectance", "transmittance", "flux", "radiance"]
    assert list(total["flux"][0]) == ["depth", "up", "down"]
    assert list(total["radiance"][0]) == ["depth", "mu", "phi", "value"]
    assert [row["depth"] for row in total["radiance"]] == [0, 0, 1, 1]
    assert data["error"]["orders"][0]["reflectance"] < 1e-6


def test_tables_for_people_and_photons_beside(capsys):
    assert run([*SLAB, "--orders", "all", "--photons", "2000"]) == DONE
    printed = capsys.readouterr().out
    for words in ("By order", "By 2000 photons", "Standard errors", "Fluence", "Diffuse flux", "never scattered"):
        assert words in printed


def test_from_python_it_is_the_same(capsys):
    assert run([*SLAB, "--orders", "1,2-inf", "--photons", "500", "--json"]) == DONE
    printed = json.loads(capsys.readouterr().out)
    light = airlight.slab(2.0, 30.0, phase="hg:0.75", albedo=0.9, orders=[1, "2-inf"], photons=500)
    assert light.to_dict() == printed
    assert light["2-inf"] == light.orders[1]
    assert light[1]["reflectance"] == printed["orders"][0]["reflectance"]
    assert len(light) == 2
    assert "hg:0.75" in repr(light)
    assert "<table" in light._repr_html_()
    with pytest.raises(KeyError):
        light[3]
    with pytest.raises(airlight.InputError, match="photons"):
        airlight.slab(2.0, 30.0, photons=-1)
    with pytest.raises(airlight.InputError, match="wavelength"):
        airlight.slab(2.0, 30.0, phase="mie:6:2:0.7")


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--tau", "-1"], "wanted a thickness"),
        (["--sun", "90"], "no light enters"),
        (["--photons", "1"], "wanted at least 2"),
        (["--photons", "1000000000000"], "--force"),
        (["--seed", "-1", "--photons", "10"], "--seed"),
        (["--orders", "0"], "never scattered"),
    ],
)
def test_mistakes_are_one_line(arguments, words, capsys):
    assert run([*SLAB, *arguments]) == WRONG_INPUT
    printed = capsys.readouterr()
    assert not printed.out
    assert words in printed.err
    assert printed.err.count("\n") == 1
