# SPDX-License-Identifier: BSD-3-Clause
"""A shadow map is never read outside; that it says what rays say is seen in frames, `tests/realtime/frame`."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.scene.read_scene import read_scene
from realtime.shadow_maps.shadow_map import cast_shadow_map, lit_in_map
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
    assert np.array(lit_in_map(shadow_map, light, mi.Vector3f(np.hstack([points, place + points, place])))).size == 687
