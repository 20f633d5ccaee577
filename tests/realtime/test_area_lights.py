# SPDX-License-Identifier: BSD-3-Clause
"""Area lights are read as they are; samples lie on them, share their power, and
have the means of the light.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.area_lights.points import PATTERNS, place_points
from airlight.realtime.area_lights.shape import (
    AreaLight,
    occluder_triangles,
    occluder_vertices,
    turned_area_light,
)
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import rotation
from tests.helpers.lamps import area_lamp
from tests.helpers.meshes import directed_edges, volume
from tests.helpers.scenes import tiny_scene

AXES = rotation((0.3, -1.0, 0.7), 37.0)
MIDDLE = np.array([0.7, -1.3, 2.9])


def light_of(kind, size=(0.31, 0.17)):
    across, up = size if kind == "rectangle" else (size[0], size[0])
    radiance = np.array([5.3, 4.1, 2.9])
    return AreaLight("lamp", kind, MIDDLE, across * AXES[0], up * AXES[1], AXES[2], radiance, True)


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
@pytest.mark.parametrize("pattern", PATTERNS)
@pytest.mark.parametrize("points", [1, 2, 5, 16, 37])
def test_points_lie_on_the_light_and_share_its_power(kind, pattern, points):
    light = light_of(kind)
    placed = place_points(light, points, pattern)
    assert placed.positions.shape == placed.normals.shape == (points, 3)
    from_middle = placed.positions - light.middle
    np.testing.assert_allclose(np.linalg.norm(placed.normals, axis=1), 1, rtol=1e-12)
    if kind == "sphere":
        np.testing.assert_allclose(from_middle, light.radius * placed.normals, atol=1e-12)
    else:
        np.testing.assert_allclose(from_middle @ light.normal, 0, atol=1e-12)
        u, v = (from_middle @ side / (side @ side) for side in (light.across, light.up))
        assert np.all(
            np.maximum(np.abs(u), np.abs(v)) < 1 if kind == "rectangle" else np.hypot(u, v) < 1
        )
    # The power of each point is pi I0.
    np.testing.assert_allclose(points * np.pi * placed.intensity, light.power, rtol=1e-12)
    assert len(np.unique(placed.positions.round(9), axis=0)) == points


@pytest.mark.parametrize("kind", ["rectangle", "disk", "sphere"])
def test_means_over_many_points_are_those_over_the_light(kind):
    """Second moments: a^2/3 of half a side, R^2/4 of a disk, R^2/3 of a sphere."""
    light = light_of(kind)
    offsets = (place_points(light, 4096, "sobol").positions - light.middle) @ AXES.T
    fraction = {"rectangle": 1 / 3, "disk": 1 / 4, "sphere": 1 / 3}[kind]
    sizes = [np.linalg.norm(light.across), np.linalg.norm(light.up)]
    np.testing.assert_allclose(offsets.mean(axis=0), 0, atol=2e-3 * sizes[0])
    np.testing.assert_allclose(
        (offsets[:, :2] ** 2).mean(axis=0), fraction * np.square(sizes), rtol=3e-3
    )


@pytest.mark.parametrize(("kind", "fraction"), [("rectangle", 1 / 3), ("disk", 1 / 4)])
@pytest.mark.parametrize("points", [3, 4, 5])
def test_a_ring_has_the_second_moments_of_its_light(kind, fraction, points):
    light = light_of(kind)
    offsets = (place_points(light, points, "ring").positions - light.middle) @ AXES[:2].T
    sizes = np.array([np.linalg.norm(light.across), np.linalg.norm(light.up)])
    np.testing.assert_allclose(
        offsets.T @ offsets / points, np.diag(fraction * sizes**2), atol=1e-12
    )
    np.testing.assert_allclose(place_points(light, 1, "ring").positions, [light.middle], atol=1e-12)


@pytest.mark.parametrize("pattern", PATTERNS)
def test_a_sphere_shines_alike_in_all_directions(pattern):
    """The sum of I0 max(0, n . w) is Le pi R^2, what the disk of its outline would send."""
    light = light_of("sphere")
    placed = place_points(light, 4096, pattern)
    directions = np.concatenate([np.eye(3), -np.eye(3), AXES, rotation((1, 2, 3), 71)])
    sums = np.maximum(placed.normals @ directions.T, 0).sum(axis=0) * placed.intensity[0]
    np.testing.assert_allclose(sums, 5.3 * np.pi * light.radius**2, rtol=2e-3)


def test_a_turned_light_turns_its_points():
    turn, about = rotation((0.1, 0.2, 1.0), 71.0), np.array([0.3, 0.1, -0.7])
    light = light_of("disk")
    before, after = (
        place_points(one, 7, "sobol") for one in (light, turned_area_light(light, about, turn))
    )
    np.testing.assert_allclose(
        after.positions, about + (before.positions - about) @ turn.T, atol=1e-12
    )
    np.testing.assert_allclose(after.normals, before.normals @ turn.T, atol=1e-12)


# The triangles that stand for a black light -------------------------------------------------------


@pytest.mark.parametrize("kind", ["rectangle", "disk"])
def test_flat_occluders_have_the_area_and_face_of_their_light(kind):
    light = light_of(kind)
    vertices, faces = occluder_vertices(light), occluder_triangles(light)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a).sum(axis=0)
    np.testing.assert_allclose(area, light.area * AXES[2], atol=1e-12)


def test_a_sphere_is_closed_and_nearly_as_large():
    light = light_of("sphere")
    vertices, faces = occluder_vertices(light), occluder_triangles(light)
    edges = directed_edges(faces)
    assert set(edges.values()) == {1}
    assert {(b, a) for a, b in edges} == set(edges)
    assert volume(vertices - MIDDLE, faces) == pytest.approx(
        4 / 3 * np.pi * light.radius**3, rel=5e-3
    )


# Reading, and refusals by the name of the shape ---------------------------------------------------


def read(**changes):
    return read_scene(mi.load_dict(tiny_scene(**changes)))


def test_a_lamp_of_null_is_nothing_but_light(variant):
    scene = read(lamp=area_lamp("disk", size=0.29, material={"type": "null"}))
    assert not scene.area_lights[0].opaque
    assert "lamp" not in [shape.id() for shape in scene.geometry.shapes()]
    assert "lamp" in [
        shape.id() for shape in read(lamp=area_lamp("disk", size=0.29)).geometry.shapes()
    ]


@pytest.mark.parametrize("flipped", [False, True])
@pytest.mark.parametrize("pattern", ["ring", "sobol"])
def test_points_of_a_mesh_lie_on_the_side_that_shines(variant, flipped, pattern):
    """A box from outside is convex; from inside its walls stand in the light of one another."""
    lamp = area_lamp("cube", flip_normals=flipped)
    (light,) = read(lamp=lamp).area_lights
    assert (light.kind, light.folded) == ("mesh", flipped)
    half = np.array([0.31, 0.17, 0.17])
    assert light.area == pytest.approx(8 * np.sum(half * np.roll(half, 1)), rel=1e-5)
    placed = place_points(light, 600, pattern)
    matrix = np.array(lamp["to_world"].matrix, dtype=np.float64)[:3]
    local = np.linalg.solve(matrix[:, :3], (placed.positions - matrix[:, 3]).T).T
    np.testing.assert_allclose(np.abs(local).max(axis=1), 1, atol=1e-4)
    along = placed.normals @ (matrix[:, :3] / half)  # a unit vector along one of the axes
    np.testing.assert_allclose(np.abs(along).max(axis=1), 1, atol=1e-5)
    np.testing.assert_allclose(np.sum(along * local, axis=1), -1 if flipped else 1, atol=1e-4)
    np.testing.assert_allclose(600 * np.pi * placed.intensity, light.power, rtol=1e-12)
    walls = np.array([half[1] * half[2], half[2] * half[0], half[0] * half[1]])
    expected = (walls + (walls.sum() - walls) / 3) / walls.sum()
    np.testing.assert_allclose(np.mean(local**2, axis=0), expected, rtol=0.03)
