# SPDX-License-Identifier: BSD-3-Clause
"""Rates of the statistical tests, by images with a known reference; see
`tests.helpers.calibration` for what they are.

A rate may leave the interval that holds it with probability 1 - 1e-4 by the binomial law; seeds are
fixed, so each test fails only if the routine changes.
"""

import dataclasses

import numpy as np
import pytest

from airlight.validation.statistics.comparison import NoisyImage, compare_statistics
from tests.helpers.calibration import (
    BATCHES,
    SIZE,
    Experiment,
    around_one,
    calibrate,
    fraction_interval,
    log_normal,
    monte_carlo,
    power_and_finds,
    problems,
    spread_to_detect,
)

pytestmark = pytest.mark.statistical

OUTSIDE = 1e-4  # probability that a rate leaves its interval


def repeated(draw, *, runs, batches=BATCHES, shape=SIZE, by_batch=True, margin=None, seed=1):
    """Compare many images, drawn with the mean 1 unless they are to be found wrong,
    with a noiseless reference.
    """
    rng = np.random.default_rng(seed)
    reference = NoisyImage(np.ones(shape))
    comparisons = []
    for _ in range(runs):
        estimate = monte_carlo(draw(rng, (batches, *shape)))
        if not by_batch:
            estimate = dataclasses.replace(estimate, batch_means=None)
        comparisons.append(compare_statistics(reference, estimate, margin=margin))
    return comparisons


def assert_rate(events, probability):
    events = list(events)
    low, high = fraction_interval(probability, len(events), OUTSIDE)
    assert low <= np.mean(events) <= high, f"rate {np.mean(events):.4f}, expected {probability:.4f}"


@pytest.fixture(scope="module")
def null():
    """Comparisons of images that agree."""
    return repeated(around_one, runs=600, margin=0.01)


@pytest.mark.claim("agreement-inside-the-margin")
def test_equivalence_is_wrong_in_one_of_forty_runs_at_its_margin():
    # At a bias of exactly the margin the upper end of the 95 % interval lies inside with
    # probability 2.5 %. Both intervals must lie inside where there are two, which is rarer still.
    def shifted(rng, shape):
        return 1.005 * rng.normal(1, 0.1, shape)

    runs = repeated(shifted, runs=600, by_batch=False, margin=0.005, seed=12)
    assert_rate((s.equivalent for s in runs), 0.025)


@pytest.mark.claim("agreement-inside-the-margin")
def test_few_samples_prove_nothing(null):
    # Half of the width of the interval is 0.6 % here, so that 1 % is proved by
    # most runs and 0.5 % by none.
    assert np.mean([s.equivalent for s in null]) > 0.5
    assert not any(s.equivalent for s in repeated(around_one, runs=50, margin=0.005))


@pytest.mark.parametrize("factor", [0.8, 1.25])
def test_wrong_standard_errors_are_found_in_both_directions(factor):
    rng = np.random.default_rng(13)
    estimate = monte_carlo(around_one(rng, (BATCHES, 64, 64)))
    wrong = dataclasses.replace(
        estimate, standard_error=factor * np.asarray(estimate.standard_error)
    )
    right = compare_statistics(NoisyImage(np.ones((64, 64))), estimate)
    s = compare_statistics(NoisyImage(np.ones((64, 64))), wrong)
    assert min(right.exceeding_p, right.uniformity_p) > 1e-3
    assert max(s.exceeding_p, s.uniformity_p) < 1e-3
    assert (s.exceeding < s.expected_exceeding) == (factor > 1)


def test_dependent_pixels_show_in_the_interval_from_batches():
    # A factor common to all pixels of a batch: the pixels' interval is far too
    # narrow, the batches' is right.
    def dependent(rng, shape):
        return around_one(rng, shape) * rng.normal(1, 0.1, (shape[0], 1, 1))

    runs = repeated(dependent, runs=300, seed=14)
    assert_rate(
        (s.relative_bias_ci_batches[0] <= 0 <= s.relative_bias_ci_batches[1] for s in runs), 0.95
    )
    assert np.mean([s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1] for s in runs]) < 0.5


BIASES = [0.0005, 0.001, 0.005, 0.02]


def relative_spread(deviation):
    """Return the relative standard deviation of a log-normal law, with which
    its values are positive.
    """
    return float(np.sqrt(np.expm1(deviation**2)))


@pytest.mark.claim("rates-of-the-statistics")
@pytest.mark.parametrize(("batches", "noisy_reference"), [(4, False), (16, False), (16, True)])
def test_many_null_comparisons(batches, noisy_reference):
    experiment = Experiment(
        runs=1000, batches=batches, noisy_reference=noisy_reference, seed=30 + batches
    )
    assert problems(calibrate(experiment), experiment) == {}


@pytest.mark.claim("detectable-bias")
@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize("wider", [0.6, 1.0, 1.5, 3.0])
def test_the_printed_power_is_the_share_that_finds_a_bias(bias, wider):
    """From hardly ever to nearly always, both images random."""
    both = Experiment(runs=600, noisy_reference=True, seed=round(1e4 * bias + 10 * wider))
    predicted, found = power_and_finds(bias, both, spread=wider * spread_to_detect(bias, both))
    low, high = fraction_interval(predicted, both.runs, 1e-4)
    assert low <= found <= high


def test_skewed_noise_breaks_the_count_of_pixels_first_and_the_interval_last():
    """Log-normal batches against an exact reference, as in the table of the module."""
    mild, skewed, heavy = (
        calibrate(
            Experiment(log_normal(s), runs=400, batches=16, seed=40), spread=relative_spread(s)
        )
        for s in (0.5, 1.0, 2.0)
    )
    assert 0.15 < mild["pixel_alarms"] < 0.45
    assert skewed["pixel_alarms"] > 0.9
    low, high = fraction_interval(0.95, 400, 1e-4)
    for calibration in (mild, skewed):
        assert low <= calibration["coverage"] <= high
        assert low <= calibration["coverage_batches"] <= high
    assert mild["block_alarms"] <= fraction_interval(0.01, 400, 1e-4)[1]
    assert heavy["coverage"] < 0.92
    # It is noticed where the interval is still right, and always where it is not.
    assert mild["exceeding_alarms"] > 0.4
    assert min(skewed["exceeding_alarms"], heavy["exceeding_alarms"]) > 0.99
