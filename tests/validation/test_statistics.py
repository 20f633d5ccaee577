# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the statistical tests.

Deterministic ones compare with values computed by hand. Those marked statistical draw images under a known truth and
compare rates with the level or the power that is printed; a rate may leave the interval that holds it with probability
1 - 1e-4 by the binomial law, so with fixed seeds each fails only if the routine changes.
"""

import dataclasses
import json

import numpy as np
import pytest
from scipy import stats

from analytic.errors import InputError
from validation.statistics import Estimate, compare_statistics

BATCHES = 16
SIZE = (24, 24)


def normal(rng, shape):
    return rng.normal(1, 0.3, shape)


def log_normal(rng, shape):
    return np.exp(rng.normal(size=shape) - 0.5)


def pareto(rng, shape):
    return (rng.pareto(1.5, shape) + 1) / 3


def monte_carlo(batches):
    """Return the estimate that a renderer would give, from its batch means (batches, height, width, ...)."""
    count = len(batches)
    error = batches.std(axis=0, ddof=1) / np.sqrt(count)
    return Estimate(batches.mean(axis=0), error, count, batches.mean(axis=(1, 2)))


def repeated(draw, *, runs, batches=BATCHES, shape=SIZE, by_batch=True, margin=None, seed=1):
    """Compare many images, drawn with the mean 1 unless they are to be found wrong, with a noiseless reference."""
    rng = np.random.default_rng(seed)
    reference = Estimate(np.ones(shape))
    comparisons = []
    for _ in range(runs):
        estimate = monte_carlo(draw(rng, (batches, *shape)))
        if not by_batch:
            estimate = dataclasses.replace(estimate, batch_means=None)
        comparisons.append(compare_statistics(reference, estimate, margin=margin))
    return comparisons


def rate_interval(probability, runs):
    """Return where the rate of an event of that probability lies with probability 1 - 1e-4."""
    low, high = stats.binom.interval(1 - 1e-4, runs, probability)
    return low / runs, high / runs


def assert_rate(events, probability):
    events = list(events)
    low, high = rate_interval(probability, len(events))
    assert low <= np.mean(events) <= high, f"rate {np.mean(events):.4f}, expected {probability:.4f}"


def assert_rate_at_most(events, probability):
    events = list(events)
    assert np.mean(events) <= rate_interval(probability, len(events))[1]


# --- by hand ---------------------------------------------------------------------------------------------------------


def test_hand_computed_values():
    # d = 0.1, -0.1, 0.2, 0; s = 0.1 (3-4-5 triangles of 0.06 and 0.08): z = 1, -1, 2, 0.
    reference = Estimate(np.array([[1.0, 2.0], [3.0, 4.0]]), np.full((2, 2), 0.06))
    test = Estimate(np.array([[1.1, 1.9], [3.2, 4.0]]), np.full((2, 2), 0.08))
    s = compare_statistics(reference, test, margin=0.1)
    assert s.tested == 4
    assert s.z_mean == pytest.approx(0.5, rel=1e-12)
    assert s.z_std == pytest.approx(np.sqrt((0.25 + 2.25 + 2.25 + 0.25) / 3), rel=1e-12)
    assert s.relative_bias == pytest.approx(0.02, rel=1e-12)
    error = np.sqrt(4 * 0.08**2 + 1.02**2 * 4 * 0.06**2) / 10
    assert s.relative_bias_ci == pytest.approx((0.02 - 1.959964 * error, 0.02 + 1.959964 * error), rel=1e-6)
    assert s.detectable_bias == pytest.approx((1.959964 + 1.281552) * error, rel=1e-6)
    assert s.largest_share == pytest.approx(0.25, rel=1e-12)
    assert s.relative_bias_ci_batches is None
    assert s.equivalent is True
    assert s.blocks == 1
    assert s.rejected_blocks == 0  # z = 0.2 / 0.2


def test_students_law_and_welchs_degrees_of_freedom():
    # z = 3.2 with 3 degrees of freedom: p = 0.0493; normal: p = 0.0014. Equal variances of 4 batches each give 6.
    one = Estimate(np.ones((1, 1)))
    z = 3.2
    level = 0.01
    random = Estimate(np.full((1, 1), 1 + 0.1 * z), np.full((1, 1), 0.1), 4)
    exact = dataclasses.replace(random, batches=None)
    assert compare_statistics(one, random, plain_level=level).exceeding == 0
    assert compare_statistics(one, exact, plain_level=level).exceeding == 1
    both = Estimate(np.ones((1, 1)), np.full((1, 1), 0.1), 4)
    p = 2 * stats.t.sf(0.1 * z / np.hypot(0.1, 0.1), 6)
    for factor, exceeding in ((0.999, 0), (1.001, 1)):
        assert compare_statistics(both, random, plain_level=factor * p).exceeding == exceeding


def test_sidak_level_counts_all_values():
    # 300 values at the family level 1 %: a = 1 - 0.99^(1/300) = 3.35e-5, critical |z| = 4.148.
    critical = stats.norm.isf(-np.expm1(np.log(0.99) / 300) / 2)
    assert critical == pytest.approx(4.148, abs=1e-3)
    for factor, rejected in ((0.999, 0), (1.001, 1)):
        values = np.ones((10, 10, 3))
        values[4, 5, :2] += 0.1 * critical * factor  # two channels of one pixel
        s = compare_statistics(Estimate(np.ones((10, 10, 3))), Estimate(values, np.full((10, 10, 3), 0.1)))
        assert s.rejected == rejected
    assert s.expected_rejections == pytest.approx(-np.log(0.99), rel=1e-3)


def test_small_errors_of_a_whole_block_show_in_the_block():
    # 1.5 standard errors in each of 64 pixels: z = 12 in their block, nothing to see in any pixel.
    values = np.ones((24, 20))
    values[8:16, 16:20] += 0.15  # the block at the edge is half a block, z = 8.5
    values[:8, :8] += 0.15
    s = compare_statistics(Estimate(np.ones((24, 20))), Estimate(values, np.full((24, 20), 0.1)))
    assert (s.blocks, s.rejected_blocks, s.rejected) == (9, 2, 0)


def test_values_without_variance_are_compared_in_absolute_terms():
    reference = np.full((4, 4), 2.0)
    reference[0] = 0.0
    error = np.full((4, 4), 0.1)
    error[0] = 0.0
    test = reference.copy()
    test[0, 1] = 0.3
    s = compare_statistics(Estimate(reference, error), Estimate(test))
    assert (s.tested, s.zero_variance) == (12, 4)
    assert s.zero_variance_error == pytest.approx(0.2, rel=1e-12)
    assert s.relative_bias == pytest.approx(0.3 / 24, rel=1e-12)
    assert s.z_std == 0


def test_light_where_the_reference_has_none_shows_in_absolute_terms():
    reference = np.full((4, 4), 2.0)
    reference[0] = 0.0  # mean 1.5
    test = reference.copy()
    test[0, 1:3] = [0.03, -0.06]
    found = compare_statistics(Estimate(reference), Estimate(test, np.full((4, 4), 0.1)))
    assert (found.zero_reference, found.tested) == (4, 16)
    assert found.zero_reference_error == pytest.approx(0.04, rel=1e-12)
    black = compare_statistics(Estimate(np.zeros((4, 4))), Estimate(test, np.full((4, 4), 0.1)))
    assert black.zero_reference == 16
    assert np.isnan(black.zero_reference_error)


def test_the_variance_of_both_sides_counts_and_is_told_apart():
    # Variances of 0.09 and of 0.16 a pixel at equal means: the reference has 9/25 of the sum.
    found = compare_statistics(
        Estimate(np.ones((3, 4)), np.full((3, 4), 0.3)), Estimate(np.ones((3, 4)), np.full((3, 4), 0.4))
    )
    assert found.reference_variance_share == pytest.approx(9 / 25, rel=1e-12)
    assert found.relative_bias_se == pytest.approx(0.5 / np.sqrt(12), rel=1e-12)
    assert (found.relative_bias_p, found.relative_bias_freedom) == (1, np.inf)
    one = compare_statistics(Estimate(np.ones((3, 4))), Estimate(np.ones((3, 4)), np.full((3, 4), 0.4), 5))
    assert one.reference_variance_share == 0
    assert one.relative_bias_freedom == pytest.approx(12 * 4, rel=1e-12)


def test_the_p_value_of_the_bias_is_below_five_percent_where_the_interval_leaves_zero_out():
    for shift, inside in ((1.95, True), (1.97, False)):
        test = Estimate(np.full((4, 4), 1 + shift * 0.01), np.full((4, 4), 0.04))
        found = compare_statistics(Estimate(np.ones((4, 4))), test)
        assert (found.relative_bias_p > 0.05) is inside
        assert (found.relative_bias_ci[0] < 0) is inside


def test_no_floor_under_the_variance():
    # Errors of 1e-9 of the radiance count in full.
    test = np.ones((8, 8)) + 1e-8
    s = compare_statistics(Estimate(np.ones((8, 8)), np.full((8, 8), 1e-9)), Estimate(test))
    assert s.z_mean == pytest.approx(10, rel=1e-6)
    assert s.rejected == 64


def test_images_without_noise_have_a_bias_but_no_z():
    s = compare_statistics(Estimate(np.ones((4, 4)), np.zeros((4, 4))), Estimate(np.full((4, 4), 1.5)), margin=0.01)
    assert (s.tested, s.zero_variance, s.blocks, s.equivalent) == (0, 16, 0, False)
    assert s.relative_bias_ci == (0.5, 0.5)
    as_json = json.loads(json.dumps(s.to_json(), allow_nan=False))
    assert as_json["z_mean"] is None
    assert as_json["exceeding_p"] is None
    assert as_json["largest_share"] is None


def test_black_reference_has_no_relative_bias():
    s = compare_statistics(Estimate(np.zeros((4, 4)), np.ones((4, 4))), Estimate(np.zeros((4, 4))), margin=0.01)
    assert s.to_json()["relative_bias_ci"] == [None, None]
    assert s.equivalent is False
    assert s.z_mean == 0


def test_mask_and_nonfinite_pixels_leave_no_trace():
    rng = np.random.default_rng(2)
    estimate = monte_carlo(normal(rng, (BATCHES, 8, 8, 3)))
    wide = np.full((8, 16, 3), np.nan)
    wide[:, :8] = estimate.mean
    error = np.full((8, 16, 3), -1.0)
    error[:, :8] = estimate.standard_error
    mask = np.arange(16) < 8
    alone = compare_statistics(Estimate(np.ones((8, 8, 3))), dataclasses.replace(estimate, batch_means=None))
    masked = Estimate(wide, error, BATCHES)
    found = compare_statistics(Estimate(np.ones((8, 16, 3))), masked, mask=np.tile(mask, (8, 1)))
    assert found == dataclasses.replace(alone, masked=64)  # no trace but their number
    # Without the mask the same pixels fall away because they are not finite, and batch means with them.
    with_means = dataclasses.replace(masked, batch_means=estimate.batch_means)
    assert compare_statistics(Estimate(np.ones((8, 16, 3))), with_means) == alone


@pytest.mark.parametrize("factor", [2.0**-300, 1e-30, 1e-12, 7e5, 1e30, 2.0**300])
def test_numbers_have_no_unit(factor):
    rng = np.random.default_rng(4)
    profile = rng.gamma(0.5, 2.0, (16, 16, 3))
    one, two = (monte_carlo(profile * normal(rng, (BATCHES, 16, 16, 3))) for _ in range(2))

    def scaled(estimate):
        values = (factor * np.asarray(v) for v in (estimate.mean, estimate.standard_error, estimate.batch_means))
        mean, error, batch_means = values
        return Estimate(mean, error, BATCHES, batch_means)

    before = compare_statistics(one, two, margin=0.01).to_json()
    after = compare_statistics(scaled(one), scaled(two), margin=0.01).to_json()
    for name, value in before.items():
        # 1e-9: the rounding of a factor that is no power of two, magnified by differences of the two images.
        assert after[name] == pytest.approx(value, rel=1e-9), name


def test_dependent_channels_do_not_narrow_the_interval():
    rng = np.random.default_rng(5)
    grey = monte_carlo(normal(rng, (BATCHES, *SIZE)))
    colour = Estimate(*(np.repeat(np.asarray(v)[..., None], 3, axis=-1) for v in (grey.mean, grey.standard_error)), 16)
    one = compare_statistics(Estimate(np.ones(SIZE)), grey)
    three = compare_statistics(Estimate(np.ones((*SIZE, 3))), colour)
    assert three.relative_bias_ci == pytest.approx(one.relative_bias_ci, rel=1e-12)


GOOD = Estimate(np.ones((4, 4)), np.ones((4, 4)), 8)


@pytest.mark.parametrize(
    ("test", "options", "message"),
    [
        (Estimate(np.ones((4, 5))), {}, "two sizes: the reference is 4 x 4 pixels, the test 5 x 4"),
        (dataclasses.replace(GOOD, standard_error=np.ones((4, 4, 3))), {}, r"has shape \(4, 4, 3\); wanted that"),
        (dataclasses.replace(GOOD, standard_error=-np.ones((4, 4))), {}, "negative or not finite in 16 pixels"),
        (dataclasses.replace(GOOD, standard_error=np.full((4, 4), np.inf)), {}, "not finite in 16 pixels; mask"),
        (dataclasses.replace(GOOD, batches=1), {}, "batches of the test: got 1, wanted at least 2"),
        (dataclasses.replace(GOOD, batch_means=[1.0]), {}, "the 1 batch means of the test"),
        (dataclasses.replace(GOOD, batch_means=[0.9, 1.0]), {}, "have the mean 0.95, the pixels compared 1; give"),
        (GOOD, {"margin": 0.0}, "margin: got 0.0"),
        (GOOD, {"plain_level": 1.0}, "plain_level: got 1.0"),
        (GOOD, {"family_level": 0.0}, "family_level: got 0.0"),
    ],
)
def test_refuses_what_does_not_fit(test, options, message):
    with pytest.raises(InputError, match=message):
        compare_statistics(GOOD, test, **options)


def test_refuses_two_images_without_errors():
    with pytest.raises(InputError, match="neither image has a standard error"):
        compare_statistics(Estimate(np.ones((4, 4))), Estimate(np.ones((4, 4))))


# --- rates -----------------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def null():
    """Comparisons of images that agree."""
    return repeated(normal, runs=600, margin=0.01)


@pytest.mark.statistical
def test_false_alarms_match_their_levels(null):
    assert_rate((s.rejected > 0 for s in null), 0.01)
    assert_rate((s.rejected_blocks > 0 for s in null), 0.01)
    # 576 values a run are independent in this image of one channel.
    low, high = rate_interval(0.01, sum(s.tested for s in null))
    assert low <= sum(s.exceeding for s in null) / sum(s.tested for s in null) <= high
    assert_rate((s.uniformity_p < 0.05 for s in null), 0.05)
    # A number is discrete, so its p-value is at most as often below a level as that says, and not much less often.
    assert_rate_at_most((s.exceeding_p < 0.05 for s in null), 0.05)
    assert np.mean([s.exceeding_p < 0.05 for s in null]) > 0.01


@pytest.mark.statistical
def test_intervals_cover_the_truth(null):
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in null), 0.95)
    # z of 15 degrees of freedom has the variance 15/13; its mean over all runs has the error 1.07/sqrt(345600).
    assert np.mean([s.z_mean for s in null]) == pytest.approx(0, abs=4 * 1.07 / np.sqrt(600 * 576))
    assert np.mean([s.z_std for s in null]) == pytest.approx(np.sqrt(15 / 13), rel=0.005)


@pytest.mark.statistical
def test_channels_may_depend_on_one_another():
    def grey(rng, shape):
        return np.repeat(normal(rng, shape[:-1])[..., None], shape[-1], axis=-1)

    runs = repeated(grey, runs=300, shape=(*SIZE, 3), seed=7)
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in runs), 0.95)
    for name in ("exceeding_p", "uniformity_p"):
        assert_rate_at_most((getattr(s, name) < 0.05 for s in runs), 0.05)
    assert_rate_at_most((s.rejected > 0 for s in runs), 0.01)


@pytest.mark.statistical
def test_two_random_images_need_both_variances():
    rng = np.random.default_rng(8)
    runs = []
    for _ in range(300):
        one, two = (monte_carlo(rng.normal(1, sigma, (n, *SIZE))) for sigma, n in ((0.3, 16), (0.5, 24)))
        runs.append(compare_statistics(one, two))
    assert_rate((s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs), 0.95)
    assert_rate((s.relative_bias_ci_batches[0] <= 0 <= s.relative_bias_ci_batches[1] for s in runs), 0.95)
    assert_rate((s.rejected > 0 for s in runs), 0.01)


@pytest.mark.statistical
@pytest.mark.parametrize(
    ("bias", "expected"), [(0.0005, 0.06), (0.001, 0.10), (0.002, 0.26), (0.005, 0.90), (-0.005, 0.90), (0.02, 1.0)]
)
def test_injected_biases_are_found_with_the_printed_power(bias, expected):
    # A noise of 0.148 in 16 batches of 24 x 24 pixels: the detectable bias is 0.50 %, and 2 % is found always.
    runs = repeated(
        lambda rng, s: rng.normal(1 + bias, 0.148, s), runs=400, seed=abs(round(1e6 * bias)), by_batch=False
    )
    detectable = np.mean([s.detectable_bias for s in runs])
    assert detectable == pytest.approx(0.005, rel=0.01)
    shift = bias / (detectable / (stats.norm.ppf(0.975) + stats.norm.ppf(0.90)))  # in standard errors
    power = stats.norm.sf(stats.norm.ppf(0.975) - shift) + stats.norm.cdf(-stats.norm.ppf(0.975) - shift)
    assert power == pytest.approx(expected, abs=0.01)
    assert_rate((not s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs), power)


def test_detectable_bias_is_that_of_the_wider_interval():
    rng = np.random.default_rng(10)
    estimate = monte_carlo(normal(rng, (BATCHES, *SIZE)) * rng.normal(1, 0.1, (BATCHES, 1, 1)))
    s = compare_statistics(Estimate(np.ones(SIZE)), estimate)
    # Few batches: (q(0.975) + q(0.90)) / q(0.975) of Student's law with 15 degrees of freedom, 2.131 and 1.341.
    half = 0.5 * (s.relative_bias_ci_batches[1] - s.relative_bias_ci_batches[0])
    assert s.detectable_bias == pytest.approx(half * (2.1314 + 1.3406) / 2.1314, rel=1e-4)
    assert s.relative_bias_ci[1] - s.relative_bias_ci[0] < half


@pytest.mark.statistical
def test_equivalence_is_wrong_in_one_of_forty_runs_at_its_margin():
    # At a bias of exactly the margin the upper end of the 95 % interval lies inside with probability 2.5 %.
    # Both intervals must lie inside where there are two, which is rarer still.
    def shifted(rng, shape):
        return 1.005 * rng.normal(1, 0.1, shape)

    runs = repeated(shifted, runs=600, by_batch=False, margin=0.005, seed=12)
    assert_rate((s.equivalent for s in runs), 0.025)


@pytest.mark.statistical
def test_few_samples_prove_nothing(null):
    # Half of the width of the interval is 0.6 % here, so that 1 % is proved by most runs and 0.5 % by none.
    assert np.mean([s.equivalent for s in null]) > 0.5
    assert not any(s.equivalent for s in repeated(normal, runs=50, margin=0.005))


@pytest.mark.statistical
@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_wrong_standard_errors_are_found_in_both_directions(factor):
    rng = np.random.default_rng(13)
    estimate = monte_carlo(normal(rng, (BATCHES, 64, 64)))
    wrong = dataclasses.replace(estimate, standard_error=factor * np.asarray(estimate.standard_error))
    right = compare_statistics(Estimate(np.ones((64, 64))), estimate)
    s = compare_statistics(Estimate(np.ones((64, 64))), wrong)
    assert min(right.exceeding_p, right.uniformity_p) > 1e-3
    assert max(s.exceeding_p, s.uniformity_p) < 1e-3
    assert (s.exceeding < s.expected_exceeding) == (factor > 1)


@pytest.mark.statistical
def test_dependent_pixels_show_in_the_interval_from_batches():
    # A factor common to all pixels of a batch: the pixels' interval is far too narrow, the batches' is right.
    def dependent(rng, shape):
        return normal(rng, shape) * rng.normal(1, 0.1, (shape[0], 1, 1))

    runs = repeated(dependent, runs=300, seed=14)
    assert_rate((s.relative_bias_ci_batches[0] <= 0 <= s.relative_bias_ci_batches[1] for s in runs), 0.95)
    assert np.mean([s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs]) < 0.5


@pytest.mark.statistical
def test_skewed_errors_spoil_pixels_but_not_the_image():
    """Log-normal batch means: 6 % instead of 1 % of values exceed, and the interval keeps its 95 %."""
    runs = repeated(log_normal, runs=300, batches=32, seed=15)
    assert np.mean([s.exceeding / s.tested for s in runs]) == pytest.approx(0.06, abs=0.003)
    assert all(s.exceeding_p < 0.001 for s in runs)  # and it is noticed
    assert all(s.z_mean < -0.1 for s in runs)  # in the direction of missing large values
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in runs), 0.95)


@pytest.mark.statistical
def test_infinite_variance_is_noticed_by_the_share_of_one_pixel():
    """Pareto's law with exponent 3/2, as in pixels that hold the light: no interval is to be trusted."""
    runs = repeated(pareto, runs=200, batches=32, seed=16)
    covered = np.mean([s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs])
    assert 0.7 < covered < 0.9
    assert np.median([s.largest_share for s in runs]) > 0.1
    finite = repeated(normal, runs=5, batches=32, seed=16)
    assert max(s.largest_share for s in finite) < 0.01
