# SPDX-License-Identifier: BSD-3-Clause
"""Frames of one-dimensional min/max mipmaps against the reference, and against light volumes of the same map."""

import numpy as np
import pytest

from realtime.frame.renderer import render_frame
from realtime.scene.read_scene import read_scene
from tests.helpers.frames import frame, reference_of, relative_rmse
from tests.helpers.light_frames import SIZE, camera, coloured_fog, lamp
from tests.helpers.scenes import spot, tiny_scene
from validation.scenes.loading import load_scene
from validation.study.configuration import configuration, prepared

MAP = 256
CHANGES = {
    "light in view": lambda: camera((-2.5, -2.2, 0.3), (0.9, 0.7, 1.9)),
    "light behind": lambda: camera((1.7, 1.6, 2.9), (-0.9, -0.7, -0.1)),
    "spot": lambda: {"lamp": spot()},
    "colour, HG, two lights": lambda: {"fog": coloured_fog(), "second": lamp(-1, 1.4, 0.6)},
}
ALL = [pytest.param(change, marks=pytest.mark.slow) if "HG" in change else change for change in CHANGES]


def scene_with(change):
    return tiny_scene(size=SIZE, **CHANGES[change]())


def render(scene, method, **parameters):
    return frame(scene, method, **parameters).airlight


@pytest.mark.claim("tree-of-bounds", tolerance="a fifth of the shadows; 0.4 of the error with an eighth of the texel")
@pytest.mark.parametrize("change", ALL)
def test_every_pixel_comes_to_the_reference_as_the_map_grows(variant, change):
    """Where the map jumps a wall leans over one texel: the error falls as its size, as its root at grazing rays."""
    scene = scene_with(change)
    expected = reference_of(scene).airlight
    errors = [
        relative_rmse(render(scene, "min-max", map=size, sampling="pixels", slices=1600), expected)
        for size in (64, 512)
    ]
    bare = relative_rmse(render(scene, "unshadowed"), expected)
    assert errors[1] < 0.4 * errors[0]
    assert errors[1] < 0.2 * bare


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 2e-3")
@pytest.mark.parametrize("change", ALL)
def test_slices_converge_to_the_light_volume(variant, change):
    """It has the same height field, in another way."""
    scene = scene_with(change)
    expected = render(scene, "light-volumes", map=MAP, walls="slanted")
    errors = [
        relative_rmse(render(scene, "min-max", map=MAP, sampling="pixels", slices=count), expected)
        for count in (200, 1600)
    ]
    # Measured 1.5e-3 at most, what sampling the height field once more is wrong by.
    assert errors[1] < 2e-3
    # First order, down to that and to rounding.
    assert errors[1] < max(0.6 * errors[0], 1e-6)


@pytest.mark.claim("slices-converge", tolerance="relative RMSE 6e-3")
@pytest.mark.parametrize("change", ALL)
def test_samples_converge_to_all_pixels(variant, change):
    scene = scene_with(change)
    expected = render(scene, "min-max", map=MAP, sampling="pixels", slices=1600)
    fine, coarse = (
        relative_rmse(render(scene, "min-max", map=MAP, **settings), expected)
        for settings in ({"slices": 200, "samples": 256, "step": 1}, {"slices": 30, "samples": 32, "step": 16})
    )
    assert fine < max(0.25 * coarse, 1e-6)
    # Measured 3.8e-3 at most: slices are half a pixel apart, and the mean of two is as wrong as the nearest.
    assert fine < 6e-3


@pytest.mark.claim("a-lit-share")
def test_no_pixel_is_brighter_than_without_shadows(variant):
    """Lights in view and sharp phase functions: shares of a rough estimate made an image 363 times too bright."""
    scene = read_scene(load_scene("random:427", (80, 60)).scene)
    image, bare = (
        np.asarray(render_frame(prepared(scene, configuration(method, None, {}))).airlight)
        for method in ("min-max", "unshadowed")
    )
    # Sums over lit intervals and the whole ray are rounded differently, and in float32 by the quadrature's size.
    assert (image <= bare * 1.01 + 1e-4 * bare.mean()).all()
    assert image.mean() < bare.mean()
