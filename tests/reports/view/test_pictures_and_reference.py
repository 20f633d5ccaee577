# SPDX-License-Identifier: BSD-3-Clause
"""What the page shows: pictures with the curve of the previews, and an error that covers that of the whole image."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from reports.plotting.colour_maps import NOT_FINITE
from reports.plotting.pictures import tone_mapped
from reports.view.picture import LAYERS, Pictures
from reports.view.reference_order import KnownReference, view_error
from validation.metrics.errors import error_metrics

WIDTH, HEIGHT = 50, 37


@pytest.mark.claim("view-error", tolerance="none for all pixels; 190 of 200 intervals of 95 % for a part, less 4 sigma")
def test_error_of_a_part_covers_that_of_the_whole():
    random = np.random.default_rng(7)
    reference = 1 + random.random((HEIGHT, WIDTH, 3))
    test = reference * (1 + 0.1 * random.standard_normal((HEIGHT, WIDTH, 3)))
    whole = error_metrics(reference, test)
    assert view_error(KnownReference.of_size(WIDTH, HEIGHT), test) is None
    flat, covered = reference.reshape(-1, 3), 0
    for seed in range(200):
        pixels = np.random.default_rng(seed).permutation(WIDTH * HEIGHT)[:400]
        known = KnownReference.of_size(WIDTH, HEIGHT)
        known.add(pixels, flat[pixels], flat[pixels], np.full((400, 3), 1e-9))
        error = view_error(known, test)
        assert (error.known, error.pixels) == (400, WIDTH * HEIGHT)
        covered += abs(error.relative_rmse - whole.relative_rmse) <= error.interval
    assert 177 <= covered <= 200
    known.add(np.arange(WIDTH * HEIGHT), flat, flat, np.full((WIDTH * HEIGHT, 3), 3e-9))
    error = view_error(known, test)
    assert error.interval == 0
    assert error.relative_rmse == pytest.approx(whole.relative_rmse, rel=1e-12)
    assert error.bound == pytest.approx(3e-9 / reference.mean(), rel=1e-12)
    np.testing.assert_array_equal(known.filled(known.airlight), reference)


def test_a_picture_of_a_frame_is_the_preview_within_a_level_and_what_is_not_finite_is_magenta(variant):
    random = np.random.default_rng(3)
    airlight, surface = (10 ** random.uniform(-5, 1, (12, 16, 3)).astype(np.float32) for _ in range(2))
    airlight[0, 0] = 0
    surface[3, 4, 1] = np.nan
    order = random.permutation(12 * 16).astype(np.uint32)
    layers = {
        name: mi.Color3f(image.reshape(-1, 3)[order].T)
        for name, image in zip(("airlight", "surface"), (airlight, surface))
    }
    dr.eval(layers)
    picture = Pictures().of_frame(mi.UInt32(order), **layers, layer="total", factor=1.7)
    picture = np.frombuffer(picture, np.uint8).reshape(12, 16, 4)
    radiance = sum(weight * layer for weight, layer in zip(LAYERS["total"], (airlight, surface), strict=True))
    expected = tone_mapped(radiance.astype(np.float64), 1.7)
    assert picture[3, 4, :3].tolist() == list(NOT_FINITE)
    finite = np.isfinite(radiance).all(axis=-1)
    assert np.abs(picture[..., :3].astype(int) - expected)[finite].max() <= 1
    assert (picture[..., 3] == 255).all()
