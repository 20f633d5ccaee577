# SPDX-License-Identifier: BSD-3-Clause
"""`airlight integrate --phase` and `bench --phase`: a phase function by words, and what is refused."""

import csv

import pytest

from reports.commands import main as cli

ROWS = "t,h,x0,x1,sigma_t,value\n1,0.5,0,3,0.2,7\n-1,0.25,0.5,inf,0.1,7\n"


@pytest.fixture
def rays(tmp_path):
    path = tmp_path / "rays.csv"
    path.write_text(ROWS)
    return path


@pytest.mark.claim("droplets-by-name")
def test_a_phase_function_is_given_by_words(variant, capfd, rays, tmp_path):
    from analytic.cases import integrate_cases, read_cases

    written = tmp_path / "results.csv"
    assert cli.run(["integrate", str(rays), "--phase", "hg-draine:12", "-o", str(written)]) == 0
    assert "2 rows with exact" in capfd.readouterr().out
    with written.open() as file:
        results = list(csv.DictReader(file))
    assert {row["phase"] for row in results} == {"hg-draine:12"}
    expected, _ = integrate_cases(read_cases(rays, phase="hg-draine:12"))
    assert [float(row["result"]) for row in results] == pytest.approx(expected, rel=1e-5)


@pytest.mark.claim("droplets-refused")
@pytest.mark.parametrize(
    ("words", "message"),
    [("mie:51", "2 to 50 um"), ("mie:6:-1", "gamma"), ("mei", "did you mean 'mie'"), ("tabulated", "without a table")],
)
def test_what_is_no_phase_function_is_refused(capfd, rays, words, message):
    assert cli.run(["integrate", str(rays), "--phase", words]) == 2
    assert message in capfd.readouterr().err


def test_scenes_have_their_own_phase_function(capfd):
    assert cli.run(["bench", "open-fog", "--phase", "mie"]) == 2
    assert "add --kernels" in capfd.readouterr().err
