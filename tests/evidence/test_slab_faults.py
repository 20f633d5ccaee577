# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a fault of the physics injected into either side of the slab is seen beside the other side.

The control, both sides as they are, agrees.
"""

import math

import numpy as np
import pytest

from realtime.clouds.slab_orders import moments
from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from reference.monte_carlo.slab_walk import estimates
from reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from reference.monte_carlo.slab_walk.walk import Slab
from tests.evidence.injected import Rewrite, injected

TAU, MU0, ALBEDO, DEPTH = 1.5, 0.6, 0.8, 0.5
SETS = [(1, 1), (2, 2), (3, math.inf)]
MOMENTS = "realtime.clouds.slab_orders.moments"
WALK = "reference.monte_carlo.slab_walk.walk"

FAULTS = {
    "four pi": (MOMENTS, "albedo / (4 * np.pi)", "albedo / 4"),
    "order off by one": (MOMENTS, "all_[first - 1 : last_]", "all_[max(first - 2, 0) : last_]"),
    "the rest from the wrong order": (MOMENTS, "slab.rest(fields_)", "slab.rest(slab.beam())"),
    "first moment without what is travelled": (MOMENTS, "sources.a0 + lengths_ * b_", "sources.a0"),
    "modes of the azimuth exchanged": (MOMENTS, "sources.a1 + lengths_ * b0", "sources.a1 + lengths_ * b1"),
    "second moment by half": (MOMENTS, "sources.c0 + 2 * lengths_ * a_", "sources.c0 + lengths_ * a_"),
    "absorbed once too often": (WALK, "rows.append(row * weight_)", "rows.append(row * weight_ * slab.albedo)"),
    "passages for fluence": (WALK, "(moments_ / np.abs(w_)).sum(-1)", "moments_.sum(-1)"),
    "no azimuth": (WALK, "2 * np.pi * random.random(count_)", "np.pi * random.random(count_)"),
    "distance from the axis": (WALK, "x_ * x_ + at_y * at_y", "x_ * x_"),
}


def computed():
    slab = moments.SlabOrders(TAU, MU0, HenyeyGreensteinPhase(0.5), ALBEDO, depths=[DEPTH], streams=16)
    sets, _ = moments.order_sets(slab, SETS)
    place = int(np.argmin(np.abs(slab.panels.edges - DEPTH)))
    rows = [row for edges in sets for row in (edges.up[:, 0] / MU0, edges.down[:, -1] / MU0, edges.fluence[:, place])]
    return np.array([[amount, first / amount, math.sqrt(abs(second / amount))] for amount, first, second in rows])


def walked():
    slab = Slab(TAU, MU0, ALBEDO, HenyeyGreenstein(0.5), [DEPTH])
    light = estimates.slab_estimate(slab, SETS, photons=60_000, seed=11)
    exits = [each for row in light.sets for each in (row.reflected, row.transmitted, *row.fluence)]
    parts = [[exit_.value, exit_.mean, exit_.rms] for exit_ in exits]
    return np.array([[[part.value, part.error] for part in row] for row in parts])


def largest_z(values, photons):
    return np.abs((values - photons[..., 0]) / photons[..., 1]).max()


@pytest.mark.statistical
def test_both_sides_agree_as_they_are():
    assert largest_z(computed(), walked()) < 4.5


@pytest.mark.statistical
@pytest.mark.claim(
    "slab-orders-are-photons", tolerance="each of ten faults moves a number by 6 standard errors or more"
)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_seen(fault):
    with injected(Rewrite(*FAULTS[fault])):
        assert largest_z(computed(), walked()) > 6
