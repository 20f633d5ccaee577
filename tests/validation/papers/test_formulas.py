# SPDX-License-Identifier: BSD-3-Clause
"""Claim: printed formulas stand beside what is right, each by an integral of its own."""

from types import SimpleNamespace

import numpy as np
import pytest

from airlight.analytic.panels import airlight_segments
from airlight.analytic.phase import Hazy
from airlight.validation.papers import formulas
from airlight.validation.papers.formulas import (
    _angular_form,
    _compared,
    _moderate,
    _over_angle,
    _over_distance,
    _worst,
)


def test_both_forms_of_the_integral_are_that_of_the_panels():
    for ray in ((1.0, 0.5, 3.0, 0.2), (-1.5, 0.7, 2.0, 0.6), (5.0, 1.2, 2.0, 0.1)):
        foot, height, length, sigma = ray
        J, _ = airlight_segments(np.array([foot]), np.array([height]), 0.0, length, sigma, Hazy())
        assert _over_distance(*ray) == pytest.approx(J[0], rel=1e-9)
        assert _over_angle(*ray) == pytest.approx(J[0], rel=1e-9)


def test_the_worst_ratio_is_the_one_farthest_from_one(monkeypatch):
    assert _worst(np.array([1.1, 0.7, 1.2])) == 0.7
    assert _compared(np.array([1.0, 2.0, 5.0]), np.array([1.0, 3.0, 4.0])) in (0.75, 1.25)
    monkeypatch.setattr(formulas, "_RAYS", 3)
    assert _angular_form() == pytest.approx(1, abs=1e-10)


def test_moderate_rays_are_at_moderate_distances_lengths_and_angles():
    def moderate(foot: float, height: float, length: float) -> bool:
        cases = SimpleNamespace(
            foot=np.array([foot]), height=np.array([height]), x1=np.array([length])
        )
        return bool(_moderate(cases)[0])

    assert moderate(0.6, 0.8, 2.0)
    assert not moderate(6.0, 8.0, 20.0)  # at 10
    assert not moderate(0.006, 0.007, 0.01)  # at 0.009
    assert not moderate(0.6, 0.8, 0.04)  # 0.04 of the distance
    assert not moderate(0.6, 0.8, 11.0)
    assert not moderate(1.0, 0.015, 1.0)  # 0.9 degrees
    assert moderate(1.0, 0.02, 1.0)


def test_an_isotropic_field_does_not_stay_by_equation_5():
    assert formulas._cloud_equations()["eq. 5"] == 2.0
