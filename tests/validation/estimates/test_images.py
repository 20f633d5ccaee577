# SPDX-License-Identifier: BSD-3-Clause
"""What a Monte Carlo reference tells while it runs."""

from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import validation.estimates.images
from reference.monte_carlo.batches import single_batch
from tests.helpers.scenes import tiny_scene
from validation.estimates.images import Budget, monte_carlo_reference
from validation.scenes.loading import LoadedScene


@pytest.fixture
def clock(monkeypatch):
    """A clock of our own; `clock.now` is what it shows [s]."""
    clock = SimpleNamespace(now=50.0)
    monkeypatch.setattr(validation.estimates.images, "time", SimpleNamespace(monotonic=lambda: clock.now))
    return clock


@pytest.fixture
def loaded(variant, monkeypatch, own_cache, clock):
    """A scene whose batches are random numbers of relative deviation 0.4, and take a second each."""

    import validation.estimates.monte_carlo

    def trace(truth, seed, samples, **options):
        clock.now += 1.0
        mean = np.random.default_rng(seed).normal(1.0, 0.4, (2, 12, 3))
        return single_batch(seed, samples, mean)

    monkeypatch.setattr(validation.estimates.monte_carlo, "volpath_batch", trace)
    lamp = {"type": "point", "position": [0.3, -9.0, 1.1]}  # behind the camera: no pixel is left out
    return LoadedScene("tiny", mi.load_dict(tiny_scene(size=(4, 3), lamp=lamp)), "", "")


def run(loaded, budget):
    told = []
    reference = monte_carlo_reference(loaded, "volpath", budget=budget, progress=lambda *args: told.append(args))
    return reference, told


def test_progress_shows_the_error_falling_to_its_target(loaded):
    # One batch has the pooled error 0.4/sqrt(12) = 0.115, K batches 0.115/sqrt(K): some 133 for 0.01.
    reference, told = run(loaded, Budget(error=0.01))
    batches = reference.image.attributes["airlight:batches"]
    assert reference.reached
    assert 100 < batches < 200
    assert batches % 8 == 0
    shares = [share for share, _ in told]
    assert shares[:8] == [0.0] * 8  # nothing is known of the error yet
    # The share follows the estimate of the error, whose square is known to some 20 % by then.
    assert shares[batches // 2] == pytest.approx(0.5, abs=0.15)
    assert 0.85 < shares[-1] < 1
    errors = [float(what.split()[5]) for _, what in told[8:]]
    assert errors[0] > 2 * errors[-1]
    assert told[-1][1].startswith(f"volpath, {batches} batches, pooled error 0.01")
    assert told[-1][1].endswith(" of 0.01")


@pytest.mark.claim("targets-of-a-run")
def test_no_run_stops_on_a_target_before_its_error_is_known(loaded):
    reference, _ = run(loaded, Budget(error=0.5))
    assert reference.image.attributes["airlight:batches"] == 32


@pytest.mark.claim("targets-of-a-run")
def test_time_budget_never_starts_a_batch_that_would_end_too_late(loaded):
    reference, told = run(loaded, Budget(seconds=10.5))
    assert reference.image.attributes["airlight:batches"] == 10
    assert [share for share, _ in told] == pytest.approx([n / 10.5 for n in range(1, 11)])
    assert reference.reached is None
    again, told = run(loaded, Budget(seconds=3.2))
    # What is kept costs no time.
    assert (again.cached, again.image.attributes["airlight:batches"]) == (10, 13)
    assert len(told) == 3
