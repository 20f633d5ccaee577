# SPDX-License-Identifier: BSD-3-Clause
"""Maps over hemispheres say what shadow rays say, away from edges; a plane never shadows itself."""

import numpy as np
import pytest

from tests.helpers.lamps import lamp_scene


@pytest.fixture
def maps(variant):
    import mitsuba as mi

    from realtime.methods.soft_shafts.light_sources import source_state
    from realtime.scene.light_points import with_light_points
    from realtime.scene.read_scene import read_scene

    def cast(scene, size):
        read = with_light_points(read_scene(mi.load_dict(scene)), 3, "ring")
        return read, source_state(read.geometry, list(read.lights), size, with_maps=True)

    return cast


def test_a_plane_never_shadows_itself(maps):
    import drjit as dr
    import mitsuba as mi

    _, state = maps(lamp_scene(ball=None), 64)
    points = np.random.default_rng(4).uniform([-5, -5, 0], [5, 5, 0], (50000, 3))
    place = mi.Vector3f(*(mi.Float(column) for column in points.T))
    frame = dr.gather(type(state.frames), state.frames, mi.UInt32(1))
    local = frame.local(place - frame.position)
    lit = np.array(state.maps.lit_surface(mi.UInt32(1), local))[np.array(local[2]) > 0.1]
    assert np.all(lit)
