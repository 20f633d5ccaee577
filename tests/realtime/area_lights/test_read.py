# SPDX-License-Identifier: BSD-3-Clause
"""Area lights are read as they are, and what no method can render is refused by the name of the shape."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.area_lights.points import place_points
from realtime.errors import InputError
from realtime.scene.read_scene import read_scene
from tests.helpers.lamps import area_lamp
from tests.helpers.scenes import tiny_scene


def read(**changes):
    return read_scene(mi.load_dict(tiny_scene(**changes)))


@pytest.mark.parametrize(
    ("kind", "size", "area"),
    [
        ("rectangle", (0.31, 0.17), 4 * 0.31 * 0.17),
        ("disk", 0.29, np.pi * 0.29**2),
        ("sphere", 0.23, 4 * np.pi * 0.23**2),
    ],
)
def test_shape_area_and_power_are_read(variant, kind, size, area):
    scene = read(lamp=area_lamp(kind, size=size))
    (light,) = scene.area_lights
    assert scene.lights == ()
    assert (light.name, light.kind, light.opaque) == ("lamp", kind, True)
    assert light.area == pytest.approx(area, rel=1e-6)
    np.testing.assert_allclose(light.power, np.pi * area * np.array([5.3, 4.1, 2.9]), rtol=1e-6)
    np.testing.assert_allclose(light.middle, [0.83, 0.61, 1.97], rtol=1e-6)
    toward = np.array([0.13, 0.07, 0.31]) - light.middle
    np.testing.assert_allclose(light.normal, toward / np.linalg.norm(toward), atol=1e-6)
    assert scene.features.area_lights == (kind,)


def test_a_lamp_of_null_is_nothing_but_light(variant):
    scene = read(lamp=area_lamp("disk", size=0.29, material={"type": "null"}))
    assert not scene.area_lights[0].opaque
    assert "lamp" not in [shape.id() for shape in scene.geometry.shapes()]
    assert "lamp" in [shape.id() for shape in read(lamp=area_lamp("disk", size=0.29)).geometry.shapes()]


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


def _sheared():
    return mi.ScalarTransform4f(np.array([[1, 0.3, 0, 0.5], [0, 1, 0, 0.7], [0, 0, 1, 1.9], [0, 0, 0, 1]]))


@pytest.mark.claim("scenes-refused-by-name")
@pytest.mark.parametrize(
    ("lamp", "message"),
    [
        (lambda: area_lamp("cylinder"), "light 'lamp': its shape is a cylinder"),
        (lambda: area_lamp("rectangle") | {"to_world": _sheared()}, "light 'lamp': the rectangle is sheared"),
        (lambda: area_lamp("disk", size=(0.3, 0.2)), "light 'lamp': the disk is scaled by 0.3 x 0.2"),
        (lambda: area_lamp("sphere", size=0.3, flip_normals=True), "light 'lamp': the sphere shines inwards"),
        (lambda: area_lamp("sphere", size=9.0), "light 'lamp': the camera is inside of the sphere"),
        (
            lambda: area_lamp("disk", emitter={"type": "area", "radiance": {"type": "rgb", "value": [-1.0, 0.0, 0.0]}}),
            "light 'lamp': its radiance is",
        ),
        (
            lambda: area_lamp("sphere", material={"type": "null"}, interior={"type": "homogeneous"}),
            "light 'lamp': its shape bounds a medium",
        ),
    ],
)
def test_refusals_name_the_light(variant, lamp, message):
    with pytest.raises(InputError, match=message):
        read(lamp=lamp())
