# SPDX-License-Identifier: BSD-3-Clause
"""Filters of images are their definition, let nothing leak across an edge in depth, and
give numbers everywhere.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.realtime.image_filters import (
    Guide,
    Raster,
    bilateral,
    bilateral_of_levels,
    depth_guide,
    separable,
    small_pixels,
    tile_average,
    upsample,
)


def slow_bilateral(image, *, hd, guides=(), support=3.0):
    """Return an image (height, width) filtered; guides are pairs of an image (height,
    width[, n]) and its width.
    """
    height, width = image.shape
    reach = int(np.ceil(support * hd))
    filtered = np.empty_like(image, dtype=np.float64)
    for row in range(height):
        for column in range(width):
            total = weighed = 0.0
            for r in range(max(row - reach, 0), min(row + reach, height - 1) + 1):
                for c in range(max(column - reach, 0), min(column + reach, width - 1) + 1):
                    exponent = ((r - row) ** 2 + (c - column) ** 2) / hd**2
                    exponent += sum(
                        np.sum((g[r, c] - g[row, column]) ** 2) / w**2 for g, w in guides
                    )
                    fraction = np.exp(-0.5 * exponent)
                    total, weighed = total + fraction, weighed + fraction * image[r, c]
            filtered[row, column] = weighed / total
    return filtered


def slow_tile_average(image, *, guides=()):
    """Return the mean over 5 x 5 pixels, those at the ends with half a
    weight, weighted by guides.
    """
    fractions = np.outer([0.5, 1, 1, 1, 0.5], [0.5, 1, 1, 1, 0.5])
    height, width = image.shape
    averaged = np.empty_like(image, dtype=np.float64)
    for row in range(height):
        for column in range(width):
            total = weighed = 0.0
            for (down, right), fraction in np.ndenumerate(fractions):
                r, c = row + down - 2, column + right - 2
                if 0 <= r < height and 0 <= c < width:
                    fraction *= np.exp(
                        -0.5
                        * sum(np.sum((g[r, c] - g[row, column]) ** 2) / w**2 for g, w in guides)
                    )
                    total, weighed = total + fraction, weighed + fraction * image[r, c]
            averaged[row, column] = weighed / total
    return averaged


WIDTH, HEIGHT = 23, 17
LEVELS = 5


def noise(levels=LEVELS, seed=7):
    return np.random.default_rng(seed).integers(0, levels + 1, (HEIGHT, WIDTH)) / levels


def as_lanes(image):
    return mi.Float(np.ascontiguousarray(image, dtype=np.float32).ravel())


def as_image(lanes):
    return np.array(lanes, dtype=np.float64).reshape(HEIGHT, WIDTH)


def filtered(name, image, *, hd=1.7, hr=0.5, depth=None, support=3.0):
    """Run a filter by its name on an image (height, width)."""
    raster, lanes = Raster(WIDTH, HEIGHT), as_lanes(image)
    own = () if np.isinf(hr) else (Guide(lanes, hr),)
    guides = own if depth is None else (depth_guide(as_lanes(depth), 0.1),)
    if name == "levels":
        return as_image(
            bilateral_of_levels(lanes, raster, levels=LEVELS, hd=hd, hr=hr, support=support)
        )
    if name == "tile":
        return as_image(tile_average(lanes, raster, guides=guides))
    if name == "varying":
        return as_image(
            separable(
                lanes, raster, hd=mi.Float(hd) + 0 * lanes, guides=guides, support=support, most=hd
            )
        )
    function = {"bilateral": bilateral, "separable": separable}[name]
    return as_image(function(lanes, raster, hd=hd, guides=guides, support=support))


JOINT = ("bilateral", "separable", "varying", "tile")


@pytest.mark.claim(
    "filters-are-their-definition", tolerance="2e-6: float32 sums of up to 400 weights"
)
@pytest.mark.parametrize(
    ("name", "hr"), [("bilateral", 0.5), ("levels", 0.5), ("separable", np.inf)]
)
def test_the_sums_are_those_of_the_definition(variant, name, hr):
    image = noise()
    guides = () if np.isinf(hr) else ((image, hr),)
    wanted = slow_bilateral(image, hd=1.7, guides=guides, support=2.0)
    np.testing.assert_allclose(filtered(name, image, hr=hr, support=2.0), wanted, atol=2e-6)


def test_the_tile_average_is_its_definition(variant):
    image, depth = noise(), np.random.default_rng(4).uniform(1, 1.5, (HEIGHT, WIDTH))
    np.testing.assert_allclose(
        filtered("tile", image, hr=np.inf), slow_tile_average(image), atol=2e-6
    )
    wanted = slow_tile_average(image, guides=((np.log(depth), 0.1),))
    np.testing.assert_allclose(filtered("tile", image, depth=depth), wanted, atol=1e-5)


@pytest.mark.claim("filters-do-not-leak", tolerance="1e-3 across a doubling of the depth")
@pytest.mark.parametrize("name", JOINT)
def test_nothing_leaks_across_a_depth_edge(variant, name):
    depth = np.where(np.arange(WIDTH) < 11, 2.0, 4.0) * np.ones((HEIGHT, 1))
    image = np.where(depth < 3, 0.0, 1.0)
    assert np.max(np.abs(filtered(name, image, depth=depth) - image)) < 1e-3


@pytest.mark.parametrize("name", JOINT)
def test_sky_and_zero_depth_give_numbers(variant, name):
    depth = np.random.default_rng(6).choice(
        [0.0, -1.0, np.nan, np.inf, 2.0, 2.05, 1e-40], (HEIGHT, WIDTH)
    )
    image = noise()
    result = filtered(name, image, depth=depth)
    assert np.all(np.isfinite(result))
    sky = filtered(name, image, depth=np.full((HEIGHT, WIDTH), np.inf))
    np.testing.assert_allclose(sky, filtered(name, image, hr=np.inf), atol=1e-6)


def test_levels_leave_out_what_is_not_there(variant):
    image, there = noise(), np.random.default_rng(9).uniform(size=(HEIGHT, WIDTH)) < 0.7
    lanes = bilateral_of_levels(
        as_lanes(image),
        Raster(WIDTH, HEIGHT),
        levels=LEVELS,
        hd=1.7,
        hr=0.5,
        there=mi.Bool(there.ravel()),
    )
    # Far away from all by a second guide is what is not there.
    wanted = slow_bilateral(image, hd=1.7, guides=((image, 0.5), (np.where(there, 0.0, 1e3), 1.0)))
    np.testing.assert_allclose(as_image(lanes)[there], wanted[there], atol=2e-6)
    assert np.all(as_image(lanes)[~there] == np.float32(image)[~there])


def test_a_width_by_pixel_counts_the_taps_of_each_pixel(variant):
    """Where the width is that of one pixel, so is the result of the Gaussian of
    this width along one row.
    """
    row = np.random.default_rng(8).uniform(size=40)
    widths = np.where(np.arange(40) < 20, 0.8, 2.5)
    raster = Raster(40, 1)
    varying = np.array(separable(mi.Float(row), raster, hd=mi.Float(widths), most=2.5))
    for hd in (0.8, 2.5):
        wanted = slow_bilateral(row[None], hd=hd)[0]
        np.testing.assert_allclose(varying[widths == hd], wanted[widths == hd], atol=1e-6)


# Up-sampling: bilinear on a surface, the nearest depth elsewhere ----------------------------------


COLUMNS, ROWS = 24, 16


def upsampled(image, depth, scale):
    """Take every `scale`-th pixel of an image and interpolate them again."""
    large, small = Raster(COLUMNS, ROWS), Raster(COLUMNS // scale, ROWS // scale)
    pixel = np.array(small_pixels(small, scale, COLUMNS))
    guide = depth_guide(mi.Float(depth.ravel()), 0.1)
    small_guide = Guide(mi.Float(np.array(guide.values)[pixel]), guide.width)
    column, row = large.places()
    lanes = upsample(
        mi.Float(image.ravel()[pixel]),
        small_guide,
        guide.values,
        small,
        scale=scale,
        column=column,
        row=row,
    )
    return np.array(lanes).reshape(ROWS, COLUMNS)


@pytest.mark.parametrize("scale", [2, 4])
def test_a_plane_is_interpolated(variant, scale):
    row, column = np.mgrid[:ROWS, :COLUMNS]
    image = 0.3 + 0.1 * column - 0.05 * row
    inner = slice(scale, -scale), slice(scale, -scale)
    result = upsampled(image, np.full(image.shape, np.inf), scale)
    np.testing.assert_allclose(result[inner], image[inner], atol=2e-6)


@pytest.mark.claim("filters-do-not-leak", tolerance="1e-3 across a doubling of the depth")
@pytest.mark.parametrize("scale", [1, 2, 4])
def test_upsampling_leaks_nothing_across_a_depth_edge(variant, scale):
    depth = np.where(np.arange(COLUMNS) < 11, 2.0, 4.0) * np.ones((ROWS, 1))
    image = np.where(depth < 3, 0.0, 1.0)
    np.testing.assert_allclose(upsampled(image, depth, scale), image, atol=1e-3)


def test_a_thin_bar_takes_the_nearest_depth(variant):
    """A bar of one pixel between columns 6 and 10 of the small image,
    which are 4 and 2.5 m away.
    """
    depth, image = np.full((ROWS, COLUMNS), 4.0), np.ones((ROWS, COLUMNS))
    depth[:, 9:], image[:, 9:] = 2.5, 0.5
    depth[:, 8] = 1.0
    assert upsampled(image, depth, 4)[8, 8] == pytest.approx(0.5)


def test_upsampling_gives_numbers_for_sky_and_zero_depth(variant):
    depth = np.random.default_rng(2).choice([0.0, np.inf, np.nan, 2.0], (ROWS, COLUMNS))
    assert np.all(
        np.isfinite(upsampled(np.random.default_rng(3).uniform(size=depth.shape), depth, 2))
    )
