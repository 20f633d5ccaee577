# SPDX-License-Identifier: BSD-3-Clause
"""Claim: certified values have their digits, with proof, where routes agree; what is refused."""

import csv
import math

import pytest
from flint import arb, ctx
from mpmath import mpf, workdps

import tests.evidence.certified.integral as module
from airlight.analytic.phase import Isotropic, phase_from_words
from tests.evidence.certified.airlight_integral import FILES, enclosure, read, value
from tests.evidence.certified.integral import integrate_certified, isotropic_closed_form

ISOTROPIC = Isotropic()


@pytest.mark.slow
@pytest.mark.claim("certified-digits", tolerance="1e-18 relative")
def test_every_tag_to_eighteen_digits(data_folder):
    with (data_folder / "airlight_integral.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))[7::169]
    assert len({row["tag"] for row in rows}) == 12
    for row in rows:
        inputs = [float(row[name]) for name in ("t", "h", "x0", "x1", "sigma_t")]
        value = integrate_certified(*inputs, phase_from_words(row["phase"], g=float(row["g"])))
        with workdps(40):
            # the data are rounded to 20 digits, of which the leading zeros of some count
            assert abs(value / mpf(row["value"]) - 1) < 1e-18, row


@pytest.mark.claim("certified-digits", tolerance="1e-21 relative")
@pytest.mark.parametrize(
    "inputs",
    [
        (3.2, 3.3, 0.0, 6.9, 0.61),
        (2.4, 8.2e-5, 0.0, 6.7, 0.61),
        # J is about 1e-977: far below what float64 holds.
        pytest.param((50.0, 100.0, 0.0, math.inf, 20.0), marks=pytest.mark.slow),
        (1.0, 0.5, 2.0, 2.0 + 1e-9, 0.3),
        (1.0, 0.5, 0.0, math.inf, 0.0),
    ],
)
def test_the_closed_form_is_a_third_route(inputs):
    two, three = (
        integrate_certified(*inputs, ISOTROPIC, digits=22),
        isotropic_closed_form(*inputs, digits=22),
    )
    with workdps(40):
        assert abs(two / three - 1) < 1e-21


@pytest.mark.claim("certified-digits")
def test_routes_that_disagree_certify_nothing(monkeypatch):
    correct = module._by_path
    monkeypatch.setattr(module, "_by_path", lambda *inputs: correct(*inputs) * (1 + mpf(10) ** -19))
    with pytest.raises(ArithmeticError, match=r"two quadratures disagree for foot=1\.0"):
        integrate_certified(1.0, 0.5, 0.0, 2.0, 0.3, ISOTROPIC, digits=20)
    integrate_certified(1.0, 0.5, 0.0, 2.0, 0.3, ISOTROPIC, digits=18)


STRIDE = 25  # has no divisor in common with the 12 tags, so that all of them come by


def wrong_rows(data_folder, stride):
    """Return the names of rows whose value the program does not give again, and
    all rows it was asked for.
    """
    rows = [
        (f"{name}, line {line}", row)
        for name in FILES
        for line, row in list(enumerate(read(data_folder / name)[1], start=2))[::stride]
    ]
    return [place for place, row in rows if value(row) != row["value"]], [row for _, row in rows]


def test_a_sample_of_every_kind_of_row_is_made_again(data_folder):
    wrong, rows = wrong_rows(data_folder, STRIDE)
    assert wrong == []
    assert len({row["tag"] for row in rows if "tag" in row}) == 12
    assert {row["phase"] for row in rows} == {"isotropic", "rayleigh", "hazy", "murky", "hg"}
    assert {"inf"} < {row["x1"] for row in rows}
    assert any("ox" in row for row in rows)


@pytest.mark.slow
def test_all_rows_are_made_again(data_folder):
    wrong, rows = wrong_rows(data_folder, 1)
    assert wrong == []
    assert len(rows) == 3006


def case(**changes):
    cells = {
        "phase": "isotropic",
        "g": "0",
        "t": "2",
        "h": "0.5",
        "x0": "0",
        "x1": "5",
        "sigma_t": "0",
    }
    return cells | changes


@pytest.mark.parametrize(("name", "g"), [("rayleigh", 0.0), ("hg", -0.9)])
def test_an_unbounded_ray_agrees_with_quadratures_that_cut_it_elsewhere(name, g):
    """The two quadratures of `tests.evidence.certified.integral` share no code with the program."""
    row = case(phase=name, g=str(g), x1="inf", sigma_t="0.001")
    separate = integrate_certified(
        2.0, 0.5, 0.0, float("inf"), 0.001, phase_from_words(name, g=g), digits=25
    )
    with ctx.workprec(128):
        ball = enclosure(row)
        assert abs(ball / arb(str(separate)) - 1) < arb(10) ** -14  # printed in 15 digits
    assert ball.rad() < ball.mid() * arb(2) ** -80
