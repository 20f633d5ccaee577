# SPDX-License-Identifier: BSD-3-Clause
"""Up-sampling with a depth test: bilinear on a surface, nothing across its edge, and the nearest depth elsewhere."""

import mitsuba as mi
import numpy as np
import pytest

from realtime.image_filters import Guide, Raster, depth_guide, small_pixels, upsample

WIDTH, HEIGHT = 24, 16


def upsampled(image, depth, scale):
    """Take every `scale`-th pixel of an image and interpolate them again."""
    large, small = Raster(WIDTH, HEIGHT), Raster(WIDTH // scale, HEIGHT // scale)
    pixel = np.array(small_pixels(small, scale, WIDTH))
    guide = depth_guide(mi.Float(depth.ravel()), 0.1)
    small_guide = Guide(mi.Float(np.array(guide.values)[pixel]), guide.width)
    column, row = large.places()
    lanes = upsample(
        mi.Float(image.ravel()[pixel]), small_guide, guide.values, small, scale=scale, column=column, row=row
    )
    return np.array(lanes).reshape(HEIGHT, WIDTH)


@pytest.mark.parametrize("scale", [2, 4])
def test_a_plane_is_interpolated(variant, scale):
    row, column = np.mgrid[:HEIGHT, :WIDTH]
    image = 0.3 + 0.1 * column - 0.05 * row
    inner = slice(scale, -scale), slice(scale, -scale)
    result = upsampled(image, np.full(image.shape, np.inf), scale)
    np.testing.assert_allclose(result[inner], image[inner], atol=2e-6)


@pytest.mark.claim("filters-do-not-leak", tolerance="1e-3 across a doubling of the depth")
@pytest.mark.parametrize("scale", [1, 2, 4])
def test_nothing_leaks_across_a_depth_edge(variant, scale):
    depth = np.where(np.arange(WIDTH) < 11, 2.0, 4.0) * np.ones((HEIGHT, 1))
    image = np.where(depth < 3, 0.0, 1.0)
    np.testing.assert_allclose(upsampled(image, depth, scale), image, atol=1e-3)


def test_a_thin_bar_takes_the_nearest_depth(variant):
    """A bar of one pixel between columns 6 and 10 of the small image, which are 4 and 2.5 m away."""
    depth, image = np.full((HEIGHT, WIDTH), 4.0), np.ones((HEIGHT, WIDTH))
    depth[:, 9:], image[:, 9:] = 2.5, 0.5
    depth[:, 8] = 1.0
    assert upsampled(image, depth, 4)[8, 8] == pytest.approx(0.5)


def test_sky_and_zero_depth_give_numbers(variant):
    depth = np.random.default_rng(2).choice([0.0, np.inf, np.nan, 2.0], (HEIGHT, WIDTH))
    assert np.all(np.isfinite(upsampled(np.random.default_rng(3).uniform(size=depth.shape), depth, 2)))
