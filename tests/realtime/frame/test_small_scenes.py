# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a scene of a millimetre has the image of the same scene in metres.

A power of two is exact in floating point, so that every number of a frame is the same to the last
bit, unless a length in metres stands in the code. Mitsuba starts shadow rays 1e-4 m off a surface:
beyond a plate that floats 3e-5 m above it.
"""

from typing import Any

import mitsuba as mi
import numpy as np
import pytest

from tests.helpers.frames import relative_rmse, render
from tests.helpers.scenes import tiny_scene

SMALL = 2.0**-10  # a scene of millimetres


def scene(length: float, lamp: dict[str, Any]) -> dict[str, Any]:
    """Return a plate close above a floor, with all lengths times `length`; it looks the same."""
    plain, scale = tiny_scene(), mi.ScalarTransform4f().scale(length)
    grey = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.4, 0.4, 0.5]}}
    plate = scale @ mi.ScalarTransform4f().translate([0.1, 0.1, 0.03]).scale(0.8)
    camera = mi.ScalarTransform4f().look_at(
        [0.2 * length, -2.1 * length, 0.4 * length], [0, 0, 0], [0, 0, 1]
    )
    return plain | {
        "fog": plain["fog"] | {"sigma_t": 0.31 / length},
        "sensor": plain["sensor"] | {"to_world": camera, "near_clip": 1e-4 * length},
        "floor": {"type": "rectangle", "to_world": scale.scale(6.3), "bsdf": grey},
        "ball": {"type": "rectangle", "to_world": plate, "bsdf": {"type": "twosided", "b": grey}},
        "lamp": lamp,
    }


def lamp(length: float) -> dict[str, Any]:
    """Return a point light that sends as much light to the fog at any length."""
    intensity = [length**2 * value for value in (5.0, 4.0, 3.0)]
    return {
        "type": "point",
        "position": [0.9 * length, 0.7 * length, 1.9 * length],
        "intensity": {"type": "rgb", "value": intensity},
    }


@pytest.mark.parametrize("method", ["unshadowed", "ray-march"])
def test_a_millimetre_is_lit_as_a_metre(variant, method):
    large, small = (render(scene(length, lamp(length)), method) for length in (1.0, SMALL))
    for layer in ("airlight", "surface"):
        values, expected = np.array(getattr(small, layer)), np.array(getattr(large, layer))
        assert np.array_equal(values, expected), layer
    # Below the plate the floor is in its shadow.
    assert np.any(np.all(np.array(large.surface) == 0, axis=-1))


def test_a_grid_of_froxels_is_as_deep_as_a_scene_of_some_micrometres(variant):
    """It began at a millimetre: all of the scene lay in the first slices."""
    large, small = (
        render(scene(length, lamp(length)), "froxel-fog", width=16, height=12).airlight
        for length in (1.0, 2.0**-18)
    )
    assert relative_rmse(small, large) < 1e-3
