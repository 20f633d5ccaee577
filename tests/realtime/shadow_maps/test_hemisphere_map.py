# SPDX-License-Identifier: BSD-3-Clause
"""In maps over hemispheres a plane never shadows itself."""

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.methods.soft_shafts.march import source_state
from realtime.scene.light_samples import with_light_samples
from realtime.scene.read_scene import read_scene
from tests.helpers.lamps import lamp_scene


def test_a_plane_never_shadows_itself(variant):
    scene = with_light_samples(read_scene(mi.load_dict(lamp_scene(ball=None))), 3, "ring")
    state = source_state(scene.geometry, list(scene.lights), 64, with_maps=True)
    points = np.random.default_rng(4).uniform([-5, -5, 0], [5, 5, 0], (50000, 3))
    place = mi.Vector3f(*(mi.Float(column) for column in points.T))
    frame = dr.gather(type(state.frames), state.frames, mi.UInt32(1))
    local = frame.local(place - frame.position)
    lit = np.array(state.maps.lit_surface(mi.UInt32(1), local))[np.array(local[2]) > 0.1]
    assert np.all(lit)
