# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest


def point_light(types, position):
    from realtime.lights import Light

    return Light("point", False, types.vector(*(float(p) for p in position)), types.color(1))


def spot_light(types, position, axis, degrees):
    from realtime.lights import Light, spot_fields

    angle = float(np.deg2rad(degrees))
    fields = spot_fields(np.asarray(axis) / np.linalg.norm(axis), angle, angle, types)
    return Light("spot", False, types.vector(*(float(p) for p in position)), types.color(1), **fields)


def test_height_of_rays_that_nearly_meet_the_light(variant):
    """Rays towards the light, off by 1e-6 to 1: the textbook form has no correct digit at the small end."""
    import mitsuba as mi

    from realtime.arrays import array_types
    from realtime.geometry import ray_geometry

    rng = np.random.default_rng(7)
    light = np.array([1.25, -2.5, 3.75])  # exact in float32, as is light - origin below
    direction = (light + 10.0 ** rng.uniform(-6, 0, (4000, 1)) * rng.normal(size=(4000, 3))).astype(np.float32)
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    geometry = ray_geometry(mi.Vector3f(0), mi.Vector3f(direction.T), point_light(array_types(), light))
    exact = direction.astype(np.float64)
    height = np.linalg.norm(np.cross(light, exact), axis=1)
    # 1.5 units in the last place for each component, and one for each step of the norm.
    assert np.max(np.abs(np.array(geometry.height) / height - 1)) < 3e-7
    assert np.max(np.abs(np.array(geometry.foot) - exact @ light)) < 4 * np.finfo(np.float32).eps * np.linalg.norm(
        light
    )


@pytest.mark.parametrize("precision", ["single", "double"])
def test_cone_clip_against_sampling(variant, precision):
    """A sample lies in the clipped segment if and only if it lies in the cone, but for a rounding at its ends."""
    from realtime.arrays import array_types
    from realtime.geometry import clip_to_cone, ray_geometry

    types = array_types(precision)
    rng = np.random.default_rng(11)
    n, m = 400, 300
    origin, direction = rng.normal(size=(n, 3)) * 2, rng.normal(size=(n, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    for degrees in (3.0, 37.0, 71.0, 89.0):
        light = spot_light(types, (0.3, -0.2, 0.1), (0.4, 0.5, -0.7), degrees)
        geometry = ray_geometry(types.vector(origin.T), types.vector(direction.T), light)
        clipped = clip_to_cone(geometry, types.scalar(0), types.scalar(9.0))
        low, high = (np.broadcast_to(np.array(x, dtype=np.float64), n) for x in clipped)
        x = np.linspace(0.01, 8.99, m)
        away = origin[:, None] + x[:, None] * direction[:, None] - np.array([0.3, -0.2, 0.1])
        axis = np.array([0.4, 0.5, -0.7]) / np.linalg.norm([0.4, 0.5, -0.7])
        cosine = (away @ axis) / np.linalg.norm(away, axis=2)
        clear = np.abs(cosine - np.cos(np.deg2rad(degrees))) > 1e-4  # of the cone's surface
        inside = (x > low[:, None]) & (x < high[:, None])
        assert np.array_equal(inside[clear], (cosine > np.cos(np.deg2rad(degrees)))[clear]), degrees
        assert inside.any()


def test_endless_rays_are_clipped_to_half_lines(variant):
    from realtime.arrays import array_types
    from realtime.geometry import clip_to_cone, ray_geometry

    types = array_types()
    light = spot_light(types, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), 30.0)
    along = ray_geometry(types.vector(0.5, 0.0, -3.0), types.vector(0.0, 0.0, 1.0), light)
    low, high = clip_to_cone(along, types.scalar(0), types.scalar(np.inf))
    assert np.array(low)[0] == pytest.approx(3 + 0.5 / np.tan(np.deg2rad(30)), rel=1e-6)
    assert np.isinf(np.array(high)[0])
    against = ray_geometry(types.vector(0.5, 0.0, 3.0), types.vector(0.0, 0.0, 1.0), light)
    assert np.array(clip_to_cone(against, types.scalar(0), types.scalar(np.inf))[0])[0] == 0


def test_rays_parallel_to_a_line_on_the_cone(variant):
    """The quadratic equation has one root: a half line inside the cone, or on the other side of the axis nothing."""
    from realtime.arrays import array_types
    from realtime.geometry import clip_to_cone, ray_geometry

    types = array_types()
    degrees = np.rad2deg(np.arccos(0.8))
    light = spot_light(types, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), degrees)
    direction = types.vector(0.6, 0.0, 0.8)
    assert np.array(light.cos_cutoff)[0] == np.float32(0.8)
    # In the cone |x| <= 3/4 z; from (-1, 0, 0) that is 1 - 0.6 t <= 0.6 t on one side, and always on the other.
    within = ray_geometry(types.vector(-1.0, 0.0, 0.0), direction, light)
    low, high = (np.array(x)[0] for x in clip_to_cone(within, types.scalar(0), types.scalar(np.inf)))
    assert low == pytest.approx(1 / 1.2, rel=1e-6)
    assert np.isinf(high)
    beside = ray_geometry(types.vector(1.0, 0.0, 0.0), direction, light)
    low, high = (np.array(x)[0] for x in clip_to_cone(beside, types.scalar(0), types.scalar(np.inf)))
    assert low == high == 0
