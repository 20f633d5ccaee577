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


def test_points_in_the_air_are_lit_as_rays_say(maps):
    import drjit as dr
    import mitsuba as mi

    read, state = maps(lamp_scene(), 512)
    points = np.random.default_rng(3).uniform([-2, -2, 0.01], [2, 2, 1.8], (20000, 3))
    place = mi.Vector3f(*(mi.Float(column) for column in points.T))
    for number in range(3):
        frame = dr.gather(type(state.frames), state.frames, mi.UInt32(number))
        local = frame.local(place - frame.position)
        lit = np.array(state.maps.lit(mi.UInt32(number), local))
        rays = ~np.array(read.geometry.ray_test(frame.shadow_ray(place)))
        before = np.array(local[2]) > 0.05
        assert 0.02 < np.mean(~rays[before]) < 0.98
        assert np.mean(lit[before] != rays[before]) < 0.01


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


def test_a_blocker_is_as_far_as_it_is(maps):
    """Along one ray: the ball between lamp and floor."""
    import drjit as dr
    import mitsuba as mi

    read, state = maps(lamp_scene(), 1024)
    frame = dr.gather(type(state.frames), state.frames, mi.UInt32(0))
    start = np.array(frame.position + frame.normal * frame.lift).ravel()
    way = np.array([0.1, 0.1, 0.7]) - start
    way /= np.linalg.norm(way)
    floor = start + way * (-start[2] / way[2])
    hit = float(read.geometry.ray_intersect(mi.Ray3f(mi.Point3f(start), mi.Vector3f(way))).t[0])
    local = frame.local(mi.Vector3f(floor) - frame.position)
    beyond = float(state.maps.beyond(mi.UInt32(0), local)[0])
    assert beyond == pytest.approx((np.linalg.norm(floor - start) - hit) / hit, rel=0.01)
