# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the properties of a scene are what it holds, finite for every scene, and none
depends on a unit of length.
"""

import math

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.properties.properties import scene_properties
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.meshes import box, grid, placed, scaled
from airlight.validation.scenes.parts import camera, fog, mitsuba_mesh, point_light
from airlight.validation.scenes.registry import FOG_SCENES


def _scene(scale=1.0, *, sigma_t=0.37, lamp=(0.3, 0.1, 5.0), extra=None):
    """Return a box of 0.4 m under a lamp, over a floor at z = -1, seen from 4 m away."""
    cube = placed(scaled(box((0.4, 0.4, 0.4)), scale), (0.0, 0.0, 0.0))
    floor = grid(
        (-9.1 * scale, -9.3 * scale, -scale), (18.7 * scale, 0, 0), (0, 18.3 * scale, 0), (1, 1)
    )
    return read_scene(
        mi.load_dict(
            {
                "type": "scene",
                "fog": fog(sigma_t / scale, (0.9, 0.8, 0.7), {"type": "hg", "g": 0.6}),
                "sensor": camera(
                    (0.0, -4.0 * scale, 0.01 * scale), (0, 0, 0), fov=40.0, size=(64, 48)
                ),
                "lamp": point_light([scale * value for value in lamp], (1.0, 1.0, 1.0)),
                "cube": mitsuba_mesh("cube", cube, (0.5, 0.5, 0.5)),
                "floor": mitsuba_mesh("floor", floor, (0.5, 0.5, 0.5)),
            }
            | (extra or {})
        )
    )


def test_they_are_what_the_scene_holds(variant):
    properties = scene_properties(_scene())
    assert (properties["lights"], properties["points"], properties["areas"]) == (1, 1, 0)
    assert properties["triangles"] == 14
    assert properties["mean_cosine"] == pytest.approx(0.6, abs=2e-3)
    # A third of the rays meets the floor, which ends 9 m away, and some the box.
    assert 0.3 < properties["surface_fraction"] < 0.5
    assert 0.8 < properties["lit_fraction"] < 1
    assert properties["pixels"] == 64 * 48


def test_none_depends_on_the_unit_of_length(variant):
    metres, inches = scene_properties(_scene()), scene_properties(_scene(39.37))
    assert metres.keys() == inches.keys()
    for name, value in metres.items():
        assert inches[name] == pytest.approx(value, rel=2e-3, abs=2e-3), name


@pytest.mark.slow
@pytest.mark.claim(
    "properties-finite",
    tolerance="none: every property of fourteen built-in and eight random scenes",
)
def test_every_scene_has_the_same_properties_all_finite(variant):
    names = None
    for scene in (*FOG_SCENES, *(f"random:{seed}" for seed in range(8))):
        properties = scene_properties(read_scene(load_scene(scene, (16, 12)).scene))
        assert names in (None, list(properties))
        names = list(properties)
        assert all(math.isfinite(value) for value in properties.values()), scene
        assert np.all(np.array(list(properties.values())) >= -1), scene
