# SPDX-License-Identifier: BSD-3-Clause
"""Claim: scene SEED is point SEED of one sequence, and the first points cover every range evenly."""

import numpy as np
import pytest

from analytic.errors import InputError
from validation.scenes.random.design import COORDINATES, LARGEST_SEED, Draws, point

_POINTS = 512


@pytest.fixture(scope="module")
def points():
    return np.array([[point(seed)[name] for name in COORDINATES] for seed in range(_POINTS)])


@pytest.mark.claim("random-cover", tolerance="a sixteenth of the range holds 0.4 to 1.6 times its share of 512 points")
def test_the_first_points_cover_every_coordinate(points):
    counts = np.array([np.histogram(column, bins=16, range=(0, 1))[0] for column in points.T])
    assert counts.min() > 0.4 * _POINTS / 16
    assert counts.max() < 1.6 * _POINTS / 16


def test_a_seed_has_one_point_and_parts_have_streams_of_their_own():
    assert point(5) == point(5) != point(6)
    first, again, other = Draws(5).of("lights"), Draws(5).of("lights"), Draws(5).of("casters")
    numbers = [first.share() for _ in range(4)]
    assert numbers == [again.share() for _ in range(4)]
    assert numbers != [other.share() for _ in range(4)]
    assert numbers != [draws.share() for draws in [Draws(5, 1).of("lights")] for _ in range(4)]
    assert min(numbers) > 0
    assert max(numbers) < 1


@pytest.mark.parametrize("seed", [-1, LARGEST_SEED + 1])
def test_a_seed_that_no_scene_has_is_refused(seed):
    with pytest.raises(InputError, match="wanted a whole number from 0"):
        point(seed)
