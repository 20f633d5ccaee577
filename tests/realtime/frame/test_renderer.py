# SPDX-License-Identifier: BSD-3-Clause
"""A frame's airlight is the integral of the reference; marching converges to it, and shadow maps to shadow rays."""

import numpy as np
import pytest

from tests.helpers.frames import frame, reference_of, relative_rmse
from tests.helpers.scenes import spot, tiny_scene

SCENES = {
    "grey": dict,
    "hard spot": lambda: {"lamp": spot()},
    "soft spot": lambda: {"lamp": spot(cutoff=37.0, beam=19.0)},
    "two lights, colour, HG": lambda: {
        "spot": spot(beam=11.0),
        "fog": {
            "type": "homogeneous",
            "id": "fog",
            "sigma_t": {"type": "rgb", "value": [0.1, 0.4, 0.9]},
            "albedo": 0.83,
            "phase": {"type": "hg", "g": 0.53},
        },
    },
    "tabulated": lambda: {
        "fog": tiny_scene()["fog"] | {"phase": {"type": "tabphase", "values": "0.3, 0.2, 0.4, 0.9, 2.0"}}
    },
}


def render(method, *, scene=None, **options):
    return frame(scene or tiny_scene(), method, **options)


def without_shadows(name):
    return tiny_scene(ball=None, floor=None, **SCENES[name]())


@pytest.mark.claim("unshadowed-integral")
@pytest.mark.parametrize(("name", "kernel"), [*((name, "exact") for name in SCENES), ("grey", "quadrature")])
def test_integral_without_shadows_is_that_of_the_reference(variant, name, kernel):
    """Two routes that share no code."""
    scene = without_shadows(name)
    integral = render("unshadowed", kernel=kernel, precision="double", scene=scene).airlight
    # Kernels promise 1e-6. Sixteen nodes a panel know nothing of the kinks of a coarse phase table: 1e-3.
    assert relative_rmse(integral, reference_of(scene).airlight) < (1e-3 if name == "tabulated" else 1e-6)


# Uniform steps see their order later: an unbounded ray is 65 m long, and the light 4 m away.
@pytest.mark.slow
@pytest.mark.claim("march-orders", tolerance="order 2 within 0.15")
@pytest.mark.parametrize(("spacing", "first"), [("equiangular", 32), ("uniform", 512)])
def test_marching_is_of_second_order_without_shadows(variant, spacing, first):
    # Away from the light, where few steps are enough to see the order.
    scene = tiny_scene(ball=None, lamp=tiny_scene()["lamp"] | {"position": [2.9, 1.3, 3.7]})
    exact = render("unshadowed", kernel="quadrature", precision="double", scene=scene).airlight
    steps = first * np.array([1, 2, 4, 8])
    errors = [
        relative_rmse(
            render("ray-march", precision="double", scene=scene, steps=int(n), spacing=spacing, shadow="none").airlight,
            exact,
        )
        for n in steps
    ]
    slope = np.polyfit(np.log(steps), np.log(errors), 1)[0]
    assert slope == pytest.approx(-2, abs=0.15)  # the midpoint rule


@pytest.mark.claim("march-maps", tolerance="2e-3 at the largest map")
def test_shadow_map_converges_to_shadow_rays(variant):
    scene = tiny_scene(size=(48, 36), spot=spot(beam=20.0))
    rays = render("ray-march", scene=scene, steps=200).airlight
    errors = [
        relative_rmse(render("ray-march", scene=scene, steps=200, shadow="map", map=size).airlight, rays)
        for size in (16, 128, 1024)
    ]
    assert errors == sorted(errors, reverse=True)
    assert errors[-1] < 2e-3
    assert render("ray-march", scene=scene, shadow="none").airlight.sum() > rays.sum()
