# SPDX-License-Identifier: BSD-3-Clause
"""Studies of kernels, formulas and slabs: their numbers, their files,
what ends with the status 1.
"""

import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import airlight
from airlight.reports.api.inputs import output_files
from airlight.reports.commands import main as cli
from airlight.reports.plotting.figure import new_figure
from airlight.reports.studies.registry import ENDINGS, Study
from airlight.reports.tables.table import numbers, table
from airlight.validation.kernels.case_files import read_cases
from tests.helpers.api import third

# Integrals


def test_integrals_of_a_file_and_of_its_columns(data_folder, variant):
    path = data_folder / "airlight_integral.csv"
    integrals = airlight.study("integrals", path)
    assert integrals.summary["max"] < 4e-6  # the README's figure for the kernel `exact`
    assert integrals.J.shape == (2004,)
    cases = read_cases(path)
    columns = {
        name: getattr(cases, name)
        for name in ("phase", "g", "foot", "height", "x0", "x1", "sigma_t", "value")
    }
    again = airlight.study("integrals", columns)
    np.testing.assert_array_equal(again.J, integrals.J)
    np.testing.assert_array_equal(airlight.study("integrals", integrals.columns()).J, integrals.J)
    assert np.nanmax(np.abs(again.error)) == pytest.approx(integrals.summary["max"])
    assert "and 1992 more" in integrals._repr_html_()
    assert not integrals.J.flags.writeable


def test_integrals_have_the_shape_of_the_columns_and_a_certified_value(variant, tmp_path):
    foot, height = np.linspace(-1, 2, 5)[:, None], np.array([0.1, 0.7, 2.0])
    rays = {
        "phase": "hg",
        "g": 0.4,
        "foot": foot,
        "height": height,
        "x0": 0.0,
        "x1": np.inf,
        "sigma_t": 0.3,
    }
    integrals = airlight.study("integrals", rays, "quadrature-32", precision="double", certify=True)
    assert integrals.J.shape == integrals.value.shape == integrals.error.shape == (5, 3)
    assert np.abs(integrals.error).max() < 1e-4
    with integrals.save(tmp_path / "results.csv").open() as file:
        written = list(csv.DictReader(file))
    np.testing.assert_array_equal([float(row["result"]) for row in written], integrals.J.ravel())
    np.testing.assert_array_equal([float(row["height"]) for row in written], np.tile(height, 5))
    own = airlight.study("integrals", rays, third, precision="double")
    assert own.kernel.endswith(":third")
    exact = airlight.study("integrals", rays, precision="double")
    np.testing.assert_allclose(own.J, exact.J / 3, rtol=1e-14)
    with pytest.raises(airlight.InputError, match="shapes that do not go together"):
        airlight.study("integrals", rays | {"foot": [1.0, 2.0], "height": [1.0, 2.0, 3.0]})


@pytest.mark.claim("droplets-by-name")
def test_integrals_of_a_file_take_a_phase_function_by_words(variant, capfd, tmp_path):
    from airlight.validation.kernels.case_files import integrate_cases

    rays, written = tmp_path / "rays.csv", tmp_path / "results.csv"
    rays.write_text(
        "phase,t,h,x0,x1,sigma_t\nhg-draine:12,1,0.5,0,3,0.2\nhg-draine:12,-1,0.25,0.5,inf,0.1\n"
    )
    assert cli.run(["study", "integrals", str(rays), "-o", str(written)]) == 0
    assert "wrote" in capfd.readouterr().out
    with written.open() as file:
        results = list(csv.DictReader(file))
    assert {row["phase"] for row in results} == {"hg-draine:12"}
    expected, _ = integrate_cases(read_cases(rays))
    assert [float(row["result"]) for row in results] == pytest.approx(expected, rel=1e-5)


# Kernels


@pytest.mark.claim("kernels-are-named-by-kernel")
def test_kernels_are_named_by_an_option(variant, tmp_path, monkeypatch):
    asked = []

    def bench_kernels(names, **options):
        asked.append(names)
        return []

    monkeypatch.setattr("airlight.validation.kernels.benchmark.bench_kernels", bench_kernels)
    written = tmp_path / "kernels.json"
    assert (
        cli.run(
            ["study", "kernels", "--kernel", "exact", "--kernel", "taylor-8", "-o", str(written)]
        )
        == 0
    )
    assert json.loads(written.read_text())["result"]["kernels"] == {"costs": [], "levels": []}
    assert cli.run(["study", "kernels"]) == 0
    assert asked == [["exact", "taylor-8"], None]


@pytest.mark.claim("exact-keeps-its-bar")
def test_stability_fails_where_the_claim_is_broken(variant, monkeypatch, capsys):
    from airlight.realtime.kernels.registry import KERNELS

    monkeypatch.setattr("airlight.reports.studies.kernels._TRIED_RAYS", 64)
    assert airlight.study("stability", kernel="taylor").passed
    monkeypatch.setitem(KERNELS, "exact", replace(KERNELS["taylor"], name="exact", exact=True))
    assert cli.run(["study", "stability", "--kernel", "exact"]) == 1
    assert "BROKEN: exact, airlight_integral.csv: float32 maximum" in capsys.readouterr().out


# Formulas and slabs


def test_slab_by_command_and_from_python(tmp_path):
    slab = [
        "study",
        "slab",
        "2",
        "30",
        "--phase",
        "hg:0.75",
        "--albedo",
        "0.9",
        "--orders",
        "1",
        "--photons",
        "50",
    ]
    assert cli.run([*slab, "-o", str(tmp_path / "slab.json")]) == 0
    data = json.loads((tmp_path / "slab.json").read_text())["result"]
    assert (data["tau"], data["sun"], data["albedo"], data["phase"]) == (2, 30, 0.9, "hg:0.75")
    assert (
        [row["orders"] for row in data["orders"]]
        == [row["orders"] for row in data["photons"]["orders"]]
        == ["1"]
    )
    assert data["error"]["orders"][0]["reflectance"] < 1e-6
    light = airlight.study("slab", 2.0, 30.0, phase="hg:0.75", albedo=0.9, orders=[1], photons=50)
    assert light.to_dict() == data
    assert light[1]["reflectance"] == data["orders"][0]["reflectance"]
    assert "<table" in light._repr_html_()
    with pytest.raises(airlight.InputError, match="wavelength"):
        airlight.study("slab", 2.0, 30.0, phase="mie:6:2:0.7")


# Figures

QUICK = {
    "kernels": {"kernel": "taylor", "phase": "isotropic"},
    "slab": {"tau": 2, "sun": 30, "orders": "1,2", "photons": 50},
}


@pytest.mark.parametrize("name", ["methods", "stability", "integrals"])
def test_a_study_without_a_figure_refuses_its_name_before_it_measures(name, capsys, tmp_path):
    words = ["no.csv"] if name == "integrals" else []
    assert cli.run(["study", name, *words, "-o", str(tmp_path / "a.png")]) == 2
    assert "ends in .csv or .tex or .md or .json" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ENDINGS)
def test_an_ending_in_capitals_writes_the_same_file(ending, tmp_path):
    """The command takes both before it measures for minutes."""
    shown = table("t", numbers("a"), [(1,)])
    made = Study(name="made up", data={}, tables=(shown,), draw=lambda column: new_figure(2, 1))
    small, capital = tmp_path / f"a{ending}", tmp_path / f"b{ending.upper()}"
    assert output_files(capital, *ENDINGS) == [capital]
    assert made.save(small).read_bytes() == made.save(capital).read_bytes()


@pytest.mark.slow
@pytest.mark.claim("figures-repeat", tolerance="none: equal bytes")
@pytest.mark.parametrize("name", QUICK)
def test_a_figure_is_drawn_twice_to_the_same_bytes(name, variant, tmp_path, monkeypatch):
    """TrueType fonts are embedded, and no date."""
    monkeypatch.setattr("airlight.validation.kernels.benchmark.RAYS", 3000)
    found = airlight.study(name, **QUICK[name])
    first = found.save(tmp_path / "first.pdf", "single").read_bytes()
    assert found.save(tmp_path / "again.pdf", "single").read_bytes() == first
    assert first.startswith(b"%PDF")
    assert b"/FontFile2" in first
    assert b"/Type3" not in first
    assert b"CreationDate" not in first
