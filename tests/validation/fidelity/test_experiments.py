# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the experiments that need no image find which printed formulas are right and which are not."""

import numpy as np
import pytest

from validation.fidelity import equations as equations_module
from validation.fidelity.equations import equations
from validation.fidelity.ordering import drawn, ordering
from validation.fidelity.printed import clouds, printed
from validation.fidelity.scattering import fitted_constant, left_over


def test_the_equations_of_both_papers_hold_to_rounding():
    errors = equations()
    assert set(errors) >= {"distance", "angle", "change", "segments", "order", "scaling", "integrated", "two_lit"}
    assert all(errors[name] < 1e-12 for name in errors if name != "overlap")
    assert 0.05 < errors["overlap"] < 0.6


def test_an_error_of_a_thousandth_is_seen(monkeypatch):
    angle = equations_module._angle
    monkeypatch.setattr(equations_module, "_angle", lambda *ray: 1.001 * angle(*ray))
    assert equations()["angle"] == pytest.approx(1e-3, rel=1e-6)


@pytest.mark.claim("errata-of-biri", tolerance="1e-9 of the largest value: rounding")
def test_the_wrong_coefficients_are_those_of_the_errata():
    coefficients = printed()["coefficients"]
    wrong = {
        (phase, number) for phase, values in coefficients.items() for number, error in enumerate(values) if error > 1e-9
    }
    assert wrong == {("isotropic", 2), ("isotropic", 3), ("rayleigh", 2), ("hazy", 1), ("hazy", 2), ("murky", 1)}
    assert {phase: len(values) for phase, values in coefficients.items()} == dict(
        isotropic=5, rayleigh=3, hazy=3, murky=3
    )


def test_the_printed_phase_functions_scatter_too_much():
    assert printed()["means"] == {"hazy": pytest.approx(2), "murky": pytest.approx(83 / 33)}


def test_the_equations_of_clouds_as_printed():
    exponents = clouds()
    # dx/(dx + dl) of the derived form is 16/9, and the printed one has the other sign.
    assert exponents["scattering"] == pytest.approx(-9 / 16)
    assert exponents["opacity"] == pytest.approx(-1)
    assert exponents["radius"] == pytest.approx(16 / 6)
    assert exponents["conservation"] == pytest.approx(2)


def test_the_stencil_by_hand():
    # From the surface at 1: lit to 0.8, dark to 0.6, dark to 0.3, lit to the camera.
    overlapping = [(0.3, 0.6), (0.5, 0.8)]
    assert drawn(overlapping, -1) == pytest.approx(0.2 + 0.3)
    assert drawn(overlapping, 0) == pytest.approx(1 - 0.3 - 0.3)  # what lies in both is taken away twice
    assert drawn([(0.7, 1.2)], -1) == pytest.approx(0.7)  # the surface is dark
    assert drawn([(-0.1, 0.4)], -1) == pytest.approx(0.6)  # the camera is
    # With the rule of stage 5 the plane at 0.4 leaves the stencil at -1, so the one at 0.2 is not drawn.
    assert drawn([(0.2, 0.4)], -1) == pytest.approx(0.8)
    assert drawn([(0.2, 0.4)], 1) == pytest.approx(0.6)


def test_only_one_rule_of_the_stencil_is_right():
    shares = ordering()
    assert shares["plane"] == shares["stencil"] == shares["inside"] == 1
    assert shares["printed"] < 0.5
    assert shares["unordered"] < 0.5


def test_the_best_constant_and_what_it_leaves_over_without_noise():
    random = np.random.default_rng(7)
    fog = random.uniform(0.5, 1, 20_000)
    rest = 0.3 * random.choice([-1.0, 1.0], len(fog))
    multiple = 2 * fog + rest
    constant = fitted_constant(fog, multiple)
    assert constant == pytest.approx(2, rel=0.01)
    first, second = (multiple + random.normal(0, 1, len(fog)) for _ in range(2))
    expected = 0.3 / np.sqrt(np.mean(multiple**2))
    assert left_over(first, second, constant * fog) == pytest.approx(expected, rel=0.05)
    assert left_over(fog, fog, fog) == 0
