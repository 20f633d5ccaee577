# SPDX-License-Identifier: BSD-3-Clause
"""Claim: built-in scenes are what their records say, and both readers read the same."""

import tomllib
from functools import cache

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.scene.read_scene import read_scene
from airlight.reference.quadrature.light_airlight import lit_rays
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.scene_digest import scene_digest
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.registry import FILES, FOG_SCENES, SCENES

#: As the records say.
TRIANGLES = {
    "two-pens": 34_549,
    "three-media": 14_785,
    "clutter": 20_747,
    "hall": 107_514,
    "colonnade": 66_132,
}
TRIANGLES |= {"tangle": 188_082, "omni-box": 166}
COSTLY = ("cumulus", "cumulus-detail", "stratocumulus")  # seconds to build


@cache
def loaded(name):
    """A scene, built once for all tests that only look at it."""
    return load_scene(name, (8, 6))


@pytest.mark.parametrize("name", FOG_SCENES)
def test_methods_and_reference_can_read_every_scene_alike(variant, name):
    """The two readers share no code: that they agree says that both are right."""
    built = loaded(name)
    scene, reference = read_scene(built.scene), read_reference(built.scene)
    assert built.name == name
    assert built.purpose.endswith(".")
    assert (
        (scene.camera.width, scene.camera.height) == (reference.width, reference.height) == (8, 6)
    )
    sigma_t = np.array([np.array(value)[0] for value in scene.medium.sigma_t])
    # Mitsuba holds both in float32: 6e-8.
    np.testing.assert_allclose(np.broadcast_to(sigma_t, 3), reference.medium.sigma_t, rtol=3e-7)
    np.testing.assert_allclose(
        np.array(scene.medium.albedo).reshape(-1), reference.medium.albedo, rtol=3e-7
    )
    _check_lights(scene, reference)


def _check_lights(scene, reference):
    if reference.area:
        assert scene.lights == reference.lights == reference.directional == ()
        (wide,), (counterpart,) = scene.area_lights, reference.area
        assert (wide.name, wide.kind, wide.opaque) == (
            counterpart.name,
            counterpart.kind,
            counterpart.opaque,
        )
        np.testing.assert_allclose(wide.middle, counterpart.centre, rtol=3e-7)
        np.testing.assert_allclose(wide.radiance, counterpart.radiance, rtol=3e-7)
        np.testing.assert_allclose(wide.power, counterpart.power, rtol=1e-6)
        if wide.kind != "sphere":
            np.testing.assert_allclose(wide.normal, counterpart.normal, atol=1e-6)
        return
    (light,) = scene.lights
    (other,) = reference.lights + reference.directional
    if light.kind == "directional":
        of_methods, of_reference = light.axis, other.direction
        np.testing.assert_allclose(
            np.array(light.intensity).reshape(-1), other.irradiance, rtol=3e-7
        )
    else:
        of_methods, of_reference = light.position, other.position
    np.testing.assert_allclose(np.array(of_methods).reshape(-1), of_reference, rtol=3e-7)


@pytest.mark.claim("scenes-of-arbitrary-numbers")
@pytest.mark.parametrize(
    "name",
    [pytest.param(name, marks=pytest.mark.slow if name in COSTLY else ()) for name in SCENES],
)
def test_no_number_of_a_scene_is_round(variant, name):
    """A constant of the code must not hide behind a 1 or a 2 of the scene."""
    parameters = mi.traverse(loaded(name).scene)
    light = ("intensity.value", "irradiance.value", "radiance.value", "position")
    endings = ("albedo.value.value", "x_fov", "reflectance.value", *light)
    # An area light is black.
    keys = [
        key
        for key in sorted(parameters.keys())
        if key.endswith(endings) and key != "lamp.bsdf.reflectance.value"
    ]
    assert any(key.endswith("x_fov") for key in keys)
    assert any(key.endswith(light) for key in keys)
    for key in keys:
        for value in np.array(parameters[key], dtype=np.float64).reshape(-1):
            assert value % 0.5 != 0 or value > 10, (key, value)


@pytest.mark.parametrize(
    "name",
    [
        name
        if name in ("sphere-spot", "windows", "ring")
        else pytest.param(name, marks=pytest.mark.slow)
        for name in SCENES
    ],
)
def test_scenes_are_the_same_at_every_call(variant, name):
    assert scene_digest(load_scene(name, (8, 6)).scene) == scene_digest(loaded(name).scene)


@pytest.mark.parametrize("name", TRIANGLES)
def test_scenes_have_as_many_triangles_as_their_records_say(variant, name):
    assert sum(shape.face_count() for shape in loaded(name).scene.shapes()) == TRIANGLES[name]


def test_sun_comes_in_by_the_windows_alone(variant):
    """Lit parts of rays lead back to a pane: what the wall's openings let through, in
    coordinates of the wall.
    """
    reference = read_reference(load_scene("windows", (40, 30)).scene)
    wall = tomllib.loads(FILES[0].read_text())["windows"]["shapes"][1]
    left, front = wall["corner"][:2]
    intervals = lit_rays(reference, reference.directional[0], surface_hits(reference).distance).lit
    assert intervals.transitions > 500
    assert intervals.random_checks.left == 0
    x, width = 0.5 * (intervals.low + intervals.high), intervals.high - intervals.low
    point = reference.origin + x[:, None] * reference.direction[intervals.ray]
    # The room alone, and no seams: vertices are float32, so shapes that
    # touch are a micrometre apart.
    behind, beside = (
        point[:, 0] > left,
        np.abs(point[:, 1] - front - wall["along"][-1] / 2) < wall["along"][-1] / 2,
    )
    point = point[behind & beside & (point[:, 2] < wall["up"][-1]) & (width > 1e-5)]
    assert len(point) > 500
    towards = -reference.directional[0].direction
    at_wall = point + ((left - point[:, 0]) / towards[0])[:, None] * towards
    along, up = (
        np.searchsorted(wall["along"], at_wall[:, 1] - front),
        np.searchsorted(wall["up"], at_wall[:, 2]),
    )
    assert np.all((along % 2 == 0) & (up % 2 == 0))
