# SPDX-License-Identifier: BSD-3-Clause
"""Geometry: no digits lost close to the light, conversions that undo each other, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analytic.geometry import foot_and_height
from analytic.panels import log_distance

EPSILON = np.finfo(float).eps


def float32_rays(count, miss):
    """Rays with float32 coordinates that pass a light at about the distance `miss`."""
    rng = np.random.default_rng(20061)
    origin = rng.uniform(-20, 20, (count, 3)).astype(np.float32)
    direction = rng.normal(size=(count, 3))
    direction = (direction / np.linalg.norm(direction, axis=1)[:, None]).astype(np.float32)
    light = origin + rng.uniform(1, 30, (count, 1)) * direction + miss * rng.normal(size=(count, 3))
    return origin.astype(float), direction.astype(float), light.astype(np.float32).astype(float)


@pytest.mark.parametrize("miss", [3.0, 1e-3, 0.0])
def test_foot_and_height_against_mpmath(miss):
    from mpmath import matrix, mp, mpf, workdps

    origin, direction, light = float32_rays(50, miss)
    foot, height = foot_and_height(origin, direction, light)
    for row in range(50):
        with workdps(60):
            o, d, p = (matrix([mpf(float(v)) for v in column[row]]) for column in (origin, direction, light))
            length = mp.norm(d)
            v = p - o
            along = (v.T * d)[0] / length
            across = mp.norm(v - d * (along / length))
            # The height is right to a few ulp however close the ray passes (light - origin is exact for most float32
            # numbers, else it costs one rounding of the larger coordinate).
            slack = 8 * EPSILON * across + EPSILON * mp.norm(v)
            assert abs(mpf(float(height[row])) - across) <= slack
            assert abs(mpf(float(foot[row])) - along) <= 4 * EPSILON * mp.norm(v)


finite = st.floats(min_value=-1e3, max_value=1e3)
heights = st.floats(min_value=1e-6, max_value=1e3)


@pytest.mark.claim("path-keeps-digits")
@given(x=finite, foot=finite, height=heights)
def test_the_path_satisfies_its_equation(x, foot, height):
    s, q = x - foot, height * float(log_distance(*np.array([foot, height, x, x + 1]))[1])
    assert q > 0
    # (q - s)^2 = r^2 is where q came from; written as q^2 - 2 q s = h^2 and scaled by its largest term
    assert abs(q * q - 2 * q * s - height**2) <= 12 * EPSILON * (q * q + 2 * abs(q * s) + height**2)


@pytest.mark.claim("path-keeps-digits", tolerance="6 roundings")
def test_the_path_does_not_cancel_before_the_light():
    from mpmath import mpf, sqrt, workdps

    with workdps(50):
        expected = float(mpf(-1000) + sqrt(mpf(1000) ** 2 + mpf(1e-4) ** 2))
    q = 1e-4 * float(log_distance(*np.array([1000.0, 1e-4, 0.0, 1.0]))[1])
    assert q == pytest.approx(expected, rel=6 * EPSILON)
