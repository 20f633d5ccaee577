# SPDX-License-Identifier: BSD-3-Clause
"""Claim: looked up, the grid of canonical transport gives what it was made of, and what
lies outside is defined.
"""

import drjit as dr
import numpy as np
import pytest

import airlight.realtime.clouds.canonical.transport_grid as grid_module
from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.canonical.directional_moments import DirectionalMoments
from airlight.realtime.clouds.canonical.transport_grid import canonical_transport, on_device
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.realtime.numerics.array_types import array_types

PHASE, ALBEDO = HenyeyGreensteinPhase(0.5), 0.95
SIDES = (11, 7, 5, 13, 5)
#: of the computation on both sides: what is tested here is what lies between entries
STREAMS, MODES = 8, 8


def transport_at(albedo, t, d, mu, phi, mu_l, *, phase=PHASE, streams=STREAMS, modes=MODES):
    """Return T, c_x, c_y and sigma by set at points of one slab, (4, sets, N)."""
    how = {"streams": streams, "modes": modes, "nodes": 5, "negligible": 1e-5, "single": False}
    slabs = DirectionalMoments(phase, albedo, mu, **how)
    thickness = float(np.max(t))
    suns, of_point = np.unique(mu_l, return_inverse=True)
    place = np.arange(d.size)
    modes = slabs(thickness, suns, list(d))[:, :, :, of_point, place, place]
    m = np.arange(modes.shape[1])[:, None]
    cosines, sines = np.cos(m * phi), np.sin(m * phi)
    twice, once = np.where(m > 0, 2.0, 1.0), np.where(m > 0, 1.0, 0.5)
    T = (modes[:, :, 0] * cosines * twice).sum(1)
    x = ((modes[:, :, 1] + modes[:, :, 2]) * cosines * once).sum(1)
    y = ((modes[:, :, 1] - modes[:, :, 2]) * sines).sum(1)
    square = (modes[:, :, 3] * cosines * twice).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        x, y = x / T, y / T
        sigma = np.sqrt(np.maximum(square / T - x * x - y * y, 0.0) / 2)
    return np.stack([T, -x, -y, sigma])


@pytest.fixture(scope="module")
def transport(tmp_path_factory):
    """Compute with few streams: the grid and what it is compared with err alike;
    read it from the cache, too.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(grid_module, "_STREAMS", ((np.inf, STREAMS),))
        patch.setattr(grid_module, "_MODES", MODES)
        patch.setattr(grid_module, "SIDES", SIDES)
        patch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path_factory.mktemp("cache")))
        made, cached = (canonical_transport(PHASE, ALBEDO) for _ in range(2))
        np.testing.assert_equal(vars(cached), vars(made))
        yield cached


@pytest.fixture(scope="module")
def look_up(variant, transport):
    return on_device(transport, array_types())


def values(look_up, number, t, d, mu, phi, mu_l):
    Float = array_types().scalar
    arrays = np.broadcast_arrays(*map(np.atleast_1d, (t, d, mu, np.cos(phi), np.sin(phi), mu_l)))
    results = look_up(number, *(Float(np.array(each, dtype=np.float64)) for each in arrays))
    dr.eval(results)
    return np.array(results, dtype=np.float64)


@pytest.mark.claim(
    "clouds-look-up", tolerance="0.5 % of T and sigma: half precision of entries up to 8"
)
def test_at_entries_look_ups_are_the_computation(look_up):
    t = coordinates.thicknesses(SIDES[0])[6]
    d, mu = (
        coordinates.depths(SIDES[1], t)[[1, 3, 5]],
        np.sin(np.pi * (np.array([2, 3, 10]) / 12 - 0.5)),
    )
    mu_l, phi = coordinates.suns(SIDES[2])[1:4], np.array([1, 5, 2]) * np.pi / 4
    exact = transport_at(ALBEDO, np.full(3, t), d, mu, phi, mu_l)
    for number in (0, 4, 7):
        T, c_x, c_y, sigma = values(look_up, number, t, d, mu, phi, mu_l)
        assert pytest.approx(exact[0, number], rel=5e-3) == T
        assert sigma == pytest.approx(exact[3, number], rel=5e-3)
        off = np.hypot(c_x - exact[1, number], c_y - exact[2, number]) / exact[3, number]
        assert off.max() < 0.01


@pytest.mark.claim("clouds-outside")
def test_outside_the_grid_what_happens_is_what_the_page_says(look_up):
    t, d, mu_l = np.array(
        [
            (2, 9, 0.7),
            (2, 2, 0.7),
            (2, -1, 0.7),
            (2, 0, 0.7),
            (0.001, 0.0005, 0.7),
            (0.01, 0.005, 0.7),
            (1000, 35, 0.7),
            (200, 7, 0.7),
            (2, 1, 0.02),
            (2, 1, 0.01),
            (2, 1, -0.3),
        ]
    ).T
    for number in (0, 7):
        below, floor, above, top, thin, thinnest, thick, thickest, low, lower, night = values(
            look_up, number, t, d, np.where(t == 2, 0.6, -0.6), 0.4, mu_l
        ).T
        np.testing.assert_array_equal(below, floor)
        np.testing.assert_array_equal(above, top)
        np.testing.assert_allclose(thin[1:], thinnest[1:], rtol=0.05, atol=0.01)
        assert thin[0] <= 0.2 * thinnest[0]
        np.testing.assert_allclose(thick, thickest, rtol=1e-3)
        np.testing.assert_allclose(lower, [0.5 * low[0], *low[1:]], rtol=1e-4)
        np.testing.assert_allclose(night, [0, *low[1:]], rtol=1e-4)
