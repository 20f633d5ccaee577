# SPDX-License-Identifier: BSD-3-Clause
"""Claim: foot and height of a ray, and what of it a cone lights, keep their digits however near the light it passes."""

import numpy as np
import pytest

from realtime.numerics.array_types import array_types
from realtime.rays import ray_geometry
from realtime.scene.lights import Light, spot_fields
from tests.helpers.kernel_values import opaque, vectors


def point_light(types, position):
    return opaque(Light(vectors(types, position), types.color(1)))


def spot_light(types, position, axis, degrees):
    angle = float(np.deg2rad(degrees))
    fields = spot_fields(np.asarray(axis) / np.linalg.norm(axis), angle, angle, types)
    return opaque(Light(vectors(types, position), types.color(1), **fields))


@pytest.mark.parametrize("kind", ["point", "spot"])
def test_rounding_of_light_and_direction_is_no_height(variant, kind):
    """Where light - origin is computed in float32, as the direction, 1e-7 m of a height of 1e-4 m are lost."""
    types = array_types()
    rng = np.random.default_rng(8)
    light, origin = (np.float32(place).astype(np.float64) for place in ((1.237, -2.519, 3.751), (-0.33, 0.71, 0.123)))
    direction = light - origin + 10.0 ** rng.uniform(-4, 0, (2000, 1)) * rng.normal(size=(2000, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    axis = np.array([0.48, 0.6, -0.64])
    lamp = point_light(types, light) if kind == "point" else spot_light(types, light, axis, 40.0)
    at = types.vector(*(float(x) for x in origin))
    geometry = ray_geometry(at, vectors(array_types("double"), direction), lamp)
    cross = np.cross(light - origin, direction)
    height = np.linalg.norm(cross, axis=1)
    assert np.max(np.abs(np.array(geometry.height) / height - 1)) < 4e-7  # three roundings of a component and a norm
    if kind == "spot":
        offset = np.cross(cross, direction) @ axis
        assert np.max(np.abs(np.array(geometry.offset) - offset) / height) < 4e-7


@pytest.mark.parametrize(("sine", "cosine"), [(0.6, 0.8), (0.8, 0.6)])
def test_rays_parallel_to_a_line_on_the_cone(variant, sine, cosine):
    """The quadratic equation has one root: a half line inside the cone, or on the other side of the axis nothing.

    The other root is infinite, or at 1e7 m by the rounding of sine and cosine.
    """
    types = array_types()
    light = spot_light(types, (0.0, 0.0, 0.0), (0.0, 0.0, 1.0), np.rad2deg(np.arcsin(sine)))
    assert np.array(light.cos_cutoff)[0] == np.float32(cosine)
    # In the cone |x| <= tan z; from (-1, 0, 0) that is 1 - sine t <= sine t on one side, and always on the other.
    for x, sign, wanted in ((-1, 1, (0.5 / sine, np.inf)), (1, 1, None), (-1, -1, None), (1, -1, None)):
        direction = types.vector(sign * sine, 0.0, sign * cosine)
        beside = ray_geometry(types.vector(x, 0.0, 0.0), direction, light)
        low, high = (np.array(end)[0] for end in beside.lit_segment(types.scalar(0), types.scalar(np.inf)))
        if wanted is None:
            assert low == high == 0 or low > 1e7
        else:
            assert low == pytest.approx(wanted[0], rel=1e-6)
            assert high > 1e7


@pytest.mark.claim("spot-falloff", tolerance="2e-6 over the width of the edge")
@pytest.mark.parametrize(("cutoff", "beam"), [(3.0, 2.0), (33.0, 0.0), (70.0, 69.0)])
def test_falloff_near_the_axis_and_the_edge(variant, cutoff, beam):
    """Against the angle from the cross product in float64; an arc cosine in float32 is off by 3e-4 near the axis."""
    types = array_types()
    rng = np.random.default_rng(12)
    light, origin = (np.float32(place).astype(np.float64) for place in ((1.237, -2.519, 3.751), (-0.33, 0.71, 0.123)))
    axis = np.array([0.48, 0.6, -0.64])
    angle = np.deg2rad(cutoff)
    fields = spot_fields(axis, float(angle), float(np.deg2rad(beam)), types)
    lamp = Light(types.vector(*(float(x) for x in light)), types.color(1), **fields)
    across = np.cross(axis, rng.normal(size=(3000, 3)))
    across /= np.linalg.norm(across, axis=1, keepdims=True)
    aim = np.concatenate([10.0 ** rng.uniform(-6, 0, 1000), 1 - 10.0 ** rng.uniform(-6, 0, 1000), rng.random(1000)])
    distance = rng.uniform(0.5, 5, (3000, 1))
    point = light + distance * (axis + np.tan(aim * angle)[:, None] * across)
    x = np.linalg.norm(point - origin, axis=1)
    direction = (point - origin) / x[:, None]
    at = types.vector(*(float(component) for component in origin))
    geometry = ray_geometry(at, vectors(array_types("double"), direction), lamp)
    x = x.astype(np.float32).astype(np.float64)
    away = origin + x[:, None] * direction - light
    exact = np.arctan2(np.linalg.norm(np.cross(axis, away), axis=1), away @ axis)
    wanted = np.clip((angle - exact) / (angle - np.deg2rad(beam)), 0, 1)
    profile = np.array(geometry.falloff(lamp, types.scalar(x)))
    # Distances of up to 10 m, rounded, over a distance from the light of 0.5 m or more; measured 9e-7.
    assert np.max(np.abs(profile - wanted)) * (angle - np.deg2rad(beam)) < 2e-6
    assert np.mean((wanted > 0) & (wanted < 1)) > 0.05
