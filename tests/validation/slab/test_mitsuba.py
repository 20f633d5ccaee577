# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the orders of a slab are those of Mitsuba's path tracer, which others wrote, isolated by its `max_depth`."""

import mitsuba as mi
import numpy as np
import pytest

from validation.slab.light import slab_numbers
from validation.slab.request import slab_request

TAU, SUN, G, ALBEDO = 1.5, 50.0, 0.5, 0.9
_WIDE = 2e4  #: of the slab and its thickness 1.5: what a cosine above 1e-4 sees
_SEEDS, _SAMPLES = 32, 1 << 15


def irradiance(scene, integrator, seed):
    image = mi.render(scene, integrator=integrator, spp=_SAMPLES, seed=seed)
    return float(np.asarray(image, dtype=np.float64)[..., 0].mean())


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.claim("slab-orders-are-mitsubas", tolerance="4.5 standard errors of 32 seeds; seeds are fixed")
@pytest.mark.parametrize("side", ["reflectance", "transmittance"])
def test_orders_are_those_of_volpath(variant, side):
    """A meter above or below the slab, which light passes, sees the flux; depth n + 1 less depth n is order n."""
    above = side == "reflectance"
    turn = mi.ScalarTransform4f().rotate([1, 0, 0], 180 if above else 0)
    meter = {
        "type": "irradiancemeter",
        "film": {"type": "hdrfilm", "width": 1, "height": 1, "rfilter": {"type": "box"}, "component_format": "float32"},
        "sampler": {"type": "independent"},
    }
    sun = np.deg2rad(SUN)
    scene = mi.load_dict(
        {
            "type": "scene",
            "sun": {"type": "directional", "direction": [np.sin(sun), 0, -np.cos(sun)], "irradiance": 1.0},
            "slab": {
                "type": "cube",
                "to_world": mi.ScalarTransform4f().scale([_WIDE, _WIDE, TAU / 2]),
                "bsdf": {"type": "null"},
                "interior": {
                    "type": "homogeneous",
                    "sigma_t": 1.0,
                    "albedo": ALBEDO,
                    "phase": {"type": "hg", "g": G},
                },
            },
            "meter": {
                "type": "rectangle",
                "to_world": mi.ScalarTransform4f().translate([0, 0, TAU if above else -TAU]) @ turn,
                "bsdf": {"type": "null"},
                "sensor": meter,
            },
        }
    )
    orders = (1, 2, 3)
    by_depth = {
        depth: mi.load_dict({"type": "volpath", "max_depth": depth, "rr_depth": 1_000_000})
        for depth in range(1, max(orders) + 2)
    }
    measured = np.array(
        [[irradiance(scene, integrator, seed) for seed in range(_SEEDS)] for integrator in by_depth.values()]
    ) / np.cos(sun)
    by_order = np.diff(measured, axis=0)
    numbers = slab_numbers(slab_request(TAU, SUN, phase=f"hg:{G}", albedo=ALBEDO, orders=orders))
    for order, values in zip(orders, by_order, strict=True):
        error = values.std(ddof=1) / np.sqrt(_SEEDS)
        expected = numbers["orders"][order - 1][side]
        assert values.mean() == pytest.approx(expected, abs=4.5 * error), order
        assert error < 0.01 * expected
