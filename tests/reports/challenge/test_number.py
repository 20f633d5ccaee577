# SPDX-License-Identifier: BSD-3-Clause
"""The number of a challenge: its definition, its floor, and what its interval covers."""

import math

import numpy as np
import pytest

from airlight.reports.challenge import number
from airlight.reports.challenge.number import FLOOR, SceneError, combined, rounded_out, scene_error

DIGEST = "2a" * 32


def exactly(*errors):
    return [SceneError(error, error, error) for error in errors]


@pytest.mark.claim("challenge-number")
def test_the_number_is_the_geometric_mean_of_kinds_that_count_alike():
    errors = {"one": exactly(0.1, 0.4), "two": exactly(0.02)}
    assert combined(errors, DIGEST).number == pytest.approx(math.sqrt(0.2 * 0.02))


def test_one_scene_moves_the_number_by_a_factor_that_its_size_does_not_change():
    """Ten times an error of one of 24 scenes is 10^(1/24), beside large and small errors."""
    kinds = {kind: exactly(*np.geomspace(0.002, 0.9, 8)) for kind in "abc"}
    before = combined(kinds, DIGEST).number
    for at, error in enumerate([0.002, 0.9]):
        errors = list(kinds["a"])
        errors[at * 7] = SceneError(10 * error, 10 * error, 10 * error)
        assert combined(kinds | {"a": errors}, DIGEST).number / before == pytest.approx(
            10 ** (1 / 24)
        )


def test_errors_below_the_floor_count_as_the_floor():
    result = combined({"a": exactly(1e-9, 1e-5), "b": exactly(0.0, 9e-4)}, DIGEST)
    assert (result.number, result.low, result.high) == pytest.approx((FLOOR,) * 3)


def test_the_ends_of_an_error_hold_for_every_reference_within_its_stated_error():
    rng = np.random.default_rng(5)
    reference, test = rng.exponential(1, 300), rng.exponential(1, 300)
    stated = 0.03 * rng.exponential(1, 300)
    found = scene_error(reference, stated, test)
    for _ in range(50):
        true = reference + stated * rng.choice([-1, 1], 300)
        error = np.linalg.norm(test - true) / np.linalg.norm(true)
        assert found.low <= error <= found.high


def test_an_image_twice_too_bright_and_a_black_one_have_the_error_one():
    reference = np.random.default_rng(6).exponential(1, 100) ** 4
    for factor in (0, 2):
        found = scene_error(reference, np.zeros(100), factor * reference)
        assert found.error == pytest.approx(1, abs=1e-12)


@pytest.mark.claim("challenge-number", tolerance="0.90 to 0.97 of 400 challenges")
def test_the_interval_covers_the_number_of_all_scenes(monkeypatch):
    """Log-normal errors about another mean in each kind: of 400 challenges, 95 % by intent.

    Quantiles of so few scenes are a little short of Student's: 0.90 to 0.97 is what they can give.
    """
    monkeypatch.setattr(number, "RESAMPLES", 500)
    rng, centre = np.random.default_rng(7), np.log([0.02, 0.1, 0.3])
    covered = 0
    for trial in range(400):
        errors = {
            kind: exactly(*np.exp(mean + 0.9 * rng.standard_normal(8)))
            for kind, mean in enumerate(centre)
        }
        found = combined(errors, f"{trial:064x}")
        covered += found.low <= math.exp(centre.mean()) <= found.high
    assert 0.90 <= covered / 400 <= 0.97


def test_intervals_are_rounded_outwards():
    assert rounded_out((0.123449, 0.123451)) == (0.1234, 0.1235)
    assert rounded_out((0.123451, 0.987649)) == (0.1234, 0.9877)
    assert rounded_out((FLOOR * (1 + 1e-15), FLOOR * (1 - 1e-15))) == (FLOOR, FLOOR)
    assert rounded_out((0.0, 9.99999e-12)) == (0.0, 1e-11)
