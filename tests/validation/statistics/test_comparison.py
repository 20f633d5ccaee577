# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the statistical tests by values computed by hand; their rates are in
`test_statistics_rates`.
"""

import dataclasses

import numpy as np
import pytest
from scipy import stats

from airlight.errors import InputError
from airlight.validation.statistics.comparison import NoisyImage, compare_statistics
from tests.helpers.calibration import BATCHES, SIZE, around_one, monte_carlo


def test_hand_computed_values():
    # d = 0.1, -0.1, 0.2, 0; s = 0.1 (3-4-5 triangles of 0.06 and 0.08): z = 1, -1, 2, 0.
    reference = NoisyImage(np.array([[1.0, 2.0], [3.0, 4.0]]), np.full((2, 2), 0.06))
    test = NoisyImage(np.array([[1.1, 1.9], [3.2, 4.0]]), np.full((2, 2), 0.08))
    s = compare_statistics(reference, test, margin=0.1)
    assert s.tested == 4
    assert s.z_mean == pytest.approx(0.5, rel=1e-12)
    assert s.z_std == pytest.approx(np.sqrt((0.25 + 2.25 + 2.25 + 0.25) / 3), rel=1e-12)
    assert s.relative_bias == pytest.approx(0.02, rel=1e-12)
    error = np.sqrt(4 * 0.08**2 + 1.02**2 * 4 * 0.06**2) / 10
    assert s.relative_bias_ci == pytest.approx(
        (0.02 - 1.959964 * error, 0.02 + 1.959964 * error), rel=1e-6
    )
    assert s.detectable_bias == pytest.approx((1.959964 + 1.281552) * error, rel=1e-6)
    assert s.largest_fraction == pytest.approx(0.25, rel=1e-12)
    assert s.relative_bias_ci_batches is None
    assert s.equivalent is True
    assert s.blocks == 1
    assert s.rejected_blocks == 0  # z = 0.2 / 0.2


def test_students_law_and_welchs_degrees_of_freedom(monkeypatch):
    # z = 3.2 with 3 degrees of freedom: p = 0.0493; normal: p = 0.0014. Equal variances
    # of 4 batches each give 6.
    unit = NoisyImage(np.ones((1, 1)))
    z = 3.2
    random = NoisyImage(np.full((1, 1), 1 + 0.1 * z), np.full((1, 1), 0.1), 4)
    exact = dataclasses.replace(random, batches=None)
    assert compare_statistics(unit, random).exceeding == 0
    assert compare_statistics(unit, exact).exceeding == 1
    both = NoisyImage(np.ones((1, 1)), np.full((1, 1), 0.1), 4)
    p = 2 * stats.t.sf(0.1 * z / np.hypot(0.1, 0.1), 6)
    for factor, exceeding in ((0.999, 0), (1.001, 1)):
        monkeypatch.setattr("airlight.validation.statistics.comparison.LEVEL", factor * p)
        assert compare_statistics(both, random).exceeding == exceeding


def test_sidak_level_counts_all_values():
    # 300 values at the family level 1 %: a = 1 - 0.99^(1/300) = 3.35e-5, critical |z| = 4.148.
    critical = stats.norm.isf(-np.expm1(np.log(0.99) / 300) / 2)
    assert critical == pytest.approx(4.148, abs=1e-3)
    for factor, rejected in ((0.999, 0), (1.001, 1)):
        values = np.ones((10, 10, 3))
        values[4, 5, :2] += 0.1 * critical * factor  # two channels of one pixel
        s = compare_statistics(
            NoisyImage(np.ones((10, 10, 3))), NoisyImage(values, np.full((10, 10, 3), 0.1))
        )
        assert s.rejected == rejected
    assert s.expected_rejections == pytest.approx(-np.log(0.99), rel=1e-3)


def test_small_errors_of_a_whole_block_show_in_the_block():
    # 1.5 standard errors in each of 64 pixels: z = 12 in their block, nothing to see in any pixel.
    values = np.ones((24, 20))
    values[8:16, 16:20] += 0.15  # the block at the edge is half a block, z = 8.5
    values[:8, :8] += 0.15
    s = compare_statistics(
        NoisyImage(np.ones((24, 20))), NoisyImage(values, np.full((24, 20), 0.1))
    )
    assert (s.blocks, s.rejected_blocks, s.rejected) == (9, 2, 0)


def test_the_variance_of_both_sides_counts_and_is_told_apart():
    # Variances of 0.09 and of 0.16 a pixel at equal means: the reference has 9/25 of the sum.
    statistics = compare_statistics(
        NoisyImage(np.ones((3, 4)), np.full((3, 4), 0.3)),
        NoisyImage(np.ones((3, 4)), np.full((3, 4), 0.4)),
    )
    assert statistics.reference_variance_fraction == pytest.approx(9 / 25, rel=1e-12)
    assert statistics.relative_bias_se == pytest.approx(0.5 / np.sqrt(12), rel=1e-12)
    assert (statistics.relative_bias_p, statistics.relative_bias_freedom) == (1, None)
    exact_reference = compare_statistics(
        NoisyImage(np.ones((3, 4))), NoisyImage(np.ones((3, 4)), np.full((3, 4), 0.4), 5)
    )
    assert exact_reference.reference_variance_fraction == 0
    assert exact_reference.relative_bias_freedom == pytest.approx(12 * 4, rel=1e-12)


def test_errors_that_pixels_share_do_not_average_out():
    """One error of 2 %, in all of 24 x 20 pixels: in 95 of 100 images it is in the interval."""
    rng, found = np.random.default_rng(4), {0.0: 0, 1.0: 0}
    for _ in range(100):
        batches = 1 + 0.02 * np.sqrt(8) * rng.standard_normal((8, 1, 1)) * np.ones((24, 20))
        error = batches.std(axis=0, ddof=1) / np.sqrt(8)
        for shared in found:
            noisy = NoisyImage(batches.mean(axis=0), error, 8, shared=shared)
            s = compare_statistics(noisy, NoisyImage(np.ones((24, 20))))
            found[shared] += s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1]
    assert found[0.0] < 15  # an interval of 480 pixels is a 22nd of that of one
    assert 89 <= found[1.0] <= 99


def test_mask_and_nonfinite_pixels_leave_no_trace():
    rng = np.random.default_rng(2)
    estimate = monte_carlo(around_one(rng, (BATCHES, 8, 8, 3)))
    wide = np.full((8, 16, 3), np.nan)
    wide[:, :8] = estimate.mean
    error = np.full((8, 16, 3), -1.0)
    error[:, :8] = estimate.standard_error
    mask = np.arange(16) < 8
    alone = compare_statistics(
        NoisyImage(np.ones((8, 8, 3))), dataclasses.replace(estimate, batch_means=None)
    )
    masked = NoisyImage(wide, error, BATCHES)
    statistics = compare_statistics(
        NoisyImage(np.ones((8, 16, 3))), masked, mask=np.tile(mask, (8, 1))
    )
    assert statistics == dataclasses.replace(alone, masked=64)  # no trace but their number
    # Without the mask the same pixels fall away because they are not finite,
    # and batch means with them.
    with_means = dataclasses.replace(masked, batch_means=estimate.batch_means)
    assert compare_statistics(NoisyImage(np.ones((8, 16, 3))), with_means) == alone


def test_dependent_channels_do_not_narrow_the_interval():
    rng = np.random.default_rng(5)
    grey = monte_carlo(around_one(rng, (BATCHES, *SIZE)))
    colour = NoisyImage(
        *(
            np.repeat(np.asarray(v)[..., None], 3, axis=-1)
            for v in (grey.mean, grey.standard_error)
        ),
        16,
    )
    of_grey = compare_statistics(NoisyImage(np.ones(SIZE)), grey)
    of_colour = compare_statistics(NoisyImage(np.ones((*SIZE, 3))), colour)
    assert of_colour.relative_bias_ci == pytest.approx(of_grey.relative_bias_ci, rel=1e-12)


@pytest.mark.claim("detectable-bias")
def test_detectable_bias_is_that_of_the_wider_interval():
    rng = np.random.default_rng(10)
    estimate = monte_carlo(around_one(rng, (BATCHES, *SIZE)) * rng.normal(1, 0.1, (BATCHES, 1, 1)))
    s = compare_statistics(NoisyImage(np.ones(SIZE)), estimate)
    # Few batches: (q(0.975) + q(0.90)) / q(0.975) of Student's law with 15 degrees of
    # freedom, 2.131 and 1.341.
    half = 0.5 * (s.relative_bias_ci_batches[1] - s.relative_bias_ci_batches[0])
    assert s.detectable_bias == pytest.approx(half * (2.1314 + 1.3406) / 2.1314, rel=1e-4)
    assert s.relative_bias_ci[1] - s.relative_bias_ci[0] < half


GOOD = NoisyImage(np.ones((4, 4)), np.ones((4, 4)), 8)


@pytest.mark.parametrize(
    ("test", "options", "message"),
    [
        (
            NoisyImage(np.ones((4, 5))),
            {},
            "two sizes: the reference is 4 x 4 pixels, the test 5 x 4",
        ),
        (
            dataclasses.replace(GOOD, standard_error=np.ones((4, 4, 3))),
            {},
            r"has shape \(4, 4, 3\); expected that",
        ),
        (
            dataclasses.replace(GOOD, standard_error=-np.ones((4, 4))),
            {},
            "negative or not finite in 16 pixels",
        ),
        (
            dataclasses.replace(GOOD, batches=1),
            {},
            "batches of the test: got 1, expected at least 2",
        ),
        (
            dataclasses.replace(GOOD, batch_means=[0.9, 1.0]),
            {},
            "have the mean 0.95, the pixels compared 1; give",
        ),
        (GOOD, {"margin": 0.0}, "margin: got 0.0"),
    ],
)
def test_refuses_what_does_not_fit(test, options, message):
    with pytest.raises(InputError, match=message):
        compare_statistics(GOOD, test, **options)
