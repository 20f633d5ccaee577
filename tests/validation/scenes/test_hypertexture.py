# SPDX-License-Identifier: BSD-3-Clause
"""The density of `cumulus-detail`: noise that is continuous, bounded and always the same, and a distance field."""

import numpy as np
import pytest

from validation.scenes.hypertexture import (
    NOISE_BOUND,
    gradient_noise,
    octaves,
)

RANDOM = np.random.default_rng(71)


@pytest.mark.claim("noise-of-hypertexture", tolerance="1e-9 of a cell, times a slope of at most 4")
def test_noise_has_no_step_between_cells_and_is_nought_at_their_corners():
    corners = np.array(np.meshgrid(*[np.arange(-3, 3)] * 3)).reshape(3, -1).T.astype(float)
    np.testing.assert_array_equal(gradient_noise(corners, 5), 0)
    faces = RANDOM.uniform(-7, 7, (3000, 3))
    faces[:, 1] = np.round(faces[:, 1])
    step = np.array([0.0, 1e-9, 0.0])
    np.testing.assert_allclose(gradient_noise(faces - step, 5), gradient_noise(faces + step, 5), atol=8e-9)


@pytest.mark.claim("noise-of-hypertexture", tolerance="none: a bound")
def test_noise_is_bounded_and_of_mean_nought():
    points = RANDOM.uniform(-40, 40, (200_000, 3))
    noise = gradient_noise(points, 11)
    assert 0.5 < np.abs(noise).max() < NOISE_BOUND
    assert abs(noise.mean()) < 5 * noise.std() / np.sqrt(len(noise))
    assert np.abs(octaves(points, 37.0, 4, 11)).max() < 1


@pytest.mark.claim("noise-of-hypertexture", tolerance="none: equal numbers; 1e-12 of a number that is pinned")
def test_noise_depends_on_place_and_seed_alone():
    points = RANDOM.uniform(-90, 90, (500, 3))
    noise = octaves(points, 13.0, 3, 7)
    np.testing.assert_array_equal(noise[::-7], octaves(points[::-7], 13.0, 3, 7))
    assert np.abs(noise - octaves(points, 13.0, 3, 8)).max() > 0.1
    # A number of the hash that no version of NumPy may change.
    assert gradient_noise(np.array([[0.31, -1.73, 2.57]]), 7)[0] == pytest.approx(0.18701449451543795, abs=1e-12)
