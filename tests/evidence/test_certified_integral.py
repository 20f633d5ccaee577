# SPDX-License-Identifier: BSD-3-Clause
"""Certified values: to the digits of the data, where routes disagree, and what is refused."""

import csv
import math

import pytest
from mpmath import mpf, workdps

import tests.evidence.certified.integral as module
from analytic.errors import InputError
from analytic.phase import PhaseFunction
from tests.evidence.certified.integral import integrate_certified, isotropic_closed_form

ISOTROPIC = PhaseFunction("isotropic")


@pytest.mark.claim("certified-digits", tolerance="1e-18 relative")
def test_every_tag_to_eighteen_digits(data_folder):
    with (data_folder / "airlight_integral.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))[7::169]
    assert len({row["tag"] for row in rows}) == 12
    for row in rows:
        inputs = [float(row[name]) for name in ("t", "h", "x0", "x1", "sigma_t")]
        value = integrate_certified(*inputs, PhaseFunction(row["phase"], g=float(row["g"])))
        with workdps(40):
            # the data are rounded to 20 digits, of which the leading zeros of some count
            assert abs(value / mpf(row["value"]) - 1) < 1e-18, row


@pytest.mark.claim("certified-digits", tolerance="1e-21 relative")
@pytest.mark.parametrize(
    "inputs",
    [
        (3.2, 3.3, 0.0, 6.9, 0.61),
        (2.4, 8.2e-5, 0.0, 6.7, 0.61),
        (50.0, 100.0, 0.0, math.inf, 20.0),  # J is about 1e-977: far below what float64 holds
        (1.0, 0.5, 2.0, 2.0 + 1e-9, 0.3),
        (1.0, 0.5, 0.0, math.inf, 0.0),
    ],
)
def test_the_closed_form_is_a_third_route(inputs):
    two, three = integrate_certified(*inputs, ISOTROPIC, digits=22), isotropic_closed_form(*inputs, digits=22)
    with workdps(40):
        assert abs(two / three - 1) < 1e-21


@pytest.mark.claim("certified-digits")
def test_routes_that_disagree_certify_nothing(monkeypatch):
    correct = module._by_path
    monkeypatch.setattr(module, "_by_path", lambda *inputs: correct(*inputs) * (1 + mpf(10) ** -19))
    with pytest.raises(ArithmeticError, match=r"two quadratures disagree for foot=1\.0"):
        integrate_certified(1.0, 0.5, 0.0, 2.0, 0.3, ISOTROPIC, digits=20)
    integrate_certified(1.0, 0.5, 0.0, 2.0, 0.3, ISOTROPIC, digits=18)


def test_refusals():
    with pytest.raises(InputError, match="digits is 14; wanted at least 15"):
        integrate_certified(1.0, 0.5, 0.0, 2.0, 0.3, ISOTROPIC, digits=14)
