# SPDX-License-Identifier: BSD-3-Clause
"""The fraction of multiple scattering."""

import mitsuba as mi
import numpy as np
import pytest

from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.scene.read import read_reference
from airlight.validation.estimates.multiple_scattering import left_out, multiple_scattering_fraction
from tests.helpers.scenes import tiny_scene


def scene(albedo=0.9, sigma_t=0.31, **changes):
    fog = {"albedo": {"type": "rgb", "value": [albedo] * 3}, "sigma_t": sigma_t}
    return mi.load_dict(tiny_scene(size=(8, 6), fog=tiny_scene()["fog"] | fog, **changes))


def layers(albedo, depth):
    return volpath_batch(read_reference(scene(albedo)), 3, 16, max_depth=depth).mean


@pytest.mark.claim("left-out-fraction")
def test_the_nth_scattering_grows_with_the_nth_power_of_the_albedo(variant):
    """With the same seed the same paths are traced, so this holds path by
    path, to float32 rounding.
    """
    full = [layers(0.8, depth)[0] for depth in (2, 3, 4)]
    half = [layers(0.4, depth)[0] for depth in (2, 3, 4)]
    orders = [(sums[0], sums[1] - sums[0], sums[2] - sums[1]) for sums in (full, half)]
    for order, (of_full, of_half) in enumerate(zip(*orders), start=1):
        assert of_full.sum() > 0
        # Differences of float32 numbers: sums over 16 samples, relative 1e-6 of the whole.
        np.testing.assert_allclose(of_full.sum(), 2**order * of_half.sum(), rtol=1e-4)


def test_share_grows_with_the_optical_depth(variant):
    thin, thick = (
        multiple_scattering_fraction(scene(sigma_t=s), max_depth=6, batches=6, samples=8)
        for s in (0.01, 0.6)
    )
    assert 0 < thin.medium.value < 0.1 < thick.medium.value < 1
    assert thick.everything.value > 0
    for fraction in (thin.medium, thick.medium, thick.everything):
        low, high = fraction.interval
        assert low < fraction.value < high
    assert (thin.batches, thin.samples, thin.max_depth) == (6, 8, 6)


@pytest.mark.claim("left-out-fraction")
def test_the_interval_holds_the_share_in_95_of_100_runs():
    """Batches whose parts are correlated, as those of the same seeds are; the true share is 0.2.

    4000 runs: the standard deviation of the count is 13.8, so 3800 +- 55 at four of them.
    """
    rng = np.random.default_rng(11)
    held = 0
    for _ in range(4000):
        part = rng.normal(0.8, 0.08, 16)
        whole = part + rng.normal(0.2, 0.02, 16)
        low, high = left_out(part, whole).interval
        held += low <= 0.2 <= high
    assert abs(held - 3800) < 55


def test_the_share_is_unknown_where_no_path_found_light():
    """It was 0 with an interval without width."""
    for nothing in (np.zeros(4), np.full(4, np.nan)):
        found = left_out(nothing, nothing)
        assert (found.value, found.interval) == (None, (None, None))
    # Nor is it known to be 0 where no path was scattered twice.
    assert left_out(np.arange(1.0, 5.0), np.arange(1.0, 5.0)).interval == (None, None)
