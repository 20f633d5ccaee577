# SPDX-License-Identifier: BSD-3-Clause
"""Claim: radiance by sets of orders is that of photons and sums to DISORT's, and fractions
of a uniform sky add up.
"""

import math
import warnings
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import pytest
from numpy.typing import NDArray
from PythonicDISORT.pydisort import pydisort

from airlight.realtime.clouds.canonical.coordinates import SETS
from airlight.realtime.clouds.canonical.directional_moments import DirectionalMoments
from airlight.realtime.clouds.slab_orders.discrete_ordinates import double_gauss
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.realtime.clouds.uniform_sky import slab_escapes
from airlight.reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from airlight.reference.monte_carlo.slab_walk.walk import Slab, flights
from airlight.validation.slab.moments import FLUENCE, UP, SlabOrders, order_sets

# Photons by directions ----------------------------------------------------------------------------


Array = NDArray[np.float64]

#: photons of a batch at most; batches at least, so that errors are known to 9 %
_BATCH, _FEWEST = 25_000, 64


@dataclass(frozen=True)
class DirectionEstimate:
    """Means over bins, and their standard errors, (sets, depths, mu bins, phi bins) each.

    Parameters
    ----------
    radiance
        For unit flux across the beam [1/sr].
    x, y, square
        Mean displacement from the entry along the sun's horizontal direction and across, and mean of x^2 + y^2.
    """

    radiance: Array
    radiance_error: Array
    x: Array
    x_error: Array
    y: Array
    y_error: Array
    square: Array
    square_error: Array


def direction_estimate(
    slab: Slab,
    sets: Sequence[tuple[int, float]],
    *,
    mu_edges: Array,
    phi_edges: Array,
    photons: int,
    seed: int = 0,
    workers: int = 2,
) -> DirectionEstimate:
    """Estimate radiance in bins by a walk of photons.

    Parameters
    ----------
    slab
        The slab; its depths are where radiance is counted.
    sets
        First and last order of each set.
    mu_edges, phi_edges
        Increasing edges of bins: mu, positive upwards, and the azimuth from 0,
        along the sun's light, to pi.
    photons
        How many at least, in equal batches.
    seed
        The same seed gives the same numbers, whatever the number of workers.
    workers
        Threads.
    """
    batches = max(_FEWEST, math.ceil(photons / _BATCH))
    size = math.ceil(photons / batches)
    seeds = np.random.SeedSequence(seed).spawn(batches)

    def batch(number: int) -> Array:
        return _walk(slab, sets, mu_edges, phi_edges, size, np.random.default_rng(seeds[number]))

    with ThreadPoolExecutor(workers) as pool:
        sums = np.stack(list(pool.map(batch, range(batches))))
    # Both signs of the azimuth
    angles = 2 * np.diff(mu_edges)[:, None] * np.diff(phi_edges)
    values = sums / angles * slab.mu0
    mean = values.mean(0)
    safe = np.where(mean[0] > 0, mean[0], 1.0)

    def error(residuals: Array) -> Array:
        return np.asarray(np.sqrt((residuals**2).sum(0) / (batches * (batches - 1))))

    ratios = [mean[field] / safe for field in (1, 2, 3)]
    errors = [
        error((values[:, field] - ratio * values[:, 0]) / safe)
        for field, ratio in zip((1, 2, 3), ratios)
    ]
    (x, y, square), (x_error, y_error, square_error) = ratios, errors
    return DirectionEstimate(
        mean[0], error(values[:, 0] - mean[0]), x, x_error, y, y_error, square, square_error
    )


def _walk(
    slab: Slab,
    sets: Sequence[tuple[int, float]],
    mu_edges: Array,
    phi_edges: Array,
    photons: int,
    random: np.random.Generator,
) -> Array:
    """Return sums over a batch over its number of photons, (4, sets, depths, mu bins, phi bins)."""
    shape = (mu_edges.size - 1, phi_edges.size - 1)
    sums = np.zeros((4, len(sets), len(slab.depths), *shape))
    for order, (weight, (x, y, z), (u, v, w)) in enumerate(flights(slab, photons, random)):
        rows = [number for number, (first, last) in enumerate(sets) if first <= order <= last]
        if rows:
            places = _bins(-w, mu_edges) * shape[1] + _bins(np.arctan2(np.abs(v), u), phi_edges)
            for plane, depth in enumerate(slab.depths):
                before = np.where(w > 0, z < depth, z > depth)
                length = (depth - z[before]) / w[before]
                weights = weight * np.exp(-length) / np.abs(w[before])
                at_x, at_y = x[before] + u[before] * length, y[before] + v[before] * length
                moments = (1.0, at_x, at_y * np.sign(v[before]), at_x**2 + at_y**2)
                for field, moment in enumerate(moments):
                    counts = np.bincount(
                        places[before], weights * moment, shape[0] * shape[1]
                    ).reshape(shape)
                    for row in rows:
                        sums[field, row, plane] += counts
    return sums / photons


def _bins(values: Array, edges: Array) -> NDArray[np.intp]:
    return np.clip(np.searchsorted(edges, values, side="right") - 1, 0, edges.size - 2)


# Sets of orders -----------------------------------------------------------------------------------


HG = HenyeyGreensteinPhase(0.75)


def at_azimuths(modes, phi):
    """Return the four moments (sets, suns, depths, directions, azimuths): 1, x, y, x^2 + y^2."""
    m = np.arange(modes.shape[1])
    cosines, sines = np.cos(m[:, None] * phi), np.sin(m[:, None] * phi)
    twice, once = np.where(m > 0, 2.0, 1.0)[:, None], np.where(m > 0, 1.0, 0.5)[:, None]
    fields = (
        (modes[:, :, 0], cosines * twice),
        (modes[:, :, 1] + modes[:, :, 2], cosines * once),
        (modes[:, :, 1] - modes[:, :, 2], sines),
        (modes[:, :, 3], cosines * twice),
    )
    return [np.einsum("smlzk,mp->slzkp", each, wave) for each, wave in fields]


@pytest.mark.claim("clouds-moments-are-fluxes", tolerance="1e-5 relative: 32 streams against 64")
def test_integrals_over_directions_are_fluence_and_flux_with_their_moments():
    tau, mu0, depth = 3.0, 0.5, 1.3
    rule = double_gauss(16)
    modes = DirectionalMoments(HG, 0.97, rule.mu, modes=2, single=False)(tau, [mu0], [0.0, depth])[
        :, :, :, 0
    ]
    slab = SlabOrders(tau, mu0, HG, 0.97, depths=[depth])
    expected, _ = order_sets(slab, SETS)
    place = int(np.argmin(np.abs(slab.panels.edges - depth)))
    weights = 2 * np.pi * rule.weights
    for number, edges in enumerate(expected):
        inside, top = modes[number, 0, :, 1], modes[number, 0, :, 0]
        found = [(inside[field] * weights).sum() for field in (0, 1, 3)]
        assert found == pytest.approx(list(edges[FLUENCE, :, place]), rel=1e-6)
        upward = weights * np.maximum(rule.mu, 0)
        assert [(top[field] * upward).sum() for field in (0, 1, 3)] == pytest.approx(
            list(edges[UP, :, 0]), rel=1e-5
        )


@pytest.mark.claim(
    "clouds-radiance-is-disort", tolerance="1e-4 relative: single precision and 25 modes"
)
def test_sums_of_sets_and_order_one_are_disort():
    tau, mu0, albedo, streams = 2.0, 0.4, 0.9, 32
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        mu, *_, radiance = pydisort(
            tau, albedo, 2 * streams, 0.75 ** np.arange(2 * streams), mu0, np.pi, 0.0
        )
    chosen = np.array([3, 20, streams + 10, streams - 1])
    depths, azimuths = [0.0, 0.7, tau], np.array([0.3, 2.0])
    modes = DirectionalMoments(HG, albedo, mu[chosen], modes=40)(tau, [mu0], depths)
    total = at_azimuths(modes, azimuths)[0].sum(0)[0]
    theirs = (
        np.array([[[radiance(z, p)[place] for p in azimuths] for place in chosen] for z in depths])
        / np.pi
    )
    z, cosine = np.array(depths)[:, None, None], mu[chosen][:, None]
    order_one = first_order(tau, mu0, albedo, z, cosine, azimuths)
    seen = theirs > 1e-9
    np.testing.assert_allclose((total + order_one)[seen], theirs[seen], rtol=1e-4)


def first_order(tau, mu0, albedo, z, mu, phi):
    """Return single scattering in closed form."""
    angle = -mu * mu0 + np.sqrt((1 - mu**2) * (1 - mu0**2)) * np.cos(phi)
    source = albedo / (4 * np.pi) * HG.values(angle)
    rate = 1 / mu0 + 1 / mu
    up = (np.exp(-z / mu0) - np.exp(-tau / mu0 - (tau - z) / mu)) / (mu * rate)
    gap = np.where(np.abs(rate) < 1e-9, 1e-9, rate)
    down = (np.exp(-z / mu0) - np.exp(z / np.minimum(mu, -1e-9))) / (mu * gap)
    return source * np.where(mu > 0, up, down)


@pytest.mark.statistical
@pytest.mark.claim(
    "clouds-directions-are-photons",
    tolerance="4.5 standard errors: 1 false alarm in 1000 runs of 144",
)
def test_bins_of_directions_are_those_of_photons():
    tau, mu0, albedo, depth = 4.0, 0.7, 0.98, 1.5
    mu_edges, phi_edges = (
        np.array([-1.0, -0.8, -0.5, -0.2, 0.2, 0.5, 0.8, 1.0]),
        np.array([0.0, 0.6, 2.0, np.pi]),
    )
    sets = [SETS[0], SETS[2], SETS[4], SETS[7]]
    slab = Slab(tau, mu0, albedo, HenyeyGreenstein(0.75), [depth])
    walked = direction_estimate(
        slab, sets, mu_edges=mu_edges, phi_edges=phi_edges, photons=200_000, seed=3
    )
    nodes, weights = np.polynomial.legendre.leggauss(6)
    bins = [place for place in range(7) if place != 3]  # grazing photons have no finite variance
    mu = np.concatenate([(a + b) / 2 + (b - a) / 2 * nodes for a, b in pairwise(mu_edges)])
    phi = np.concatenate([(a + b) / 2 + (b - a) / 2 * nodes for a, b in pairwise(phi_edges)])
    moments = at_azimuths(DirectionalMoments(HG, albedo, mu)(tau, [mu0], [depth]), phi)
    m0, x, y, square = (
        np.einsum("smapb,a,b->smp", each[:, 0, 0].reshape(8, 7, 6, 3, 6), weights / 2, weights / 2)[
            [0, 2, 4, 7]
        ]
        for each in moments
    )
    for found, error, expected in (
        (walked.radiance, walked.radiance_error, m0),
        (walked.x, walked.x_error, x / m0),
        (walked.y, walked.y_error, y / m0),
        (walked.square, walked.square_error, square / m0),
    ):
        off = ((found[:, 0] - expected) / np.maximum(error[:, 0], 1e-300))[:, bins]
        assert np.abs(off).max() < 4.5
        assert math.sqrt(np.mean(off**2)) < 1.35


class _Peaked:
    """Isotropic, but for a fraction that goes straight on."""

    def __init__(self, fraction):
        self._fraction = fraction

    def moments(self, count):
        return np.append(1.0, np.full(count - 1, self._fraction))


def test_what_goes_straight_on_is_in_the_light_of_some_order():
    """All orders together are those of a medium without the peak, as much thinner."""
    streams, tau, mu0, fraction = 6, 2.0, 0.5, 0.7
    rule, reflected = double_gauss(streams), []
    up = rule.mu > 0
    mu, fluxes = rule.mu[up], 2 * np.pi * (rule.weights * rule.mu)[up]
    for peak, t in ((fraction, tau), (0.0, (1 - fraction) * tau)):
        slabs = DirectionalMoments(
            _Peaked(peak), 1.0, rule.mu, streams=streams, modes=1, nodes=4, single=False
        )
        radiance = slabs(t, [mu0], [0.0, t])[:, 0, 0, 0, 0].sum(0)[up]
        # Order 1, which is in no set: the part that the peak does not take.
        radiance += (1 - peak) / (4 * np.pi) * mu0 / (mu0 + mu) * -np.expm1(-t * (1 / mu0 + 1 / mu))
        reflected.append(float(radiance @ fluxes))
    assert reflected[0] == pytest.approx(reflected[1], rel=2e-4)


# A uniform sky ------------------------------------------------------------------------------------


PHASE = HenyeyGreensteinPhase(0.85)


@pytest.mark.parametrize("tau", [1e-3, 1.7, 60.0])
def test_every_path_leaves_where_nothing_is_absorbed(tau):
    np.testing.assert_allclose(slab_escapes(tau, PHASE, 1.0).sum(axis=1), 1.0, atol=1e-6)
    assert np.all(slab_escapes(tau, PHASE, 0.9).sum(axis=1) < 0.9 + 1e-9)


@pytest.mark.claim("uniform-sky-orders", tolerance="four standard errors of 200 000 photons")
def test_shares_are_those_of_photons():
    """Isotropic photons that enter at mu = 1: how often they are scattered until they leave."""
    random, tau, count = np.random.default_rng(5), 2.3, 200_000
    depth, mu, orders = np.zeros(count), np.ones(count), np.zeros(count, dtype=int)
    inside = np.ones(count, dtype=bool)
    while inside.any():
        depth[inside] += mu[inside] * random.exponential(size=inside.sum())
        inside &= (depth > 0) & (depth < tau)
        orders[inside] += 1
        mu[inside] = random.uniform(-1, 1, inside.sum())
    scattered = orders[orders > 0]
    fractions = slab_escapes(tau, HenyeyGreensteinPhase(0.0), 1.0)[-1]
    firsts = [1, 2, 3, 5, 7, 9, 13]
    counted = np.histogram(scattered, bins=[*firsts, np.inf])[0] / len(scattered)
    error = 4 * np.sqrt(counted / len(scattered))
    assert np.all(np.abs(counted[:-1] - fractions[:6]) < error[:-1] + 1e-4)
