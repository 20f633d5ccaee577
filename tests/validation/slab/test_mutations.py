# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the tests: a fault of the physics in a copy of either side of the slab is seen beside the other side.

The control, both sides as they are, agrees.
"""

import math
from types import ModuleType

import numpy as np
import pytest

from realtime.clouds.slab_orders import moments
from realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from reference.monte_carlo.slab_walk import estimates
from reference.monte_carlo.slab_walk.scattering import HenyeyGreenstein
from reference.monte_carlo.slab_walk.walk import Slab
from validation.mutations.module_copies import replaced_once

TAU, MU0, ALBEDO, DEPTH = 1.5, 0.6, 0.8, 0.5
SETS = [(1, 1), (2, 2), (3, math.inf)]
MOMENTS = "realtime.clouds.slab_orders.moments"
WALK = "reference.monte_carlo.slab_walk.walk"

FAULTS = {
    "four pi": (MOMENTS, "albedo / (4 * np.pi)", "albedo / 4"),
    "order off by one": (MOMENTS, "first - 1 : int(last) if", "max(first - 2, 0) : int(last) if"),
    "the rest from the wrong order": (MOMENTS, "slab.rest(fields)", "slab.rest(slab.beam())"),
    "first moment without what is travelled": (MOMENTS, "sources.a0 + lengths * b1", "sources.a0"),
    "modes of the azimuth exchanged": (MOMENTS, "sources.a1 + lengths * b0", "sources.a1 + lengths * b1"),
    "second moment by half": (MOMENTS, "sources.c0 + 2 * lengths * a1", "sources.c0 + lengths * a1"),
    "absorbed once too often": (WALK, "rows.append(row * weight)", "rows.append(row * weight * slab.albedo)"),
    "passages for fluence": (WALK, "(moments / np.abs(w)).sum(-1)", "moments.sum(-1)"),
    "no azimuth": (WALK, "2 * np.pi * random.random(x.size)", "np.pi * random.random(x.size)"),
    "distance from the axis": (WALK, "at_x * at_x + at_y * at_y", "at_x * at_x"),
}


def copy_of(name: str, old: str, new: str) -> ModuleType:
    changed = ModuleType("changed")
    exec(compile(replaced_once(name, old, new), name, "exec"), changed.__dict__)
    return changed


def computed(module):
    slab = module.SlabOrders(TAU, MU0, HenyeyGreensteinPhase(0.5), ALBEDO, depths=[DEPTH], streams=16)
    sets, _ = module.order_sets(slab, SETS)
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
    assert largest_z(computed(moments), walked()) < 4.5


@pytest.mark.statistical
@pytest.mark.claim(
    "slab-orders-are-photons", tolerance="each of ten faults moves a number by 6 standard errors or more"
)
@pytest.mark.parametrize("fault", FAULTS)
def test_a_fault_is_seen(fault, monkeypatch):
    changed = copy_of(*FAULTS[fault])
    if FAULTS[fault][0] == WALK:
        monkeypatch.setattr(estimates, "walk", changed.walk)
        assert largest_z(computed(moments), walked()) > 6
    else:
        assert largest_z(computed(changed), walked()) > 6
