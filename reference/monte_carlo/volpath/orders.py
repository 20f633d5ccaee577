# SPDX-License-Identifier: BSD-3-Clause
"""Clouds by order of scattering with Mitsuba's `volpath`: one more edge of the paths is one more order.

Runs with `max_depth` n + 1 and n, with equal seeds, share their paths up to order n - 1, so their difference is order n
alone, to rounding. Surfaces are black in these runs; all light with their own materials, less all without, is what met
a surface. `hide_emitters` is not used: the sky behind the clouds is in every run and cancels.
"""

import math
from collections.abc import Sequence
from typing import Any, cast

import mitsuba as mi
import numpy as np

from reference.monte_carlo.batches import Batches, check_samples, single_batch
from reference.monte_carlo.volpath.integrator import black_surfaces, trace
from reference.scene.clouds import CloudScene
from reference.scene.read import ReferenceScene


def volpath_orders_batch(
    clouds: CloudScene, seed: int, samples: int, *, sets: Sequence[tuple[str, tuple[int, float]]]
) -> Batches:
    """Trace one batch of the layers `airlight`, `surface` and those of sets of orders.

    `clouds`: the scene; `seed`: seed of the batch; different seeds are independent; `samples`: samples a pixel, at most
    256; `sets`: names of sets of orders with their first and last order, the last `math.inf` for one without end.
    """
    check_samples(samples)
    reference = ReferenceScene(
        scene=clouds.scene,
        occluders=clouds.occluders,
        width=clouds.width,
        height=clouds.height,
        origin=clouds.origin,
        direction=clouds.direction,
        medium=clouds.around,
        lights=(),
        media=cast(Any, clouds.clouds),  # asked for what every medium has
    )
    counts = np.full(len(clouds.direction), samples)

    def up_to(order: float):
        depth = -1 if math.isinf(order) else int(order) + 1
        integrator = mi.load_dict({"type": "volpath", "max_depth": depth, "rr_depth": 1 << 20})
        return trace(reference, integrator, seed, counts)

    wanted = {0, math.inf} | {end for _, (first, last) in sets for end in (first - 1, last)}
    with black_surfaces(clouds.occluders):
        sums = {order: up_to(order) for order in sorted(wanted)}
    airlight = sums[math.inf] - sums[0]
    surface = up_to(math.inf) - sums[math.inf] if clouds.occluders.shapes() else np.zeros_like(airlight)
    by_set = [sums[last] - sums[first - 1] for _, (first, last) in sets]
    names = ("airlight", "surface", *("airlight_" + name.replace("-", "_") for name, _ in sets))
    return single_batch(seed, samples, np.stack([airlight, surface, *by_set]), layers=names)
