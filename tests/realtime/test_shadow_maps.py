# SPDX-License-Identifier: BSD-3-Clause
"""Shadow maps are never read outside, and a plane never shadows itself; frames show
that maps say what rays say.
"""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.area_lights.points import LightSamples
from airlight.realtime.methods.soft_shafts.sources import source_state
from airlight.realtime.scene.light_table import sampled_lights
from airlight.realtime.scene.read_scene import read_scene
from airlight.realtime.shadow_maps.shadow_map import cast_shadow_map, lit_in_map
from tests.helpers.lamps import lamp_scene
from tests.helpers.scenes import spot, tiny_scene


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_a_look_up_stays_in_the_map_whatever_the_point(variant, kind):
    """At the light itself a place on a face is no number: a load from there ended the process."""
    scene = read_scene(mi.load_dict(tiny_scene(**({"lamp": spot()} if kind == "spot" else {}))))
    light = scene.lights[0]
    shadow_map = cast_shadow_map(scene.geometry, light, 8)
    odd = np.array([np.nan, np.inf, -np.inf, 1e30, -1e30, 0.0, 1.0])
    points = np.array(np.meshgrid(odd, odd, odd)).reshape(3, -1)
    place = np.array(light.position).reshape(3, 1)
    assert (
        np.array(
            lit_in_map(shadow_map, light, mi.Vector3f(np.hstack([points, place + points, place])))
        ).size
        == 687
    )


def test_a_plane_never_shadows_itself(variant):
    scene = read_scene(mi.load_dict(lamp_scene(ball=None)))
    _, (lights,) = sampled_lights(scene.area_lights, LightSamples(3, "ring"), mi.Float)
    state = source_state(scene.geometry, lights, 64, with_maps=True)
    points = np.random.default_rng(4).uniform([-5, -5, 0], [5, 5, 0], (50000, 3))
    place = mi.Vector3f(*(mi.Float(column) for column in points.T))
    light = lights[mi.UInt32(1)]
    before = np.array(dr.dot(place - light.position, light.normal)) > 0.1
    assert np.all(np.array(state.maps.of(mi.UInt32(1), light).lit_surface(place))[before])
