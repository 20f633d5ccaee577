# SPDX-License-Identifier: BSD-3-Clause
"""Light of a uniform sky by order: shares of paths that leave a slab, against photons and closed forms."""

import numpy as np
import pytest

from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from realtime.clouds.uniform_sky import slab_escapes

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
    shares = slab_escapes(tau, HenyeyGreensteinPhase(0.0), 1.0)[-1]
    firsts = [1, 2, 3, 5, 7, 9, 13]
    counted = np.histogram(scattered, bins=[*firsts, np.inf])[0] / len(scattered)
    error = 4 * np.sqrt(counted / len(scattered))
    assert np.all(np.abs(counted[:-1] - shares[:6]) < error[:-1] + 1e-4)
