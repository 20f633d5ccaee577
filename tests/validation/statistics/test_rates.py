# SPDX-License-Identifier: BSD-3-Clause
"""Rates of the statistical tests.

Images are drawn under a known truth and rates compared with the level or the power that is printed; a rate may leave
the interval that holds it with probability 1 - 1e-4 by the binomial law, so with fixed seeds each test fails only if
the routine changes.
"""

import dataclasses

import numpy as np
import pytest

from tests.helpers.calibration import share_interval
from tests.helpers.estimates import BATCHES, SIZE, monte_carlo, normal
from validation.statistics.comparison import Estimate, compare_statistics

pytestmark = pytest.mark.statistical

OUTSIDE = 1e-4  # probability that a rate leaves its interval


def log_normal(rng, shape):
    return np.exp(rng.normal(size=shape) - 0.5)


def pareto(rng, shape):
    return (rng.pareto(1.5, shape) + 1) / 3


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


def assert_rate(events, probability):
    events = list(events)
    low, high = share_interval(probability, len(events), OUTSIDE)
    assert low <= np.mean(events) <= high, f"rate {np.mean(events):.4f}, expected {probability:.4f}"


def assert_rate_at_most(events, probability):
    events = list(events)
    assert np.mean(events) <= share_interval(probability, len(events), OUTSIDE)[1]


@pytest.fixture(scope="module")
def null():
    """Comparisons of images that agree."""
    return repeated(normal, runs=600, margin=0.01)


@pytest.mark.claim("rates-of-the-statistics")
def test_false_alarms_match_their_levels(null):
    assert_rate((s.rejected > 0 for s in null), 0.01)
    assert_rate((s.rejected_blocks > 0 for s in null), 0.01)
    # 576 values a run are independent in this image of one channel.
    low, high = share_interval(0.01, sum(s.tested for s in null), OUTSIDE)
    assert low <= sum(s.exceeding for s in null) / sum(s.tested for s in null) <= high
    assert_rate((s.uniformity_p < 0.05 for s in null), 0.05)
    # A number is discrete, so its p-value is at most as often below a level as that says, and not much less often.
    assert_rate_at_most((s.exceeding_p < 0.05 for s in null), 0.05)
    assert np.mean([s.exceeding_p < 0.05 for s in null]) > 0.01


@pytest.mark.claim("rates-of-the-statistics")
def test_intervals_cover_the_truth(null):
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in null), 0.95)
    # z of 15 degrees of freedom has the variance 15/13; its mean over all runs has the error 1.07/sqrt(345600).
    assert np.mean([s.z_mean for s in null]) == pytest.approx(0, abs=4 * 1.07 / np.sqrt(600 * 576))
    assert np.mean([s.z_std for s in null]) == pytest.approx(np.sqrt(15 / 13), rel=0.005)


def test_channels_may_depend_on_one_another():
    def grey(rng, shape):
        return np.repeat(normal(rng, shape[:-1])[..., None], shape[-1], axis=-1)

    runs = repeated(grey, runs=300, shape=(*SIZE, 3), seed=7)
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in runs), 0.95)
    for name in ("exceeding_p", "uniformity_p"):
        assert_rate_at_most((getattr(s, name) < 0.05 for s in runs), 0.05)
    assert_rate_at_most((s.rejected > 0 for s in runs), 0.01)


@pytest.mark.claim("agreement-inside-the-margin")
def test_equivalence_is_wrong_in_one_of_forty_runs_at_its_margin():
    # At a bias of exactly the margin the upper end of the 95 % interval lies inside with probability 2.5 %.
    # Both intervals must lie inside where there are two, which is rarer still.
    def shifted(rng, shape):
        return 1.005 * rng.normal(1, 0.1, shape)

    runs = repeated(shifted, runs=600, by_batch=False, margin=0.005, seed=12)
    assert_rate((s.equivalent for s in runs), 0.025)


@pytest.mark.claim("agreement-inside-the-margin")
def test_few_samples_prove_nothing(null):
    # Half of the width of the interval is 0.6 % here, so that 1 % is proved by most runs and 0.5 % by none.
    assert np.mean([s.equivalent for s in null]) > 0.5
    assert not any(s.equivalent for s in repeated(normal, runs=50, margin=0.005))


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


def test_dependent_pixels_show_in_the_interval_from_batches():
    # A factor common to all pixels of a batch: the pixels' interval is far too narrow, the batches' is right.
    def dependent(rng, shape):
        return normal(rng, shape) * rng.normal(1, 0.1, (shape[0], 1, 1))

    runs = repeated(dependent, runs=300, seed=14)
    assert_rate((s.relative_bias_ci_batches[0] <= 0 <= s.relative_bias_ci_batches[1] for s in runs), 0.95)
    assert np.mean([s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs]) < 0.5


def test_skewed_errors_spoil_pixels_but_not_the_image():
    """Log-normal batch means: 6 % instead of 1 % of values exceed, and the interval keeps its 95 %."""
    runs = repeated(log_normal, runs=300, batches=32, seed=15)
    assert np.mean([s.exceeding / s.tested for s in runs]) == pytest.approx(0.06, abs=0.003)
    assert all(s.exceeding_p < 0.001 for s in runs)  # and it is noticed
    assert all(s.z_mean < -0.1 for s in runs)  # in the direction of missing large values
    for name in ("relative_bias_ci", "relative_bias_ci_batches"):
        assert_rate((getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in runs), 0.95)


def test_infinite_variance_is_noticed_by_the_share_of_one_pixel():
    """Pareto's law with exponent 3/2, as in pixels that hold the light: no interval is to be trusted."""
    runs = repeated(pareto, runs=200, batches=32, seed=16)
    covered = np.mean([s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs])
    assert 0.7 < covered < 0.9
    assert np.median([s.largest_share for s in runs]) > 0.1
    finite = repeated(normal, runs=5, batches=32, seed=16)
    assert max(s.largest_share for s in finite) < 0.01
