# SPDX-License-Identifier: BSD-3-Clause
"""The width of a penumbra is that of similar triangles, and the filter for N levels is as wide as serves them best."""

import numpy as np
import pytest


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
    from realtime.methods.soft_shafts.surfaces import AUTO_WIDTH

    widths = np.geomspace(0.1, 1.0, 30) * width / levels
    least = min(staircase_error(width, levels, hd) for hd in widths)
    own = staircase_error(width, levels, AUTO_WIDTH * width / levels)
    assert own < 1.3 * least
    assert own < 0.6 * staircase_error(width, levels, 1e-3)


def test_the_width_of_a_penumbra_follows_from_similar_triangles(variant):
    """A bar over a floor: w = L (d_r - d_b) / d_b, over the size of a pixel there."""
    import drjit as dr
    import mitsuba as mi

    from realtime.image_filters.guides import depth_guide
    from realtime.image_filters.raster import Raster
    from realtime.methods.soft_shafts.light_sources import SourceState
    from realtime.methods.soft_shafts.surfaces import Reached, penumbra_width
    from realtime.scene.read_scene import read_scene
    from tests.helpers.scenes import tiny_scene

    class FrameOf:
        """What `penumbra_width` asks of a view."""

    scene = read_scene(mi.load_dict(tiny_scene(size=(160, 120))))
    view, count = FrameOf(), 160 * 120
    view.camera, view.distance = scene.camera, dr.full(mi.Float, 3.0, count)
    ratio, light = 0.7, 0.31
    half = mi.Float(
        np.repeat(np.tile([1.0, 0.0], count // 8), 4)
    )  # four of eight are lit, and take the width of its neighbours
    reached = Reached(half, dr.full(mi.Float, 1, count), ratio * (1 - half), 1 - half)
    state = SourceState(None, mi.Float(light), True, None)
    raster, guide = Raster(160, 120), depth_guide(view.distance, 0.1)
    width = np.array(penumbra_width(view, reached, state, raster, guide=guide))
    pixel = 3.0 * np.linalg.norm(np.array(scene.camera.left).ravel())
    np.testing.assert_allclose(width, light * ratio / pixel, rtol=1e-4)
