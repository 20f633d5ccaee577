# SPDX-License-Identifier: BSD-3-Clause
"""The fog model: radiance from paths is that of the truth, whatever the lights and media; so are its slopes."""

from dataclasses import replace

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from reference.quadrature.image import quadrature_image
from reference.scene.read import read_truth
from validation.fog_model.build import scattering_paths
from validation.fog_model.fog import scene_fog
from validation.fog_model.nodes import panel_nodes
from validation.fog_model.radiance import as_array, fog_airlight, fog_surface, fog_total, on_device
from validation.scenes.loading import load_scene

SIZE = (24, 18)


def relative(values, wanted):
    finite = np.isfinite(wanted) & np.isfinite(values)
    floor = 1e-3 * wanted[finite].mean()
    return np.abs(values - wanted)[finite] / np.maximum(wanted[finite], max(floor, 1e-300))


@pytest.mark.claim("fit-model")
@pytest.mark.parametrize(
    "name",
    [
        "sphere-spot",
        "three-media",
        *(pytest.param(name, marks=pytest.mark.slow) for name in ("open-fog", "omni-box", "windows", "clutter")),
    ],
)
def test_radiance_is_that_of_the_truth(variant, name):
    truth = read_truth(load_scene(name, SIZE).scene)
    image = quadrature_image(truth)
    paths, fog = on_device(scattering_paths(truth)), scene_fog(truth)
    # Nodes err by 3e-8 a panel where the integrand is smooth, by 2e-5 where a leg grazes a sphere of medium.
    error = relative(as_array(fog_airlight(paths, fog)), image.airlight.reshape(-1, 3))
    assert np.quantile(error, 0.99) < 1e-6
    assert error.max() < 5e-5
    if image.surface.any():
        # Surfaces are cast in float32; a pixel whose shadow ray grazes an edge may differ.
        error = relative(as_array(fog_surface(paths, fog)), image.surface.reshape(-1, 3))
        assert np.quantile(error, 0.99) < 1e-5


def test_laws_can_be_changed_one_by_one(variant):
    truth = read_truth(load_scene("open-fog", SIZE).scene)
    paths, fog = scattering_paths(truth), scene_fog(truth)
    device, nodes = on_device(paths), paths.lights[0].nodes
    right = as_array(fog_airlight(device, fog))
    sigma_t = fog.sigma_t[0][0]
    strength = truth.medium.albedo[0] * sigma_t * paths.lights[0].intensity[0] / (4 * np.pi)

    def summed(depth, power=2.0):
        return strength * np.bincount(nodes.ray, nodes.weight / nodes.r**power * np.exp(-depth), len(right))

    assert right[:, 0] == pytest.approx(summed(sigma_t * (nodes.x + nodes.r)), rel=1e-9)
    for law, wanted in (
        ({"light_leg": 0.0}, summed(sigma_t * nodes.x)),
        ({"camera_leg": 0.0}, summed(sigma_t * nodes.r)),
        ({"distance_power": 1.0}, summed(sigma_t * (nodes.x + nodes.r), 1.0)),
        ({"exposure": (3.0, 1.0, 1.0)}, 3 * right[:, 0]),
    ):
        assert as_array(fog_airlight(device, replace(fog, **law)))[:, 0] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("name", ["sphere-spot", pytest.param("three-media", marks=pytest.mark.slow)])
def test_derivatives_are_those_of_differences(variant, name):
    truth = read_truth(load_scene(name, SIZE).scene)
    paths, fog = on_device(scattering_paths(truth)), scene_fog(truth)

    def changed(extinction, leg, power, along):
        sigma_t = tuple(tuple(value * extinction for value in colour) for colour in fog.sigma_t)
        moved = ((along, 0.5 * along, 0.0), *fog.moved[1:])
        return replace(fog, sigma_t=sigma_t, light_leg=leg, distance_power=power, moved=moved)

    place = [1.0, 1.0, 2.0, 0.0]
    step = 1e-6
    for number in range(len(place)):
        inner = [dr.opaque(mi.Float64, value) for value in place]
        dr.enable_grad(inner[number])
        columns = fog_total(paths, changed(*inner))
        dr.forward(inner[number])
        slope = np.stack([np.array(dr.grad(column)) for column in columns], axis=1)
        ends = []
        for sign in (1, -1):
            inner = [mi.Float64(v + sign * step * (n == number)) for n, v in enumerate(place)]
            ends.append(as_array(fog_total(paths, changed(*inner))))
        difference = (ends[0] - ends[1]) / (2 * step)
        # Central differences err by the square of the step, 1e-12, and by rounding over the step, 1e-10.
        assert slope == pytest.approx(difference, rel=1e-6, abs=1e-7 * np.abs(difference).max())


def test_nodes_integrate_what_they_should():
    start, width = np.array([-3.0, 0.2, 1.0]), np.array([5.0, 0.4, 2.4])
    owner, place, weight = panel_nodes(start, width)
    assert np.bincount(owner, weight) == pytest.approx(width, rel=1e-14)
    integral = np.bincount(owner, weight / np.cosh(place))
    wanted = np.arctan(np.sinh(start + width)) - np.arctan(np.sinh(start))
    assert integral == pytest.approx(wanted, rel=1e-7)
    assert (np.diff(owner) >= 0).all()
    owner, place, weight = panel_nodes(start, width, orders=(4, 2))
    assert np.bincount(owner, weight / np.cosh(place)) == pytest.approx(wanted, rel=1e-3)
    assert len(owner) == 4 * 3 + 2 + 4
