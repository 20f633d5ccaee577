# SPDX-License-Identifier: BSD-3-Clause
"""Changes of a scene by name: the methods and the truth read the same, and a scene read again is a scene read anew."""

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.scene.read_scene import read_again, read_scene
from reference.scene.read import read_truth
from validation.scenes.changes import change_scene, change_words, changeable, parse_changes
from validation.scenes.loading import load_scene
from validation.scenes.registry import SCENES

pytestmark = pytest.mark.usefixtures("variant")

CHANGES = {
    "colonnade": {
        "camera.origin": (1.3, 1.9, 4.1),
        "camera.target": (4.7, 1.5, 4.3),
        "camera.up": (0.0, 0.1, 1.0),
        "camera.fov": (61.7,),
        "light.position": (5.3, 1.7, 3.9),
        "light.intensity": (111.0, 97.0, 53.0),
        "medium.sigma_t": (0.13,),
        "medium.albedo": (0.71, 0.63, 0.57),
        "medium.g": (-0.41,),
    },
    "windows": {"light.direction": (0.7, -0.31, -0.61), "light.irradiance": (11.0,), "medium.sigma_t": (0.37,)},
    "sphere-spot": {"light.position": (0.41, 0.3, 4.5), "light.direction": (0.1, 0.05, -1.0), "camera.fov": (31.0,)},
    "three-media": {"medium-3.g": (0.23,), "medium-2.sigma_t": (0.61,), "medium.albedo": (0.5,)},
    "soft-hall": {"light.radiance": (211.0, 307.0, 401.0)},
}


def _numbers(value):
    """All numbers in a tree of dataclasses, tuples and arrays."""
    if dataclasses.is_dataclass(value):
        return [number for item in dataclasses.fields(value) for number in _numbers(getattr(value, item.name))]
    if isinstance(value, tuple | list):
        return [number for item in value for number in _numbers(item)]
    if dr.is_array_v(value) or isinstance(value, int | float | bool | str | np.ndarray):
        return [np.array(value).tolist()]
    return []


def _read(scene):
    parts = read_scene(scene)
    return [_numbers(part) for part in (parts.camera, parts.medium, parts.lights, parts.area_lights, parts.features)]


@pytest.mark.parametrize("name", CHANGES)
def test_a_scene_that_is_read_again_is_the_scene_read_anew(name):
    loaded = load_scene(name, (16, 12))
    before = read_scene(loaded.scene)
    change_scene(loaded.scene, CHANGES[name])
    again = read_again(before, loaded.scene)
    read = [_numbers(part) for part in (again.camera, again.medium, again.lights, again.area_lights, again.features)]
    assert read == _read(load_scene(name, (16, 12), CHANGES[name]).scene)
    assert read != _read(load_scene(name, (16, 12)).scene)
    assert again.geometry is before.geometry


def test_methods_and_truth_see_the_same_camera_light_and_medium():
    loaded = load_scene("colonnade", (16, 12), CHANGES["colonnade"])
    scene, truth = read_scene(loaded.scene), read_truth(loaded.scene)
    np.testing.assert_allclose(np.array(scene.camera.origin).ravel(), truth.origin, rtol=1e-6)
    middle = truth.direction.reshape(12, 16, 3)[5:7, 7:9].mean(axis=(0, 1))
    aim = np.subtract((4.7, 1.5, 4.3), (1.3, 1.9, 4.1))
    np.testing.assert_allclose(middle / np.linalg.norm(middle), aim / np.linalg.norm(aim), atol=1e-5)
    np.testing.assert_allclose(truth.lights[0].position, (5.3, 1.7, 3.9), rtol=1e-6)
    np.testing.assert_allclose(truth.lights[0].intensity, (111.0, 97.0, 53.0), rtol=1e-6)
    np.testing.assert_allclose(np.array(scene.lights[0].position).ravel(), (5.3, 1.7, 3.9), rtol=1e-6)
    np.testing.assert_allclose(truth.medium.sigma_t, 0.13, rtol=1e-6)
    np.testing.assert_allclose(float(scene.medium.sigma_t[0][0]), 0.13, rtol=1e-6)
    assert truth.medium.phase.g == pytest.approx(-0.41, rel=1e-6)
    assert float(scene.medium.phase.g[0]) == pytest.approx(-0.41, rel=1e-6)
    assert mi.traverse(loaded.scene.sensors()[0])["x_fov"][0] == pytest.approx(61.7)


def test_words_of_changes_come_back_to_the_last_digit():
    changes = {"camera.origin": (0.1, -1e-7, float(np.float32(1) / 3)), "medium.g": (1 / 3,)}
    words = change_words(changes)
    assert words[0] == "camera.origin=0.1,-0.0000001,0.33333334"
    assert {name: tuple(np.float32(value)) for name, value in parse_changes(words).items()} == {
        name: tuple(np.float32(value)) for name, value in changes.items()
    }
    assert parse_changes(words)["medium.g"] == (1 / 3,)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("medium.sigma=1", "did you mean 'medium.sigma_t'?"),
        ("light.position=1,2", "light.position: got 2 numbers, wanted 3"),
        ("medium.g=1", "medium.g: got 1, wanted finite numbers from -0.99 to 0.99"),
        ("medium.sigma_t=thick", "got 'medium.sigma_t=thick', wanted NAME=NUMBER"),
        ("camera.up=0,0,0", "camera.up: got 0,0,0, wanted a direction"),
        ("camera.target=0,0,0", ""),
    ],
)
def test_a_change_that_cannot_be_is_one_line(change, message):
    if not message:  # a target where the camera is
        origin = changeable(load_scene("colonnade").scene)["camera.origin"].value
        change, message = f"camera.target={','.join(map(repr, origin))}", "got a target at the origin"
    with pytest.raises(InputError) as raised:
        load_scene("colonnade", (16, 12), parse_changes([change]))
    assert message in str(raised.value)
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize("as_file", [False, True])
def test_an_isotropic_medium_gets_a_lobe_for_methods_and_truth(tmp_path, as_file):
    name = "open-fog"
    if as_file:
        name = str(tmp_path / "fog.xml")
        parsed = mi.parser.parse_dict(mi.parser.ParserConfig(mi.variant()), SCENES["open-fog"].build())
        mi.parser.write_file(parsed, name)
    scene = load_scene(name, (16, 12), {"medium.g": (0.31,), "medium.sigma_t": (0.2,)}).scene
    assert float(read_scene(scene).medium.phase.g[0]) == pytest.approx(0.31)
    truth = read_truth(scene)
    assert (truth.medium.phase.name, truth.medium.phase.g) == ("hg", pytest.approx(0.31))
    np.testing.assert_allclose(truth.medium.sigma_t, 0.2, rtol=1e-6)
    same = load_scene(name, (16, 12), {"medium.g": (0.0,)}).scene
    assert read_truth(same).medium.phase.name == "isotropic"
    assert changeable(same)["medium.g"].value == (0.0,)
