# SPDX-License-Identifier: BSD-3-Clause
"""The width of a penumbra is that of similar triangles, and the filter for N levels is as wide as serves them best."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from realtime.image_filters import Raster, depth_guide
from realtime.methods.soft_shafts.surfaces import AUTO_WIDTH, few_pixels, penumbra_width
from realtime.numerics.array_types import two_numbers
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene


def staircase_error(width, levels, hd):
    """Return the RMS error of a linear penumbra, `width` pixels wide, from N levels filtered by a Gaussian of `hd`."""
    x = np.arange(-300, 301.0)
    taps = np.exp(-0.5 * (np.arange(-150, 151) / hd) ** 2)
    squares = []
    for shift in np.arange(12) / 12:
        true = np.clip((x + shift) / width + 0.5, 0, 1)
        filtered = np.convolve(np.floor(true * levels + 0.5 - 1e-9) / levels, taps / taps.sum(), "same")
        squares.append(np.mean((filtered - true)[np.abs(x) < width] ** 2))
    return np.sqrt(np.mean(squares))


@pytest.mark.claim("auto-width-fits", tolerance="1.3 times the least error of any width")
@pytest.mark.parametrize("levels", [3, 5, 16])
@pytest.mark.parametrize("width", [32, 128])
def test_the_automatic_width_is_nearly_the_best(variant, levels, width):
    widths = np.geomspace(0.1, 1.0, 30) * width / levels
    least = min(staircase_error(width, levels, hd) for hd in widths)
    own = staircase_error(width, levels, AUTO_WIDTH * width / levels)
    assert own < 1.3 * least
    assert own < 0.6 * staircase_error(width, levels, 1e-3)


@pytest.mark.parametrize("ratios", [(0.7,), (0.2, 0.8)])
def test_the_width_of_a_penumbra_follows_from_similar_triangles(variant, ratios):
    """Bars over a floor: w = L (d_r - d_b) / d_b, over the size of a pixel there; of two the geometric mean."""
    camera = read_scene(mi.load_dict(tiny_scene(size=(160, 120)))).camera
    raster, distance = Raster(160, 120), dr.full(mi.Float, 3.0, 160 * 120)
    few, step = few_pixels(raster)
    assert (few, step) == (Raster(40, 30), 4)
    light = 0.31
    # Every second pixel is lit, and takes the width of its neighbours.
    blocked = mi.Float(np.tile([0.0, 1.0], few.count // 2))
    blockers = two_numbers(mi.Float)(blocked * sum(np.log(ratios)), blocked * len(ratios))
    guide = depth_guide(distance, 0.1)
    width = np.array(penumbra_width(blockers, distance, camera, mi.Float(light), raster, guide=guide))
    pixel = 3.0 * np.linalg.norm(np.array(camera.left).ravel())
    np.testing.assert_allclose(width, light * np.prod(ratios) ** (1 / len(ratios)) / pixel, rtol=1e-4)
