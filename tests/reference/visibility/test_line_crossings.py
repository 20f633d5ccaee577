# SPDX-License-Identifier: BSD-3-Clause
"""Claim: where lines enter and leave convex bounds is right, and keeps its digits from far away."""

import numpy as np
import pytest

from reference.scene.convex_bounds import holds
from reference.visibility.line_crossings import crossings
from tests.helpers.shapes import bounds_of, box, sphere


def rays(count=400, spread=1.7):
    rng = np.random.default_rng(5)
    direction = rng.normal(size=(count, 3))
    return rng.uniform(-spread, spread, (count, 3)), direction / np.linalg.norm(direction, axis=1, keepdims=True)


@pytest.mark.parametrize("make", [box, sphere])
def test_crossings_are_where_membership_changes(variant, make):
    """Rationale: the chord of a convex body, found by stepping along the line. Expected: to one step."""
    bounds = bounds_of(make((0.3, -0.2, 0.1)))
    origin, direction = rays()
    enter, leave = crossings(bounds, origin, direction)
    steps = np.linspace(-6, 6, 4001)
    points = origin[:, None] + steps[:, None] * direction[:, None]
    local = points - np.array([0.3, -0.2, 0.1])
    inside = np.abs(local).max(axis=2) < 1 if make is box else np.linalg.norm(local, axis=2) < 1
    length = inside.sum(axis=1) * 12 / 4000
    assert np.maximum(leave - enter, 0) == pytest.approx(length, abs=2 * 12 / 4000)
    crossed = leave - enter > 0.05
    assert crossed.sum() > 100
    middle = origin[crossed] + 0.5 * (enter[crossed] + leave[crossed])[:, None] * direction[crossed]
    assert all(holds(bounds, point) for point in middle)
