# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the figures of Bouthors's slab are ratios, fractions and crossings of the
light that the slab has.
"""

import numpy as np
import pytest

from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.validation.papers import slab
from airlight.validation.papers.slab import TransportCurve, crossing


def test_a_level_is_crossed_by_a_power_law():
    assert crossing((10.0, 100.0, 1000.0), [0.04, 4.0, 400.0], 1.0) == pytest.approx(50.0)
    assert crossing((10.0, 40.0), [1.0, 16.0], 4.0) == pytest.approx(20.0)


def test_the_change_by_azimuth_is_that_of_the_sum_of_the_modes(monkeypatch):
    """Modes m and -m are equal: 1 + 2 (0.3 cos phi + 0.1 cos 2 phi) goes from 0.6 to 1.8."""
    asked = []

    def moments(phase, albedo, mu):
        def modes(thickness, suns, depths):
            asked.append((thickness, suns, depths))
            found = np.zeros((len(SETS), 3, 1, 1, 1, len(mu)))
            found[:, 0], found[:, 1, ..., 0], found[:, 2, ..., 0] = 1.0, 0.3, 0.1
            return found

        return modes

    monkeypatch.setattr(slab, "DirectionalMoments", moments)
    ratios = slab._by_azimuth(0.01, None)
    phi = np.linspace(0, np.pi, 10_001)
    radiance = 1 + 0.6 * np.cos(phi) + 0.2 * np.cos(2 * phi)
    assert list(ratios.values()) == pytest.approx(
        [radiance.max() / radiance.min()] * len(SETS), rel=1e-3
    )
    ((thickness, suns, depths),) = asked
    assert (thickness, depths) == (10.0, [1.0])  # 1000 m and 100 m
    assert np.degrees(np.arccos(suns)) == pytest.approx(75.0)


def test_reflectance_of_a_thin_slab_is_that_of_one_scattering(monkeypatch):
    """Isotropic scattering without absorption sends half of what it scatters up: tau/2."""
    monkeypatch.setattr(slab, "_STREAMS", 8)
    tau = 1e-3
    assert slab._reflectance(tau, HenyeyGreensteinPhase(0.0)) == pytest.approx(tau / 2, rel=0.01)
    reflected, transmitted = slab._fractions(tau, 60.0, HenyeyGreensteinPhase(0.0))
    # no order is above 30
    assert (reflected, transmitted) == (pytest.approx(100), pytest.approx(100))
    few = [slab._fractions(tau, 0.0, HenyeyGreensteinPhase(0.0)) for tau in (10.0, 40.0)]
    assert few[0][0] > few[1][0] > few[1][1]


def test_the_median_of_a_fit_leaves_out_what_is_dim(monkeypatch):
    exact, whole = np.array([1.0, 2.0, 1e-9, 4.0]), np.full(4, 4.0)
    fit = exact * np.array([1.1, 0.7, 9.0, 1.2])

    def curve(fit, exact):
        return TransportCurve(
            thickness=1.0,
            depth=0.0,
            orders="2",
            angle=exact,
            exact=exact,
            grid=exact,
            fit=fit,
            whole=whole,
        )

    monkeypatch.setattr(
        slab, "transport_curves", lambda: [curve(fit, exact), curve(exact, 1e-9 * exact)]
    )
    assert slab.transport_figures() == {"fit, median": pytest.approx(20.0)}


def test_depths_of_figure_8_lie_in_their_slabs_and_end_at_the_other_side():
    for thickness, depths in slab.PANELS:
        assert depths[0] == 0
        assert depths[-1] == thickness
        assert list(depths) == sorted(depths)
