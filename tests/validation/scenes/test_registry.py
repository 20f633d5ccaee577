# SPDX-License-Identifier: BSD-3-Clause
"""Claim: built-in scenes are what their records say, and both readers read the same; the parts of scenes are sound."""

from functools import cache

import numpy as np
import pytest

from tests.helpers.meshes import directed_edges, volume
from validation.scenes.colonnade import _column
from validation.scenes.parts import lathe
from validation.scenes.registry import FOG_SCENES, SCENES
from validation.scenes.sphere_spot import _sphere
from validation.scenes.two_pens import _pen

CLOSED = {
    "cylinder": lambda: lathe([0.3, 0.4], [0.1, 1.7], 7),
    "column": _column,
    "pen": lambda: _pen(1.83),
    "sphere": _sphere,
}


COSTLY = ("cumulus", "cumulus-detail", "stratocumulus")  # seconds to build


@cache
def loaded(name):
    """A scene, built once for all tests that only look at it."""
    from validation.scenes.loading import load_scene

    return load_scene(name, (8, 6))


@pytest.mark.parametrize("name", CLOSED)
def test_closed_parts_are_oriented_the_same_way_everywhere(name):
    """Every edge has two faces that run through it in opposite directions, and the normals point outwards."""
    vertices, faces = CLOSED[name]()
    edges = directed_edges(faces)
    assert set(edges.values()) == {1}
    assert {(b, a) for a, b in edges} == set(edges)
    # Euler's formula of a closed surface without holes; every vertex is used.
    assert len(vertices) - len(edges) // 2 + len(faces) == 2
    assert set(faces.reshape(-1)) == set(range(len(vertices)))
    assert volume(vertices - vertices.mean(axis=0), faces) > 0


@pytest.mark.parametrize("name", FOG_SCENES)
def test_methods_and_truth_can_read_every_scene_alike(variant, name):
    """The two readers share no code: that they agree says that both are right."""
    from realtime.scene.read_scene import read_scene
    from reference.scene.read import read_truth

    built = loaded(name)
    scene, truth = read_scene(built.scene), read_truth(built.scene)
    assert built.name == name
    assert built.purpose.endswith(".")
    assert (scene.camera.width, scene.camera.height) == (truth.width, truth.height) == (8, 6)
    sigma_t = np.array([np.array(value)[0] for value in scene.medium.sigma_t])
    # Mitsuba holds both in float32: 6e-8.
    np.testing.assert_allclose(np.broadcast_to(sigma_t, 3), truth.medium.sigma_t, rtol=3e-7)
    np.testing.assert_allclose(np.array(scene.medium.albedo).reshape(-1), truth.medium.albedo, rtol=3e-7)
    _check_lights(scene, truth)


def _check_lights(scene, truth):
    if truth.area:
        assert scene.lights == truth.lights == truth.directional == ()
        (wide,), (counterpart,) = scene.area_lights, truth.area
        assert (wide.name, wide.kind, wide.opaque) == (counterpart.name, counterpart.kind, counterpart.opaque)
        np.testing.assert_allclose(wide.middle, counterpart.centre, rtol=3e-7)
        np.testing.assert_allclose(wide.radiance, counterpart.radiance, rtol=3e-7)
        np.testing.assert_allclose(wide.power, counterpart.power, rtol=1e-6)
        if wide.kind != "sphere":
            np.testing.assert_allclose(wide.normal, counterpart.normal, atol=1e-6)
        return
    (light,) = scene.lights
    (other,) = truth.lights + truth.directional
    if light.kind == "directional":
        of_methods, of_truth = light.axis, other.direction
        np.testing.assert_allclose(np.array(light.intensity).reshape(-1), other.irradiance, rtol=3e-7)
    else:
        of_methods, of_truth = light.position, other.position
    np.testing.assert_allclose(np.array(of_methods).reshape(-1), of_truth, rtol=3e-7)


@pytest.mark.claim("scenes-of-arbitrary-numbers")
@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=pytest.mark.slow if name in COSTLY else ()) for name in SCENES]
)
def test_no_number_of_a_scene_is_round(variant, name):
    """A constant of the code must not hide behind a 1 or a 2 of the scene."""
    import mitsuba as mi

    parameters = mi.traverse(loaded(name).scene)
    light = ("intensity.value", "irradiance.value", "radiance.value", "position")
    endings = ("albedo.value.value", "x_fov", "reflectance.value", *light)
    # A light with extent is black.
    keys = [key for key in sorted(parameters.keys()) if key.endswith(endings) and key != "lamp.bsdf.reflectance.value"]
    assert any(key.endswith("x_fov") for key in keys)
    assert any(key.endswith(light) for key in keys)
    for key in keys:
        for value in np.array(parameters[key], dtype=np.float64).reshape(-1):
            assert value % 0.5 != 0 or value > 10, (key, value)


@pytest.mark.parametrize(
    "name",
    [
        name if name in ("sphere-spot", "windows", "ring") else pytest.param(name, marks=pytest.mark.slow)
        for name in SCENES
    ],
)
def test_scenes_are_the_same_at_every_call(variant, name):
    from reference.storage.scene_digest import scene_digest
    from validation.scenes.loading import load_scene

    assert scene_digest(load_scene(name, (8, 6)).scene) == scene_digest(loaded(name).scene)
