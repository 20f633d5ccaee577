# SPDX-License-Identifier: BSD-3-Clause
"""The fog model: radiance from paths is that of the reference, whatever the lights and
media, and laws are its own.
"""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.point_light import ReferenceLight
from airlight.reference.scene.read import read_reference
from airlight.validation.fog_model.radiance import Fog, FogModel, scene_fog
from airlight.validation.fog_model.view import _level, scattering_paths, view_of
from airlight.validation.scenes.loading import load_scene
from tests.helpers.height_fog import LAMP, SPOT, SUN, fog_xml

SIZE = (24, 18)


def relative(values, wanted):
    finite = np.isfinite(wanted) & np.isfinite(values)
    floor = 1e-3 * wanted[finite].mean()
    return np.abs(values - wanted)[finite] / np.maximum(wanted[finite], max(floor, 1e-300))


def model_and_image(name):
    reference = read_reference(load_scene(name, SIZE).scene)
    view = view_of(reference)
    return reference, FogModel(view, scattering_paths(view)), quadrature_image(reference)


@pytest.mark.claim("fit-model")
@pytest.mark.parametrize(
    "name",
    [
        "sphere-spot",
        "three-media",
        *(
            pytest.param(name, marks=pytest.mark.slow)
            for name in ("open-fog", "omni-box", "windows", "clutter")
        ),
    ],
)
def test_radiance_is_that_of_the_reference(variant, name):
    reference, model, image = model_and_image(name)
    airlight, surface = model.layers(scene_fog(reference))
    # Nodes err by 3e-8 a panel where the integrand is smooth, by 2e-5 where a segment
    # grazes a sphere of medium.
    error = relative(airlight, image.airlight.reshape(-1, 3))
    assert np.quantile(error, 0.99) < 1e-6
    assert error.max() < 5e-5
    if image.surface.any():
        # Surfaces are cast in float32; a pixel whose shadow ray grazes an edge may differ.
        error = relative(surface, image.surface.reshape(-1, 3))
        assert np.quantile(error, 0.99) < 1e-5


@pytest.mark.claim("fit-model")
def test_radiance_in_height_fog_is_that_of_the_reference(variant, tmp_path):
    path = tmp_path / "fog.xml"
    path.write_text(fog_xml(LAMP, SPOT, SUN, size=SIZE))
    reference, model, image = model_and_image(str(path))
    airlight, surface = model.layers(scene_fog(reference))
    assert np.quantile(relative(airlight, image.airlight.reshape(-1, 3)), 0.99) < 1e-6
    assert np.quantile(relative(surface, image.surface.reshape(-1, 3)), 0.99) < 1e-5


def test_laws_can_be_changed_one_by_one(variant):
    reference = read_reference(load_scene("open-fog", SIZE).scene)
    view = view_of(reference)
    model, fog = FogModel(view, scattering_paths(view)), scene_fog(reference)
    nodes = model.lights[0].nodes
    right = model.layers(fog)[0]
    sigma_t = fog.sigma_t[0][0]
    strength = reference.medium.albedo[0] * sigma_t * model.lights[0].intensity[0] / (4 * np.pi)
    direction = reference.direction[nodes.ray]
    axis = model.view.axis

    def summed(depth, power=2.0, factor=1.0):
        value = factor * nodes.value[:, 0] / nodes.r**power
        return strength * np.bincount(nodes.ray, value * np.exp(-depth), len(right))

    assert right[:, 0] == pytest.approx(summed(sigma_t * (nodes.x + nodes.r)), rel=1e-9)
    for law, wanted in (
        ({"light_segment": (0.0, 0.0)}, summed(sigma_t * nodes.x)),
        ({"camera_segment": (0.0, 0.0)}, summed(sigma_t * nodes.r)),
        (
            {"planar": frozenset({"nodes"})},
            summed(sigma_t * (nodes.x * (direction @ axis) + nodes.r)),
        ),
        ({"law": (lambda r: r, None)}, summed(sigma_t * (nodes.x + nodes.r), 1.0)),
        (
            {"window": lambda r: np.exp(-r)},
            summed(sigma_t * (nodes.x + nodes.r), factor=np.exp(-nodes.r)),
        ),
        ({"airlight": (0.7,)}, 0.7 * right[:, 0]),
        ({"exposure": (3.0, 1.0, 1.0)}, 3 * right[:, 0]),
    ):
        assert model.layers(replace(fog, **law))[0][:, 0] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("law", [{"window": lambda r: np.exp(-r)}, {"law": (lambda r: r,) * 2}])
def test_the_light_of_a_sun_falls_with_no_distance(variant, tmp_path, law):
    """A range of the lamps beside it leaves it as it is."""
    path = tmp_path / "fog.xml"
    path.write_text(fog_xml(LAMP, SUN, size=SIZE))
    reference = read_reference(load_scene(str(path)).scene)
    view = view_of(reference)
    model, fog = FogModel(view, scattering_paths(view)), scene_fog(reference)
    for intensity, alike in (((0.0, 1.0), True), ((1.0, 0.0), False)):
        alone = replace(fog, intensity=intensity)
        before, after = model.layers(alone), model.layers(replace(alone, **law))
        assert before[0].mean() > 0
        assert np.array_equal(before, after) is alike


def test_a_channel_without_extinction_attenuates_no_unbounded_ray():
    """It was no number in all channels of such a medium: infinity times 0."""
    fog = Fog(((0.1, 0.0, 0.2),), ((1.0,) * 3,), (None,), (1.0,), (1.0,), (1.0,), ((0.0,) * 3,))
    rays = SimpleNamespace(direction=np.array([[0.0, 0.0, 1.0]] * 2), origin=np.zeros(3), media=())
    view = SimpleNamespace(
        reference=rays,
        axis=rays.direction[0],
        distance=np.array([np.inf, 5.0]),
        ray_pixel=np.arange(2),
    )
    expected = [[0.0, 1.0, 0.0], [np.exp(-0.5), 1.0, np.exp(-1.0)]]
    np.testing.assert_allclose(FogModel(view, ()).transmittance(fog), expected)


def test_the_fog_leaves_of_surfaces_what_is_not_its_opacity(variant):
    """Opacities of an equation were those of the physical one: its way to the camera and its cap
    were left out.
    """
    view = view_of(read_reference(load_scene("sphere-spot", (12, 9)).scene))
    model, fog = FogModel(view, scattering_paths(view, layers=(1,))), scene_fog(view.reference)
    bare = model.layers(replace(fog, camera_segment=(1.0, 0.0)))[1]
    lit = bare > 0
    assert lit.mean() > 0.1
    axis = frozenset({"nodes", "surfaces", "steps"})
    for change in (
        {},
        {"camera_segment": (1.0, 0.4)},
        {"camera_segment": (0.0, 2.5)},
        {"planar": axis},
        {"planar": axis - {"surfaces"}},
        {"planar": frozenset({"surfaces", "ends"})},
        {"planar": axis, "camera_segment": (0.3, 0.3), "near": 1.0, "far": 3.0},
        {"reach": 0.5, "most": 0.3},
        {"constant": (0.1, 0.2, 0.3), "most": 0.05},
    ):
        left = model.transmittance(replace(fog, **change))
        seen = model.layers(replace(fog, **change))[1]
        np.testing.assert_allclose((left * bare)[lit], seen[lit], rtol=1e-6, err_msg=str(change))
    # Fog that does not dim surfaces is blended by what dims itself, or by the extinction.
    for path in ((1.0, 0.0), (0.0, 0.0)):
        left = model.transmittance(replace(fog, camera_segment=path))
        assert np.array_equal(left, model.transmittance(fog))


@pytest.mark.parametrize("radius", [1e-9, 1e-3, 0.3])
def test_even_samples_of_a_sphere_give_its_light_however_small_and_far_it_is(radius):
    """By even normals: 2000 samples are the light of the sphere to 1 %, also where its
    solid angle is 1e-20 sr.
    """
    count = np.arange(2000) + 0.5
    z, turn = 1 - count / 1000, np.pi * (1 + np.sqrt(5)) * count
    normals = np.stack(
        [np.sqrt(1 - z**2) * np.cos(turn), np.sqrt(1 - z**2) * np.sin(turn), z], axis=1
    )
    lights = [ReferenceLight(radius * normal, np.ones(3), axis=normal) for normal in normals]
    r = np.array([1.0, 40.0, 1e4])
    # Distance and direction from each place to the first sample.
    way = lights[0].position - r[:, None] * np.array([0.6, 0.0, 0.8])
    length = np.linalg.norm(way, axis=1)
    for surface in (False, True):
        places = SimpleNamespace(r=length, towards=-way / length[:, None], is_surface=surface)
        level = _level(places, lights[0], SimpleNamespace(lights=lights), np.zeros(3))
        assert level == pytest.approx(1.0, rel=1e-2)
