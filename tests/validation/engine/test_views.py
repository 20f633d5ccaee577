# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the image of a camera that is elsewhere, of rays that end before surfaces, of other
colours and of fog without attenuation that ends is predicted, and each is named.
"""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.camera import camera_matrix
from airlight.reference.scene.model import Model
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.exr import Image
from airlight.validation.engine.diagnose import diagnose_image
from airlight.validation.fog_model.radiance import FogModel, scene_fog
from airlight.validation.fog_model.view import Scenery, scattering_paths, view_of
from airlight.validation.scenes.loading import load_scene

SCENE, SIZE = "sphere-spot", (32, 24)


def image_of(scene=SCENE, changes=None, model=None):
    """Return airlight and surfaces of a scene by the quadrature."""
    loaded = load_scene(scene, SIZE, changes or {})
    reference = read_reference(loaded.scene, *([] if model is None else [model]))
    image = quadrature_image(reference, checks=1)
    return np.stack([image.airlight, image.surface])


def camera():
    matrix = camera_matrix(load_scene(SCENE, SIZE).scene.sensors()[0])
    return matrix[:3, :3], matrix[:3, 3]


def aimed(right, up, clockwise):
    """Return the changes that turn the camera, by turns about its own axes, one after another."""
    frame, origin = camera()
    to_left, upwards, ahead = frame.T
    turns = Rotation.from_rotvec(np.deg2rad(-right * upwards - up * to_left))
    turns = turns * Rotation.from_rotvec(np.deg2rad(clockwise * ahead))
    return {"camera.target": origin + turns.apply(ahead), "camera.up": turns.apply(upwards)}


def moved(by):
    frame, origin = camera()
    return {"camera.origin": origin + by, "camera.target": origin + by + frame[:, 2]}


def diagnosed(values, scene=SCENE):
    return diagnose_image(
        Image({"airlight": values}), load_scene(scene, SIZE), layer="airlight", pixel="centre"
    )


@pytest.mark.parametrize(
    ("scenery", "changes"),
    [
        (Scenery(eye=(0.2, -0.1, 0.3)), lambda: moved(np.array([0.2, -0.1, 0.3]))),
        (Scenery(turned=(2.0, -1.0, 5.0)), lambda: aimed(2.0, -1.0, 5.0)),
        (Scenery(turned=(-3.0, 0.0, 0.0)), lambda: aimed(-3.0, 0.0, 0.0)),
    ],
)
def test_a_camera_elsewhere_sees_what_the_scene_says(variant, scenery, changes):
    reference = read_reference(load_scene(SCENE, SIZE).scene)
    view = view_of(reference, scenery=scenery)
    found = FogModel(view, scattering_paths(view, scenery)).layers(scene_fog(reference))
    expected = image_of(changes={name: tuple(v) for name, v in changes().items()})
    for values, correct in zip(found, expected.reshape(2, -1, 3), strict=True):
        # Cameras are in float32: a pixel at an edge of light or shadow may differ.
        error = np.abs(values - correct) / np.maximum(correct, 1e-2 * correct.mean())
        assert np.quantile(error, 0.95) < 1e-4


def test_a_turn_to_the_right_and_up_looks_there(variant):
    frame, _ = camera()
    to_left, upwards, _ = frame.T
    reference = read_reference(load_scene(SCENE, SIZE).scene)
    before = view_of(reference).axis
    for turned, towards in (((1.0, 0.0, 0.0), -to_left), ((0.0, 1.0, 0.0), upwards)):
        axis = view_of(reference, scenery=Scenery(turned=turned)).axis
        assert (axis - before) @ towards == pytest.approx(np.sin(np.deg2rad(1.0)))
    # Clockwise about its axis, the upper left corner comes to look to the upper right.
    view = view_of(reference, scenery=Scenery(turned=(0.0, 0.0, 90.0)))
    corner = view.reference.direction[0]
    assert corner @ to_left < 0 < corner @ upwards


def test_rays_may_end_before_surfaces(variant):
    """Each ray is then that of a fog that ends at its own distance."""
    reference = read_reference(load_scene(SCENE, SIZE).scene)
    fog, view = scene_fog(reference), view_of(reference)
    early = replace(fog, reach=0.8)
    found = FogModel(view, scattering_paths(view, ends=early.ends)).layers(early)
    hit = np.flatnonzero(np.isfinite(view.distance))[:: SIZE[0] * SIZE[1] // 6]
    assert len(hit) > 2
    for pixel in hit:
        own = replace(fog, far=0.8 * view.distance[pixel], spherical=True)
        one = view_of(reference, np.array([pixel]))
        layers = FogModel(one, scattering_paths(one, ends=own.ends)).layers(own)
        np.testing.assert_allclose(found[:, pixel], layers[:, 0], rtol=1e-9)


def slow(*values):
    """A diagnosis takes seconds: the fast tests have one of each kind."""
    return pytest.param(*values, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("tint", "first", "numbers", "words"),
    [
        ([1.0, 0.7, 1.0], "colour", (0.7,), "green is 0.7 times"),
        slow([0.9, 1.0, 1.3], "colour", (0.9, 1.0, 1.3), "red, green and blue are"),
        slow([1.2, 1.2, 1.2], "factor", (1.2,), "the image is 1.2 times"),
    ],
)
def test_a_channel_is_named_alone_and_three_with_their_factors(
    variant, tint, first, numbers, words
):
    said = diagnosed(image_of()[0] * tint)
    assert (said.first, said.ranked[0].parameters) == (first, pytest.approx(numbers, rel=1e-3))
    assert said.ranked[0].words.startswith(words)


def test_fog_without_attenuation_that_ends_is_named_with_its_end(variant):
    model = Model(camera_path="off", light_path="off", ends="spheres:0:9")
    said = diagnosed(image_of("open-fog", model=model)[0], "open-fog")
    assert said.first == "no-extinction"
    assert said.ranked[0].parameters == pytest.approx((9.0,), rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "numbers"),
    [
        ("camera-position", lambda: moved(np.array([0.15, 0.1, 0.1])), (0.15, 0.1, 0.1)),
        ("camera-direction", lambda: aimed(4.0, -2.0, 3.0), (4.0, -2.0, 3.0)),
    ],
)
def test_a_camera_elsewhere_is_named(variant, name, changes, numbers):
    airlight = image_of(changes={key: tuple(v) for key, v in changes().items()})[0]
    said = diagnosed(airlight)
    assert said.first == name, [row.words for row in said.ranked]
    assert said.ranked[0].parameters == pytest.approx(numbers, rel=0.05, abs=0.01)
