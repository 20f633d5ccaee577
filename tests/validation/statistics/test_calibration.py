# SPDX-License-Identifier: BSD-3-Clause
"""The statistical tests judged by images with a known truth; see `tests.helpers.calibration` for what they
should do.

Every share may leave the interval that holds it with probability 1 - 1e-4 by its binomial law. Seeds are fixed.
"""

import numpy as np
import pytest

from tests.helpers.calibration import (
    Experiment,
    calibrate,
    log_normal,
    power_and_finds,
    problems,
    share_interval,
    spread_to_detect,
)

pytestmark = pytest.mark.statistical

BIASES = [0.0005, 0.001, 0.005, 0.02]


def relative_spread(deviation):
    """Return the relative standard deviation of a log-normal law, with which its values are positive."""
    return float(np.sqrt(np.expm1(deviation**2)))


@pytest.mark.claim("rates-of-the-statistics")
@pytest.mark.parametrize(("batches", "noisy_reference"), [(4, False), (16, False), (16, True)])
def test_many_null_comparisons(batches, noisy_reference):
    experiment = Experiment(runs=1000, batches=batches, noisy_reference=noisy_reference, seed=30 + batches)
    assert problems(calibrate(experiment), experiment) == {}


@pytest.mark.claim("detectable-bias")
@pytest.mark.parametrize("bias", BIASES)
@pytest.mark.parametrize("wider", [0.6, 1.0, 1.5, 3.0])
def test_the_printed_power_is_the_share_that_finds_a_bias(bias, wider):
    """From hardly ever to nearly always, both images random."""
    both = Experiment(runs=600, noisy_reference=True, seed=round(1e4 * bias + 10 * wider))
    predicted, found = power_and_finds(bias, both, spread=wider * spread_to_detect(bias, both))
    low, high = share_interval(predicted, both.runs, 1e-4)
    assert low <= found <= high


def test_skewed_noise_breaks_the_count_of_pixels_first_and_the_interval_last():
    """Log-normal batches against an exact reference, as in the table of the module."""
    mild, skewed, heavy = (
        calibrate(Experiment(log_normal(s), runs=400, batches=16, seed=40), spread=relative_spread(s))
        for s in (0.5, 1.0, 2.0)
    )
    assert 0.15 < mild["pixel_alarms"] < 0.45
    assert skewed["pixel_alarms"] > 0.9
    low, high = share_interval(0.95, 400, 1e-4)
    for calibration in (mild, skewed):
        assert low <= calibration["coverage"] <= high
        assert low <= calibration["coverage_batches"] <= high
    assert mild["block_alarms"] <= share_interval(0.01, 400, 1e-4)[1]
    assert heavy["coverage"] < 0.92
    # It is noticed where the interval is still right, and always where it is not.
    assert mild["exceeding_alarms"] > 0.4
    assert min(skewed["exceeding_alarms"], heavy["exceeding_alarms"]) > 0.99
