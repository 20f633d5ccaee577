# SPDX-License-Identifier: BSD-3-Clause
"""When a Monte Carlo run ends."""

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from reference.monte_carlo.batches import Batches
from reference.quadrature.surface import surface_hits
from reference.scene.read import read_truth
from tests.helpers.scenes import tiny_scene
from validation.estimates.agreement import MASK_PIXELS, pixel_angle
from validation.estimates.images import Budget, batch_plan, near_light, relative_errors
from validation.estimates.quadrature import truth_image


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({}, "got none of --samples, --error, --seconds; give one"),
        ({"samples": 64, "error": 0.01}, "got --samples 64 and --error 0.01 of"),
        ({"error": 0.01, "seconds": 3.0}, "got --error 0.01 and --seconds 3 of"),
        ({"error": 0.0}, "--error: got 0, wanted a positive number"),
        ({"seconds": -1.0}, "--seconds: got -1"),
        ({"error": 1.5}, "--error: got 1.5, wanted less than 1; 0.01 is 1 %"),
    ],
)
def test_exactly_one_limit_is_wanted(given, words):
    with pytest.raises(InputError, match=words):
        Budget(**given)


@pytest.mark.parametrize("samples", [1, 2, 31, 64, 100, 1024, 2048, 4096, 8193, 100_000])
def test_samples_are_split_into_batches_that_have_at_least_as_many(samples):
    batches, each = batch_plan(Budget(samples=samples), 100)
    assert batches >= min(32, max(2, samples))  # 32 give a standard error that is known to 13 %
    assert each in (1, 2, 4, 8, 16, 32, 64)
    # Never less than asked for, and not a whole batch more, but for the two that a standard error needs.
    assert samples <= batches * each < samples + max(each, 2)


def batches(mean, error, count=4):
    mean, error = np.asarray(mean, float), np.asarray(error, float)
    return Batches(tuple(range(count)), 1, mean, error**2 * count * (count - 1), np.zeros((count, 2, 3)))


def test_errors_by_hand():
    """Two pixels; each channel of each layer has its own error, and the largest counts."""
    airlight = [[1.0, 2.0, 1.0], [3.0, 2.0, 1.0]]
    airlight_error = [[0.3, 0.0, 0.0], [0.4, 0.0, 0.0]]  # red: sqrt(0.09 + 0.16)/4; the worst is 0.3 of 1
    surface = [[5.0, 5.0, 5.0], [0.0, 5.0, 5.0]]
    surface_error = [[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]]  # 0.5 of 5 and of 10
    traced = batches([airlight, surface], [airlight_error, surface_error])
    errors = relative_errors(traced, np.zeros(2, dtype=bool))
    assert errors["pooled"] == pytest.approx(0.125, rel=1e-12)
    assert errors["worst"] == pytest.approx(0.3, rel=1e-12)
    # Without the first pixel of the airlight: 0.4/3 pooled and worst.
    errors = relative_errors(traced, np.array([True, False]))
    assert (errors["pooled"], errors["worst"]) == pytest.approx((0.4 / 3, 0.4 / 3), rel=1e-12)


@pytest.mark.claim("pixels-beside-a-light")
def test_pixels_beside_a_light_are_those_that_the_truth_names(variant):
    """The same pixels as from the quadrature's own angles; a light in view, one behind us, one in the sphere."""
    behind = {"type": "point", "position": [0.3, -6.0, 1.1]}
    hidden = {"type": "point", "position": [0.1, 0.3, 0.65]}
    scene = mi.load_dict(tiny_scene(size=(40, 30), behind=behind, hidden=hidden))
    truth = read_truth(scene)
    expected = truth_image(scene, checks=2).light_angle <= MASK_PIXELS * pixel_angle(truth)
    assert 0 < expected.sum() < 40
    np.testing.assert_array_equal(near_light(truth, surface_hits(truth).distance), expected.ravel())


@pytest.mark.parametrize("odd", [np.nan, np.inf])
@pytest.mark.parametrize("layer", [0, 1])
def test_no_target_is_met_by_what_is_no_number(odd, layer):
    """A mean of NaN with a standard error of 0 ended a run at once."""
    mean = np.ones((2, 4, 3))
    mean[layer, 2] = odd
    batches = Batches(tuple(range(32)), 1, mean, np.zeros_like(mean), np.ones((32, 2, 3)))
    errors = relative_errors(batches, np.zeros(4, dtype=bool))
    assert (errors["pooled"], errors["worst"]) == (np.inf, np.inf)
