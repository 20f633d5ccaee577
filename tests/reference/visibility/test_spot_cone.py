# SPDX-License-Identifier: BSD-3-Clause
import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from reference.scene.read import ReferenceLight, read_reference
from reference.visibility.planes import cone_interval, falloff, rays_at
from tests.helpers.scenes import spot, tiny_scene


@pytest.mark.claim("spot-falloff")
@pytest.mark.parametrize("degrees", [2.0, 31.0, 78.0, 89.5])
def test_interval_against_sampling(degrees):
    rng = np.random.default_rng(13)
    axis = np.array([0.3, -0.8, 0.5]) / np.linalg.norm([0.3, -0.8, 0.5])
    angle = np.deg2rad(degrees)
    light = ReferenceLight(np.array([0.2, 0.5, -0.4]), np.ones(3), axis, angle, angle)
    origin = np.array([1.1, -0.7, 0.9])
    direction = rng.normal(size=(500, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    rays = rays_at(origin, direction, light.position)
    low, high = cone_interval(rays, light, angle)
    theta = np.linspace(-0.499 * np.pi, 0.499 * np.pi, 401)
    away = direction[:, None] * np.sin(theta)[:, None] + rays.normal[:, None] * np.cos(theta)[:, None]
    cosine = away @ axis
    clear = np.abs(cosine - np.cos(angle)) > 1e-9
    inside = (theta >= low[:, None]) & (theta <= high[:, None])
    assert np.array_equal(inside[clear], (cosine > np.cos(angle))[clear])
    assert inside.any()


@pytest.mark.claim("spot-falloff", tolerance="2e-5: acos of a float32 cosine")
def test_profile_is_that_of_mitsuba(variant):
    scene = mi.load_dict(tiny_scene(lamp=spot(cutoff=37.0, beam=14.0)))
    reference = read_reference(scene)
    light = reference.lights[0]
    rays = rays_at(reference.origin, reference.direction, light.position)
    normal = rays.normal
    theta = np.linspace(-1.3, 1.3, 57)
    value = falloff(np.broadcast_to(theta, (len(normal), 57)), rays, light)
    away = reference.direction[:, None] * np.sin(theta)[:, None] + normal[:, None] * np.cos(theta)[:, None]
    interaction = dr.zeros(mi.Interaction3f, away[..., 0].size)
    interaction.p = mi.Point3f((light.position + away).reshape(-1, 3).T)
    _, arriving = scene.emitters()[0].sample_direction(interaction, mi.Point2f(0.5))
    expected = np.array(arriving)[0].reshape(value.shape) / light.intensity[0]
    assert np.max(np.abs(value - expected)) < 2e-5  # acos of a float32 cosine close to 1
    assert value.max() == 1
    assert value.min() == 0
