# SPDX-License-Identifier: BSD-3-Clause
"""Claim: what a constant misses of multiple scattering, and what a constant distance
costs, are measured as said.
"""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.papers import scattering
from airlight.validation.papers.claims import INTERVAL, Figure


def test_multiple_scattering_is_the_worst_of_the_scenes_and_the_fraction_of_thin_fog(
    variant, monkeypatch
):
    thin = []

    def fraction(scene, batches, samples):
        thin.append(read_scene(scene).medium.sigma_t)
        return SimpleNamespace(medium=SimpleNamespace(value=0.01, interval=(0.008, 0.012)))

    monkeypatch.setattr(scattering, "multiple_scattering_fraction", fraction)
    monkeypatch.setattr(
        scattering, "_left_over", {"open-fog": 0.2, "two-pens": 0.5, "colonnade": 0.3}.__getitem__
    )
    assert scattering.multiple_scattering() == {
        "left over": 0.5,
        "thin": Figure(0.01, 0.008, 0.012, INTERVAL),
    }
    assert float(np.max(thin[0])) == pytest.approx(0.00173, rel=1e-5)


def test_two_and_more_scatterings_are_the_difference_of_depths(monkeypatch):
    """The noise of a seed is the same in both depths; two seeds stand apart."""
    asked = []

    def batches(scene, integrator, *, batches, samples, first_seed, max_depth):
        asked.append((first_seed, max_depth))
        layers = {64: 5.0, 2: 3.0}[max_depth] + np.arange(len(scattering.LAYERS))[
            :, None, None
        ] * np.ones((1, 4, 3))
        return SimpleNamespace(batches=SimpleNamespace(mean=layers))

    monkeypatch.setattr(scattering, "monte_carlo_batches", batches)
    np.testing.assert_allclose(scattering._multiple(None, 7), np.full((4, 3), 2.0))
    assert asked == [(7, 64), (7, 2)]


def test_the_ambient_fog_is_what_it_adds_to_the_airlight(variant):
    """Ambient light 1 over a ray of the optical depth tau adds albedo (1 - exp(-tau))."""
    scene = read_scene(scattering.load_scene("open-fog", (8, 6)).scene)
    ambient = scattering._ambient(scene)
    assert ambient.shape == (48, 3)
    albedo = np.array(scene.medium.albedo, dtype=float).ravel()
    assert (ambient >= 0).all()
    assert (ambient <= albedo * (1 + 1e-5)).all()
    assert ambient.max() > 0.1


def test_a_constant_distance_costs_more_the_more_a_medium_attenuates(variant, monkeypatch):
    monkeypatch.setattr(scattering, "SIZES", (0.83,))
    monkeypatch.setattr(scattering, "OPTICAL_DEPTHS", (0.03,))
    thin = scattering.constant_distance((8, 6))
    monkeypatch.setattr(scattering, "OPTICAL_DEPTHS", (0.03, 1.1))
    both = scattering.constant_distance((8, 6))
    assert 0 < thin["largest bias"] < 0.03
    assert 0.1 < both["largest bias"] < 1
    # The polynomial of degree 4 adds little to the error of the constant R,
    # the printed equation more.
    assert both["polynomial, largest"] >= both["polynomial, median"] == pytest.approx(1, abs=0.01)
    assert thin["printed, median"] > both["printed, median"] > 1.5


def test_a_sphere_fills_the_view_and_has_its_optical_depth(variant):
    scene = read_scene(mi.load_dict(scattering.sphere_in_vacuum(0.43, 3.1, (64, 48))))
    airlight = scattering._airlight(scene, "exact")[..., 1]
    rows = np.flatnonzero((airlight > 0).any(axis=1))
    assert len(rows) >= 46  # as high as the view
    (light,) = scene.lights
    assert np.linalg.norm(np.array(light.position)) == pytest.approx(0.97 / 0.43, rel=1e-5)
