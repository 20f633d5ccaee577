# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the grid as it is used keeps to its figure; apart from tests that
compute with few streams.
"""

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from airlight.realtime.clouds.canonical.coordinates import LOWEST_SUN, SETS, THICKEST, THINNEST
from airlight.realtime.clouds.canonical.transport_grid import canonical_transport, on_device
from airlight.realtime.numerics.array_types import array_types
from airlight.validation.slab.phases import phase_pair
from tests.realtime.clouds.canonical.test_transport_grid import transport_at, values


def random_slabs(count, together=16):
    """Return points t, d, mu, phi and mu_l, (5, together) each: those of a
    slab share its computation.
    """
    random = np.random.default_rng(0)
    for _ in range(count // together):
        t, mu_l = (
            np.exp(random.uniform(np.log(THINNEST), np.log(THICKEST))),
            random.uniform(LOWEST_SUN, 1),
        )
        d, mu, phi = (
            np.sort(random.uniform(0, t, together)),
            *random.uniform([[-1], [0]], [[1], [2 * np.pi]], (2, together)),
        )
        yield np.stack([np.full(together, t), d, mu, phi, np.full(together, mu_l)])


def transport_in(slab, phase):
    """Return the transport with more streams and modes than the grid is made of, and in float64."""
    streams = next(
        count for below, count in ((0.3, 64), (10.0, 48), (np.inf, 40)) if slab[0, 0] < below
    )
    return transport_at(1.0, *slab, phase=phase, streams=streams, modes=47)


@pytest.mark.slow
@pytest.mark.claim(
    "clouds-grid-figure", tolerance="2 % of T and 3 % of sigma in c at half of 480 points, each set"
)
def test_the_whole_grid_keeps_to_its_figure(variant):
    phase = phase_pair("mie-modified").deterministic
    transport = canonical_transport(phase, 1.0)
    assert transport.size <= 50e6
    look_up, slabs = on_device(transport, array_types("single")), list(random_slabs(480))
    with ThreadPoolExecutor(2) as pool:
        exact = np.concatenate(
            list(pool.map(lambda slab: transport_in(slab, phase), slabs)), axis=-1
        )
    for number, (T, x, y, sigma) in enumerate(exact.swapaxes(0, 1)):
        # A set that holds less of the light at a point is left out there.
        seen = (1e-6 * exact[0].sum(0) < T) & (sigma > 0)
        found = values(look_up, number, *np.concatenate(slabs, axis=-1))[:, seen]
        assert np.median(np.abs(found[0] / T[seen] - 1)) <= 0.02
        assert np.median(np.hypot(found[1] - x[seen], found[2] - y[seen]) / sigma[seen]) <= 0.03
    assert len(exact[0]) == len(SETS)
