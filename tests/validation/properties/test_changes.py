# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the changes of the airlight say beforehand how far off a method without shadows, or with few points, is."""

from dataclasses import replace

import numpy as np
import pytest

from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from validation.configurations.methods import Configuration, prepared
from validation.properties.changes import MOST, _change, change_properties
from validation.scenes.loading import load_scene


def _scene(name, size=(160, 120)):
    return read_scene(load_scene(name, size).scene)


def _airlight(scene, *chosen):
    return np.array(render_frame(prepared(scene, Configuration(*chosen))).airlight, np.float64)


@pytest.mark.claim("change-without-shadows", tolerance="20 %: 80 x 60 rays of 16 steps, not all pixels")
@pytest.mark.parametrize("name", ["sphere-spot", "clutter", "windows"])
def test_without_shadows_it_is_the_error_of_the_method_that_has_none(variant, name):
    scene = _scene(name)
    exact, unshadowed = (_airlight(scene, method, "exact") for method in ("shadow-planes", "unshadowed"))
    error = np.sqrt(np.mean((unshadowed - exact) ** 2)) / exact.mean()
    found = change_properties(scene)
    assert found["change_without_shadows"] == pytest.approx(error, rel=0.2)
    assert found["change_with_points"] == 0
    assert found["shadows_seen"] == 1


def test_more_points_change_the_airlight_of_a_light_with_extent(variant):
    soft = _scene("penumbra-plane", (32, 24))
    found = change_properties(soft)
    assert 0 < found["change_with_points"] < 0.5 * found["change_without_shadows"]


def test_nothing_changes_where_nothing_is_in_shadow(variant):
    open_fog = _scene("open-fog", (32, 24))
    assert set(change_properties(open_fog).values()) == {0.0}


def test_an_image_of_few_pixels_has_no_more_rays(variant):
    small = _scene("sphere-spot", (8, 6))
    assert change_properties(small) == change_properties(replace(small))
    assert 0 < change_properties(small)["change_without_shadows"] < MOST


def test_what_is_left_of_no_airlight_has_a_bound():
    dark = np.zeros((3, 2))
    assert _change(dark, dark) == 0
    assert _change(dark + 1e-3, dark) == MOST
    assert _change(dark + 1, dark + 1e-9) == MOST
    assert _change(dark + 3, dark + 2) == pytest.approx(0.5)
