# SPDX-License-Identifier: BSD-3-Clause
"""Light samples lie on their light, have equal power, and their means become those of the light."""

import numpy as np
import pytest

from realtime.area_lights.points import PATTERNS, place_points
from realtime.area_lights.shape import AreaLight, turned_area_light
from realtime.errors import InputError
from validation.scenes.meshes import rotation

AXES = rotation((0.3, -1.0, 0.7), 37.0)
MIDDLE = np.array([0.7, -1.3, 2.9])


def lamp(kind, size=(0.31, 0.17)):
    across, up = size if kind == "rectangle" else (size[0], size[0])
    radiance = np.array([5.3, 4.1, 2.9])
    return AreaLight("lamp", kind, MIDDLE, across * AXES[0], up * AXES[1], AXES[2], radiance, True)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("points", [1, 2, 5, 16, 37])
def test_points_lie_on_the_light_and_share_its_power(kind, pattern, points):
    light = lamp(kind)
    placed = place_points(light, points, pattern)
    assert placed.positions.shape == placed.normals.shape == (points, 3)
    from_middle = placed.positions - light.middle
    np.testing.assert_allclose(np.linalg.norm(placed.normals, axis=1), 1, rtol=1e-12)
    if kind == "sphere":
        np.testing.assert_allclose(from_middle, light.radius * placed.normals, atol=1e-12)
    else:
        np.testing.assert_allclose(from_middle @ light.normal, 0, atol=1e-12)
        u, v = (from_middle @ side / (side @ side) for side in (light.across, light.up))
        assert np.all(np.maximum(np.abs(u), np.abs(v)) < 1 if kind == "rectangle" else np.hypot(u, v) < 1)
    # Of each point the power is pi I0.
    np.testing.assert_allclose(points * np.pi * placed.intensity, light.power, rtol=1e-12)
    assert len(np.unique(placed.positions.round(9), axis=0)) == points


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
@pytest.mark.parametrize("pattern", ["grid", "sobol", "interleaved"])
def test_means_over_many_points_are_those_over_the_light(kind, pattern):
    """Second moments: a^2/3 of half a side, R^2/4 of a disk, R^2/3 of a sphere."""
    light = lamp(kind)
    offsets = (place_points(light, 4096, pattern).positions - light.middle) @ AXES.T
    share = {"rectangle": 1 / 3, "disk": 1 / 4, "sphere": 1 / 3}[kind]
    sizes = [np.linalg.norm(light.across), np.linalg.norm(light.up)]
    np.testing.assert_allclose(offsets.mean(axis=0), 0, atol=2e-3 * sizes[0])
    np.testing.assert_allclose((offsets[:, :2] ** 2).mean(axis=0), share * np.square(sizes), rtol=3e-3)


@pytest.mark.parametrize(("kind", "share"), [("rectangle", 1 / 3), ("disk", 1 / 4)])
@pytest.mark.parametrize("points", [3, 4, 5])
def test_a_ring_has_the_second_moments_of_its_light(kind, share, points):
    light = lamp(kind)
    offsets = (place_points(light, points, "ring").positions - light.middle) @ AXES[:2].T
    sizes = np.array([np.linalg.norm(light.across), np.linalg.norm(light.up)])
    np.testing.assert_allclose(offsets.T @ offsets / points, np.diag(share * sizes**2), atol=1e-12)
    np.testing.assert_allclose(place_points(light, 1, "ring").positions, [light.middle], atol=1e-12)


@pytest.mark.parametrize("pattern", ["ring", "sobol", "grid"])
def test_a_sphere_shines_alike_in_all_directions(pattern):
    """The sum of I0 max(0, n . w) is Le pi R^2, what the disk of its outline would send."""
    light = lamp("sphere")
    placed = place_points(light, 4096, pattern)
    directions = np.concatenate([np.eye(3), -np.eye(3), AXES, rotation((1, 2, 3), 71)])
    sums = np.maximum(placed.normals @ directions.T, 0).sum(axis=0) * placed.intensity[0]
    np.testing.assert_allclose(sums, 5.3 * np.pi * light.radius**2, rtol=2e-3)


def test_a_turned_light_turns_its_points():
    turn, about = rotation((0.1, 0.2, 1.0), 71.0), np.array([0.3, 0.1, -0.7])
    light = lamp("disk")
    before, after = (place_points(one, 7, "sobol") for one in (light, turned_area_light(light, about, turn)))
    np.testing.assert_allclose(after.positions, about + (before.positions - about) @ turn.T, atol=1e-12)
    np.testing.assert_allclose(after.normals, before.normals @ turn.T, atol=1e-12)


@pytest.mark.parametrize(
    ("points", "pattern", "message"),
    [
        (0, "grid", "points: got 0, wanted a whole number from 1 to 4096"),
        (4, "spiral", "pattern: got 'spiral', wanted one of ring, grid, sobol, interleaved"),
    ],
)
def test_numbers_and_patterns_that_there_are_not(points, pattern, message):
    with pytest.raises(InputError, match=message):
        place_points(lamp("disk"), points, pattern)
