# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the light of a slab by orders agrees with published tables and, summed over
all orders, with DISORT.
"""

import math
import warnings
from pathlib import Path

import numpy as np
import pytest
from numpy.polynomial.legendre import legval
from PythonicDISORT.pydisort import pydisort

from airlight.realtime.clouds.slab_orders.phases import AnglePhase, HenyeyGreensteinPhase
from airlight.validation.slab.light import slab_numbers
from airlight.validation.slab.moments import DOWN, UP, SlabOrders, order_sets
from airlight.validation.slab.radiance import slab_radiance
from airlight.validation.slab.request import slab_request

DATA = Path(__file__).parents[2] / "data"
ALL = [(1, math.inf)]
ISOTROPIC, HG = HenyeyGreensteinPhase(0.0), HenyeyGreensteinPhase(0.75)


@pytest.fixture(scope="module")
def cloud_c1():
    table = np.loadtxt(DATA / "cloud_c1_moments.csv", delimiter=",", skiprows=3)
    return AnglePhase(lambda angles: legval(np.cos(angles), table[:, 1]), np.array([0.0, np.pi]))


def summed(tau, mu0, phase, albedo, depths, streams=32):
    """Return upward and diffuse downward flux at depths, of all orders, for a
    flux of pi across the beam.
    """
    slab = SlabOrders(tau, mu0, phase, albedo, depths=depths, streams=streams)
    _, total = order_sets(slab, ALL)
    places = [int(np.argmin(np.abs(slab.panels.edges - depth))) for depth in depths]
    return np.pi * total[UP, 0, places], np.pi * total[DOWN, 0, places]


def disort(tau, mu0, phase, albedo, *, streams):
    """Return PythonicDISORT's functions, of `streams` cosines in each hemisphere."""
    moments = phase.moments(2 * streams + 1)
    peak = moments[-1] if moments[-1] > 1e-13 else 0.0
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return pydisort(tau, albedo, 2 * streams, moments[None, :-1], mu0, np.pi, 0.0, f_arr=peak)


@pytest.mark.claim(
    "slab-sums-are-disort", tolerance="1e-5 of the flux, the figure; measured 1e-6 and below"
)
@pytest.mark.parametrize(
    ("albedo", "mu0"),
    [
        (0.9, 0.6),
        (1 - 1e-6, 0.2),
        *(
            pytest.param(albedo, mu0, marks=pytest.mark.slow)
            for albedo in (0.2, 0.99)
            for mu0 in (0.2, 1.0)
        ),
    ],
)
def test_sums_of_orders_are_disort(albedo, mu0):
    """Nearer to 1 DISORT's eigenvalues k^2 lose 1e-5 of the light, as processors
    round; another test is at 1.
    """
    for tau, phase in ((2.0, ISOTROPIC), (7.3, HG)):
        depths = [0.0, 0.3, tau / 2, tau]
        up, down = summed(tau, mu0, phase, albedo, depths)
        _, disort_up, disort_down, _, _ = disort(tau, mu0, phase, albedo, streams=16)
        assert up[:-1] == pytest.approx(disort_up(np.array(depths[:-1])), rel=1e-5)
        assert down[1:] == pytest.approx(disort_down(np.array(depths[1:]))[0], rel=1e-5)


@pytest.mark.claim("slab-radiance-is-disort", tolerance="1e-6 relative; measured 2e-7")
def test_radiance_inside_and_outside_is_disort():
    tau, mu0, albedo, streams = 2.0, 0.4, 0.9, 32
    mu, *_, radiance = disort(tau, mu0, HG, albedo, streams=streams)
    chosen = [(3, 0.3), (20, 2.0), (streams + 10, 1.0), (streams - 1, 3.1)]
    depths = [0.0, 0.7, tau]
    ours = slab_radiance(
        tau,
        mu0,
        HG,
        albedo,
        depths=depths,
        directions=[(mu[place], phi) for place, phi in chosen],
        streams=48,
    )
    theirs = np.array([[radiance(depth, phi)[place] for place, phi in chosen] for depth in depths])
    np.testing.assert_allclose(np.pi * ours, theirs, rtol=1e-6, atol=1e-12)


@pytest.mark.claim("slab-published", tolerance="2e-5 relative: five to six printed digits")
def test_fluxes_of_cloud_c1(cloud_c1):
    """Garcia and Siewert 1985, Tables 19 and 20; DISORT's test 5."""
    up, down = summed(64.0, 1.0, cloud_c1, 1.0, [0.0, 32.0, 64.0])
    assert up[:2] == pytest.approx([2.66174, 1.76783], rel=2e-5)
    assert down[1:] == pytest.approx([2.24768, 0.479851], rel=2e-5)
    assert up[0] + down[-1] == pytest.approx(math.pi, rel=1e-9)
    up, down = summed(64.0, 1.0, cloud_c1, 0.9, [3.2, 12.8, 48.0])
    assert up == pytest.approx([0.270485, 0.0374252, 1.02904e-5], rel=2e-5)
    assert down == pytest.approx([1.74767, 0.233975, 6.38345e-5], rel=2e-5)


@pytest.mark.claim("slab-orders-add-up", tolerance="1e-9 relative: rounding of the direct solution")
def test_orders_one_by_one_add_up_to_all_and_the_rest_is_the_rest():
    slab = SlabOrders(6.0, 0.5, HG, 0.95, depths=[2.0], streams=16)
    singles, total = order_sets(slab, [(order, order) for order in range(1, 41)] + [(41, math.inf)])
    _, at_once = order_sets(slab, ALL)
    np.testing.assert_allclose(singles.sum(axis=0), total, rtol=1e-13, atol=1e-300)
    np.testing.assert_allclose(singles.sum(axis=0), at_once, rtol=1e-9, atol=1e-13)
    (pair, thirds), _ = order_sets(slab, [(1, 2), (3, 3)])
    np.testing.assert_allclose(pair, singles[0] + singles[1], rtol=1e-14)
    np.testing.assert_allclose(thirds, singles[2], rtol=1e-14)


def test_order_one_is_its_closed_form():
    """Reflected isotropic light of order 1, and its displacement, by
    quadrature over depth and angle.
    """
    tau, mu0, albedo = 1.7, 0.6, 0.8
    depth, depth_weight = (each / 2 for each in np.polynomial.legendre.leggauss(60))
    depth, depth_weight = tau * (depth + 0.5), tau * depth_weight
    mu, mu_weight = np.polynomial.legendre.leggauss(400)
    mu, mu_weight = (mu + 1) / 2, mu_weight / 2
    rate = albedo / (2 * mu0) * np.exp(-depth[:, None] / mu0 - depth[:, None] / mu)
    weight = depth_weight[:, None] * mu_weight * rate
    tangent0, tangent = math.sqrt(1 - mu0**2) / mu0, np.sqrt(1 - mu**2) / mu
    square = (depth**2)[:, None] * (tangent0**2 + tangent**2)
    reflected = weight.sum()
    (found,) = slab_numbers(
        slab_request(tau, math.degrees(math.acos(mu0)), albedo=albedo, orders="1")
    )["orders"]
    assert found["reflectance"] == pytest.approx(reflected, rel=1e-6)
    assert found["reflected_mean"] == pytest.approx(
        (weight.sum(1) @ depth) * tangent0 / reflected, rel=1e-6
    )
    assert found["reflected_rms"] == pytest.approx(
        math.sqrt((weight * square).sum() / reflected), rel=1e-5
    )


@pytest.mark.claim("slab-conserves", tolerance="1e-8: the albedo is kept 1e-12 below 1")
@pytest.mark.parametrize(
    ("tau", "suns"),
    [
        (3.0, [0.5]),
        *(
            pytest.param(tau, [1e-3, 0.5, 1.0], marks=pytest.mark.slow)
            for tau in (1e-4, 0.01, 3.0, 300.0)
        ),
    ],
)
def test_light_is_neither_made_nor_lost(tau, suns):
    for mu0 in suns:
        light = slab_numbers(
            slab_request(tau, math.degrees(math.acos(mu0)), phase="hg:0.75", orders="all")
        )["total"]
        assert light["reflectance"] + light["transmittance"] == pytest.approx(1, abs=1e-8)
        assert light["reflectance"] > 0
