# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from validation.engine.hints import find_hints


@pytest.fixture
def truth():
    """An image without symmetry, its channels apart."""
    row, column = np.mgrid[:12, :16]
    light = np.exp(-0.1 * (row - 3.2) ** 2 - 0.05 * (column - 10.7) ** 2) + 0.02 * column
    return light[..., None] * np.array([0.9, 0.4, 0.2])


def srgb(image):
    return np.where(image <= 0.0031308, 12.92 * image, 1.055 * image ** (1 / 2.4) - 0.055)


@pytest.mark.claim("engine-suspects")
def test_the_right_image_raises_no_suspicion(truth):
    noisy = truth * (1 + 0.005 * np.random.default_rng(3).standard_normal(truth.shape))
    for image in (truth, noisy):
        hints = find_hints(truth, image)
        assert hints.words == ()
        assert abs(hints.factor - 1) < 0.002
    assert find_hints(truth, truth).factor_rmse == 0


@pytest.mark.claim("engine-suspects")
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda image: image[::-1], ["upside down"]),
        (lambda image: image[:, ::-1], ["mirrored left to right"]),
        (lambda image: image[..., ::-1], ["channel order B, G, R"]),
        (srgb, ["sRGB curve"]),
        (lambda image: math.pi * image, ["3.142 times as bright as it should be (pi), +1.65 stops"]),
        (lambda image: image / (4 * math.pi), ["(1/(4 pi)), -3.65 stops"]),
        (lambda image: 683 * image, ["683, lumens a watt"]),
        (lambda image: 4 * math.pi * image[::-1], ["upside down", "(4 pi), +3.65 stops"]),
        (lambda image: -image, ["the image is negative"]),
    ],
)
def test_each_fault_is_named_and_nothing_else(truth, change, words):
    hints = find_hints(truth, change(truth)).words
    assert len(hints) == len(words)
    for hint, word in zip(hints, words):
        assert word in hint
    assert hints[-1].endswith(f"instead of {relative_rmse(truth, change(truth)):.3g}")


def relative_rmse(truth, image):
    return np.sqrt(np.mean((image - truth) ** 2)) / truth.mean()


@pytest.mark.claim("engine-suspects", tolerance="1e-12 relative")
def test_best_factor_is_the_median_of_the_ratios_of_lit_values(truth):
    noisy = truth * np.exp(0.1 * np.random.default_rng(4).standard_normal(truth.shape))
    noisy[2:4] = 0
    hints = find_hints(truth, noisy)
    lit = (noisy > 0) & (truth > 1e-3 * truth.mean())
    np.testing.assert_allclose(hints.factor, np.exp(np.median(np.log(truth[lit] / noisy[lit]))), rtol=1e-12)
    np.testing.assert_allclose(hints.factor_rmse, relative_rmse(truth, hints.factor * noisy), rtol=1e-12)


@pytest.mark.claim("engine-suspects")
@pytest.mark.parametrize("fault", [0, 50, np.inf])
def test_one_pixel_decides_nothing(truth, fault):
    """The least squares were 0.001 times the image where one pixel beside a lamp was a thousand times too bright."""
    image = truth.copy()
    image[5, 6] *= fault
    hints = find_hints(truth, image)
    np.testing.assert_allclose(hints.factor, 1, rtol=1e-12)
    assert hints.words == ()
    for factor in (math.pi, 1e-3):
        (words,) = find_hints(truth, factor * image).words
        assert f"the image is {factor:.4g} times as bright" in words
