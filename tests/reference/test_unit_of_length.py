# SPDX-License-Identifier: BSD-3-Clause
"""A scene has the same light in every unit of length: powers of two scale all numbers exactly."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.single_scatter.integrator import single_scatter_batch
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene.read import read_reference
from tests.helpers.area_lights import GREY, lamp
from tests.helpers.scenes import bounded_medium


def moved():
    return mi.ScalarTransform4f()


LAMPS = {
    "point": lambda s: {
        "type": "point",
        "position": [0.9 * s, 0.7 * s, 1.9 * s],
        "intensity": {"type": "rgb", "value": [5 * s * s, 4 * s * s, 3 * s * s]},
    },
    "sun": lambda s: {"type": "directional", "direction": [-0.3, 0.5, -0.7], "irradiance": 4.0},
    "area": lambda s: lamp(
        to_world=moved().look_at([0.9 * s, 0.7 * s, 2.4 * s], [0, 0, 0], [0, 1, 0]).scale(0.3 * s)
    ),
    "mesh": lambda s: lamp(
        "cube", to_world=moved().translate([0.9 * s, 0.7 * s, 2.4 * s]).scale(0.2 * s)
    ),
}


def scene(light, s):
    """Return a body of fog about shapes; the floor and one boundary hold the origin."""
    view = moved().look_at([0.2 * s, -4.1 * s, 1.3 * s], [0.1 * s, 0, 0.6 * s], [0, 0, 1])
    film = {"type": "hdrfilm", "width": 12, "height": 9, "rfilter": {"type": "box"}}
    tower = moved().translate([0.6 * s, 0.3 * s, 0.9 * s]).scale([0.2 * s, 0.1 * s, 0.3 * s])
    body = {"type": "cube", "to_world": moved().translate([-1.6 * s, 0, 1.5 * s]).scale(1.6 * s)}
    return read_reference(
        mi.load_dict(
            {
                "type": "scene",
                "sensor": {
                    "type": "perspective",
                    "fov": 49.0,
                    "near_clip": 1e-4 * s,
                    "far_clip": 1e3 * s,
                    "to_world": view,
                    "film": film,
                },
                "ball": {
                    "type": "sphere",
                    "center": [0.1 * s, 0.1 * s, 0.7 * s],
                    "radius": 0.41 * s,
                    "bsdf": GREY,
                },
                "tower": {"type": "cube", "to_world": tower, "bsdf": GREY},
                "floor": {"type": "rectangle", "to_world": moved().scale(2.3 * s), "bsdf": GREY},
                "body": bounded_medium(body, 0.31 / s, (0.9, 0.8, 0.7)),
                "lamp": LAMPS[light](s),
            }
        )
    )


@pytest.mark.parametrize("light", LAMPS)
def test_scenes_of_micrometres_are_those_of_decimetres(variant, light):
    plan = PointPlan(error=0.0, first=8, most=8)
    usual, small = (quadrature_image(scene(light, s), plan=plan) for s in (2.0**-4, 2.0**-20))
    for layer in ("airlight", "surface", "airlight_error", "surface_error"):
        # Powers of two leave no rounding but that of logarithms, by which small errors differ.
        got, expected = getattr(small, layer), getattr(usual, layer)
        rel, least = (1e-5, 1e-7) if "error" in layer else (1e-9, 1e-9)
        assert got == pytest.approx(expected, rel=rel, abs=least * expected.max())
    assert usual.airlight.max() > 0 < usual.surface.max()
    assert (small.transitions, small.disagreements) == (usual.transitions, usual.disagreements)


@pytest.mark.parametrize("light", ["point", "sun"])
def test_the_estimator_walks_through_boundaries_of_micrometres(variant, light):
    usual, small = (single_scatter_batch(scene(light, s), 1, 4) for s in (2.0**-4, 2.0**-20))
    assert np.max(np.abs(small.mean - usual.mean)) < 1e-5 * np.max(usual.mean)
