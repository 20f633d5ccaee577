# SPDX-License-Identifier: BSD-3-Clause
"""The truth of a part of an image: coarse grids first, and an error that covers that of the whole image."""

import numpy as np
import pytest

from reports.view.truth_order import STEPS, KnownTruth, pixel_order, view_error
from validation.metrics.errors import error_metrics

WIDTH, HEIGHT = 50, 37


def test_every_pixel_comes_once_and_coarse_grids_first():
    order = pixel_order(WIDTH, HEIGHT)
    assert sorted(order) == list(range(WIDTH * HEIGHT))
    row, column = np.divmod(order, WIDTH)
    for step in STEPS:
        count = len(range(0, WIDTH, step)) * len(range(0, HEIGHT, step))
        assert ((row[:count] % step == 0) & (column[:count] % step == 0)).all()
    assert order[1] != order[0] + STEPS[0]  # at random within a grid


def test_the_picture_grows_sharper_and_ends_as_it_is():
    random = np.random.default_rng(0)
    image = random.random((HEIGHT, WIDTH, 3))
    truth, order = KnownTruth.of_size(WIDTH, HEIGHT), pixel_order(WIDTH, HEIGHT)
    assert not truth.filled(truth.airlight).any()
    errors = []
    ramp = np.linspace(0, 1, WIDTH)[None, :, None] + 0.01 * image
    for begin in range(0, len(order), 100):
        pixels = order[begin : begin + 100]
        truth.add(pixels, *(ramp.reshape(-1, 3)[pixels] for _ in range(3)))
        errors.append(np.abs(truth.filled(truth.airlight) - ramp).mean())
    assert errors[0] > errors[5] > errors[-1]
    np.testing.assert_array_equal(truth.filled(truth.airlight), ramp)


@pytest.mark.claim("view-error", tolerance="none for all pixels; 190 of 200 intervals of 95 % for a part, less 4 sigma")
def test_error_of_a_part_covers_that_of_the_whole():
    random = np.random.default_rng(7)
    reference = 1 + random.random((HEIGHT, WIDTH, 3))
    test = reference * (1 + 0.1 * random.standard_normal((HEIGHT, WIDTH, 3)))
    whole = error_metrics(reference, test)
    covered = 0
    for seed in range(200):
        pixels = np.random.default_rng(seed).permutation(WIDTH * HEIGHT)[:400]
        truth = KnownTruth.of_size(WIDTH, HEIGHT)
        truth.add(
            pixels, *(reference.reshape(-1, 3)[pixels], reference.reshape(-1, 3)[pixels], np.full((400, 3), 1e-9))
        )
        error = view_error(truth, test)
        assert (error.known, error.pixels) == (400, WIDTH * HEIGHT)
        covered += abs(error.relative_rmse - whole.relative_rmse) <= error.interval
    assert 177 <= covered <= 200
    everything = np.arange(WIDTH * HEIGHT)
    truth.add(everything, reference.reshape(-1, 3), reference.reshape(-1, 3), np.full((WIDTH * HEIGHT, 3), 3e-9))
    error = view_error(truth, test)
    assert error.interval == 0
    assert error.relative_rmse == pytest.approx(whole.relative_rmse, rel=1e-12)
    assert error.bound == pytest.approx(3e-9 / reference.mean(), rel=1e-12)


def test_nothing_known_has_no_error():
    assert view_error(KnownTruth.of_size(4, 3), np.ones((3, 4, 3))) is None
