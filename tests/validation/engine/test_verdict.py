# SPDX-License-Identifier: BSD-3-Clause
"""Protects the claim that a right image of a path tracer is called right, without options, and a wrong one is not."""

from dataclasses import replace

import numpy as np
import pytest

from reference.storage.exr import Image, write_exr
from validation.engine.error_place import error_place
from validation.engine.hints import find_hints
from validation.engine.judge import compare_scene, judge
from validation.estimates.quadrature import reference_layer, truth_image
from validation.scenes.loading import load_scene

SIZE = (80, 60)


@pytest.fixture(scope="module", params=["open-fog", pytest.param("sphere-spot", marks=pytest.mark.slow)])
def traced(request, variant, tmp_path_factory):
    """What a path tracer with a box filter makes of a scene: means over pixels, with its noise.

    Every value has Gaussian noise of 2 %, those beside the lamp of 30 %, as LuxCore's had at 512 paths a pixel, and the
    pixel of the lamp is twice as bright as it should be: its variance is infinite.
    """
    truth = truth_image(load_scene(request.param, SIZE).scene, pixel="area")
    total = reference_layer(truth, "total")
    beside = truth.light_angle < 3 * np.deg2rad(58 / SIZE[0])
    noise = np.where(beside, 0.3, 0.02)[:, :, None] * np.random.default_rng(7).standard_normal((*total.shape[:2], 1))
    noise[np.unravel_index(truth.light_angle.argmin(), truth.light_angle.shape)] += 1.0 if beside.any() else 0.0
    return request.param, truth, np.maximum(1 + noise, 0) * total, tmp_path_factory.mktemp("traced")


def compared(traced, image):
    scene, _, _, folder = traced
    path = folder / "image.exr"
    write_exr(path, Image({"total": image}), finite=False)
    return compare_scene(scene, path)


@pytest.mark.claim("engine-verdict", "engine-pixels")
def test_the_right_image_of_a_path_tracer_is_called_right_without_options(traced):
    _, _, image, _ = traced
    judged = compared(traced, image)
    assert judged.pixel == "area"
    assert judged.verdict.right
    assert judged.failures == judged.hints.words == ()
    np.testing.assert_allclose(judged.hints.factor, 1, atol=0.002)
    assert judged.summary().splitlines()[-1].startswith("verdict          right: means over 6 x 6 pixels are within")


@pytest.mark.claim("engine-verdict", "engine-pixels")
def test_the_right_image_of_pixel_centres_is_called_right_too(traced):
    scene, *_ = traced
    centre = reference_layer(truth_image(load_scene(scene, SIZE).scene), "total")
    noise = 1 + 0.02 * np.random.default_rng(8).standard_normal((*centre.shape[:2], 1))
    judged = compared(traced, noise * centre)
    assert (judged.pixel, judged.verdict.right) == ("centre", True)


def moved(image):
    """An image that is one pixel too low, as LuxCore's are."""
    return np.concatenate([image[:1], image[:-1]])


FAULTS = {
    "pi": (lambda image, truth: np.pi * image, "(pi), +1.65 stops"),
    "a factor of 3 %": (lambda image, truth: 1.03 * image, "the best factor is 0.97"),
    "upside down": (lambda image, truth: image[::-1], "upside down"),
    "a gamma": (lambda image, truth: image ** (1 / 2.2), ""),
    "a pixel too low": (lambda image, truth: moved(image), "off"),
    "a haze of 5 %": (lambda image, truth: image + 0.05 * image.mean(), "off"),
    "fog that ends": (lambda image, truth: image - 0.1 * truth.airlight * (np.arange(SIZE[0]) < 30)[:, None], "off"),
    "black": (lambda image, truth: 0 * image, "the image is black everywhere"),
}


@pytest.mark.claim("engine-verdict")
@pytest.mark.parametrize("fault", FAULTS)
def test_planted_faults_are_not_called_right(traced, fault):
    _, truth, image, _ = traced
    change, words = FAULTS[fault]
    judged = compared(traced, change(image, truth))
    assert not judged.verdict.right
    assert words in judged.verdict.words
    assert judged.summary().splitlines()[-1].startswith("verdict          not right: ")


@pytest.mark.claim("engine-verdict", tolerance="1e-12 relative")
def test_the_place_of_the_error_is_that_of_the_worst_pixels():
    truth = np.ones((20, 30, 3))
    image = truth.copy()
    image[7, 11] += 3
    image[0, 0] += 0.03
    lamp = np.full((20, 30), 50.0)
    lamp[6:9, 10:13] = 1
    place = error_place(truth, image, lamp)
    assert (place.pixels, place.worst, place.kind, place.few) == (1, (11, 7), "lamp", True)
    np.testing.assert_allclose(place.share, 9 / (9 + 0.0009), rtol=1e-12)
    np.testing.assert_allclose(place.relative_rmse_without, np.sqrt(0.0009 / 599), rtol=1e-12)
    assert "100 % of the squared error in 1 pixel (beside a light, in column 11, row 7)" in place.words
    assert error_place(truth, truth, lamp) is None
    assert not error_place(truth, 1.1 * truth, lamp).few


@pytest.mark.claim("engine-verdict", tolerance="three standard deviations of the noise of a mean over 64 pixels")
def test_noise_of_pixels_is_told_from_an_error_of_blocks():
    truth = np.ones((160, 160, 3))
    image = truth * (1 + 0.04 * np.random.default_rng(2).standard_normal(truth.shape))
    verdict = judge(truth, image, find_hints(truth, image), ())
    assert verdict.right
    np.testing.assert_allclose([verdict.block_error, verdict.block_noise], 0.04 / 8, rtol=0.05)
    noisy = judge(truth, truth + 4 * (image - truth), find_hints(truth, image), ())
    assert "most of it noise: render more samples" in noisy.words
    image[40:80, 40:80] *= 0.9
    verdict = judge(truth, image, find_hints(truth, image), ())
    assert "means over 8 x 8 pixels are" in verdict.words
    assert "noise" not in verdict.words
    assert not judge(truth, truth, find_hints(truth, truth), ("2 pixels are negative",)).right
    assert replace(verdict, reasons=()).right
    dark = judge(0 * truth, 0 * truth, find_hints(truth, truth), ())
    assert dark.words == "not right: nothing is lit in the pixels that are compared"


@pytest.mark.claim("engine-verdict", tolerance="none: one of 75 lit values is wrong by a tenth, 1.2 % RMS")
def test_one_wrong_block_of_few_is_not_forgiven():
    """A hundredth of the values may be wrong, which of 25 blocks is none; it used to be one at least."""
    truth = np.zeros((160, 160, 3))
    truth[:40, :40] = 1.0
    image = truth.copy()
    image[8:16, 8:16, 1] *= 1.1
    assert judge(truth, truth, find_hints(truth, truth), ()).right
    assert not judge(truth, image, find_hints(truth, image), ()).right
    # Of 400 lit blocks four may be as wrong as they like: that of a lamp, whose variance is infinite, among them.
    lit = np.ones(truth.shape)
    image = lit.copy()
    image[8:16, 8:16] *= 3
    assert judge(lit, image, find_hints(lit, image), ()).right
