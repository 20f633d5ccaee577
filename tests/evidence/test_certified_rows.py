# SPDX-License-Identifier: BSD-3-Clause
"""Claim: every digit of the certified rows follows from the program that makes them, with proof."""

import pytest
from flint import arb, ctx

from analytic.phase import PhaseFunction
from tests.evidence.certified.airlight_integral import FILES, enclosure, read, value
from tests.evidence.certified.integral import integrate_certified

STRIDE = 25  # has no divisor in common with the 12 tags, so that all of them come by


def wrong_rows(data_folder, stride):
    """Return the names of rows whose value the program does not give again, and all rows it was asked for."""
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
    cells = {"phase": "isotropic", "g": "0", "t": "2", "h": "0.5", "x0": "0", "x1": "5", "sigma_t": "0"}
    return cells | changes


@pytest.mark.parametrize(("name", "g"), [("rayleigh", 0.0), ("hg", -0.9)])
def test_an_endless_ray_agrees_with_quadratures_that_cut_it_elsewhere(name, g):
    """The two quadratures of `tests.evidence.certified.integral` share no code with the program."""
    row = case(phase=name, g=str(g), x1="inf", sigma_t="0.001")
    separate = integrate_certified(2.0, 0.5, 0.0, float("inf"), 0.001, PhaseFunction(name, g=g), digits=25)
    with ctx.workprec(128):
        ball = enclosure(row)
        assert abs(ball / arb(str(separate)) - 1) < arb(10) ** -14  # printed in 15 digits
    assert ball.rad() < ball.mid() * arb(2) ** -80
