# SPDX-License-Identifier: BSD-3-Clause
"""Claim: photons in a slab follow the phase function, lose nothing, and are counted by order.

The walk through the step cloud gives the consensus of I3RC.
"""

import math
from pathlib import Path

import numpy as np
import pytest

from airlight.reference.monte_carlo.slab_walk.estimates import slab_estimate
from airlight.reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein, Tabulated
from airlight.reference.monte_carlo.slab_walk.walk import Slab, walk

DATA = Path(__file__).parents[3] / "data"
GRID = (np.arange(200_000) + 0.5) / 200_000
ALL = (1, math.inf)


@pytest.mark.parametrize("g", [0.0, 0.75, -0.4, 0.95])
def test_cosines_have_the_moments_of_the_phase_function(g):
    cosines = HenyeyGreenstein(g).cosines(GRID)
    assert np.abs(cosines).max() <= 1
    legendre = np.polynomial.legendre.legvander(cosines, 5).mean(0)
    assert legendre == pytest.approx(g ** np.arange(6), abs=2e-5)


def test_a_table_has_the_moments_of_its_function():
    angles = np.linspace(0.0, np.pi, 2001)
    g = 0.8
    table = Tabulated(angles, 3 * (1 - g * g) / (1 + g * g - 2 * g * np.cos(angles)) ** 1.5)
    legendre = np.polynomial.legendre.legvander(table.cosines(GRID), 8).mean(0)
    assert legendre == pytest.approx(g ** np.arange(9), abs=2e-5)
    half = Tabulated(np.array([0.0, 1.0, 1.0 + 1e-9, np.pi]), np.array([0.0, 0.0, 1.0, 1.0]))
    assert half.cosines(GRID).max() == pytest.approx(math.cos(1.0), abs=1e-5)


def test_the_beam_is_exact_and_orders_begin_at_zero():
    """Order 0 has no noise: each photon counts with its probability to pass, at the
    place where the beam goes.
    """
    slab = Slab(1.3, 0.6, 0.9, HenyeyGreenstein(0.5), [0.5])
    counts = walk(slab, 100, np.random.default_rng(0))
    tangent = 0.8 / 0.6
    beam = math.exp(-1.3 / 0.6)
    assert counts.transmitted[:, 0] == pytest.approx(
        [beam, beam * 1.3 * tangent, beam * (1.3 * tangent) ** 2]
    )
    assert counts.reflected[0, 0] == 0
    assert counts.down[0, 0, 0] == pytest.approx(math.exp(-0.5 / 0.6))
    assert counts.fluence[0, 0, 0] == pytest.approx(math.exp(-0.5 / 0.6) / 0.6)
    assert counts.up[0, 0, 0] == 0


@pytest.mark.statistical
def test_nothing_is_lost_and_absorption_is_a_weight():
    """Seeds are fixed: at 4.5 standard errors one of 150 000 seeds would fail."""
    estimates = {
        albedo: slab_estimate(
            Slab(2.0, 0.7, albedo, HenyeyGreenstein(0.3)), [(1, 1), (3, 3)], photons=100_000
        )
        for albedo in (1.0, 0.5)
    }
    values, errors = estimates[1.0].totals
    assert values.sum() == pytest.approx(1, abs=4.5 * np.hypot(*errors))
    for place, order in enumerate((1, 3)):  # the same photons, weighted
        whole, half = (estimates[albedo].exits[0, place, 0] for albedo in (1.0, 0.5))
        assert half == pytest.approx(whole * [0.5**order, 1, 1], rel=1e-12)
