# SPDX-License-Identifier: BSD-3-Clause
from types import SimpleNamespace

import numpy as np
import pytest

from reference.monte_carlo.batches import single_batch
from validation.estimates.efficiency import efficiency, efficiency_lines, scene_efficiency, thin_fog


class _Truth:
    """The estimators of these tests ask nothing of the scene."""


EXPECTED = np.full((20, 30, 3), 2.0)


@pytest.fixture
def clock(monkeypatch):
    """A clock that only the estimators of these tests move [s]."""
    clock = SimpleNamespace(now=0.0)
    monkeypatch.setattr("validation.clock.time", SimpleNamespace(perf_counter=lambda: clock.now, process_time=float))
    return clock


def _noise(deviation, seconds=0.0, clock=None):
    """Return an estimator of known relative deviation and duration."""

    def batch(truth, seed, samples):
        if clock is not None:
            clock.now += seconds
        rng = np.random.default_rng((seed, int(deviation * 1e6)))
        mean = 2.0 * (1 + deviation * rng.normal(size=(2, 600, 3)))
        return single_batch(seed, samples, mean)

    return batch


def test_ratio_of_known_estimators(clock):
    """Rationale: half the time and a tenth of the deviation make 200 times the efficiency."""
    measured = efficiency(
        _Truth(), {"good": (_noise(0.01, 0.01, clock), 8), "bad": (_noise(0.1, 0.02, clock), 8)}, EXPECTED, batches=24
    )
    # 1800 values with 23 degrees of freedom each: the variances are good to sqrt(2/(1800 23)) = 0.7 %, four of these.
    assert measured.fast.variance == pytest.approx(1e-4, rel=0.028)
    assert measured.slow.variance == pytest.approx(1e-2, rel=0.028)
    assert measured.ratio == pytest.approx(200, rel=0.04)
    assert measured.fast.variance_error < 0.05
    assert "times faster (airlight, 600 pixels)" in efficiency_lines(measured)[-1]


@pytest.mark.statistical
def test_single_scatter_is_a_hundred_times_faster_in_thin_fog(variant):
    """Rationale: it was 20 000 times faster at 160 x 120; an eightieth of that leaves room for launches of kernels."""
    assert scene_efficiency(thin_fog((64, 48)), batches=4).ratio > 100
