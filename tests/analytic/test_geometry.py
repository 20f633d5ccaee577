# SPDX-License-Identifier: BSD-3-Clause
"""Geometry: no digits lost close to the light, conversions that undo each other, refusals."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from analytic.geometry import foot_and_height, path_length
from tests.helpers.changes_of_variables import theta_of_w, theta_of_x, w_of_theta, w_of_x, x_of_theta, x_of_w

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


def test_a_near_miss_keeps_its_digits():
    # o = 0, direction along (1, 1, 0)/sqrt 2 but for float32 rounding, light 1e-7 off the ray.
    direction = np.float32([np.sqrt(0.5), np.sqrt(0.5), 0.0]).astype(float)
    light = np.array([[10.0 + 2.0**-23, 10.0, 0.0]])
    _, height = foot_and_height(np.zeros(3), direction, light)
    # Both components of the direction are the same number, so the height is exactly 2^-23/sqrt 2 up to rounding.
    assert height[0] == pytest.approx(2.0**-23 / np.sqrt(2), rel=4 * EPSILON)


finite = st.floats(min_value=-1e3, max_value=1e3)
heights = st.floats(min_value=1e-6, max_value=1e3)


@pytest.mark.claim("path-keeps-digits")
@given(x=finite, foot=finite, height=heights)
def test_path_length_satisfies_its_equation(x, foot, height):
    s, q = x - foot, float(path_length(x, foot, height))
    assert q > 0
    # (q - s)^2 = r^2 is where q came from; written as q^2 - 2 q s = h^2 and scaled by its largest term
    assert abs(q * q - 2 * q * s - height**2) <= 8 * EPSILON * (q * q + 2 * abs(q * s) + height**2)


@pytest.mark.claim("path-keeps-digits", tolerance="4 roundings")
def test_path_length_does_not_cancel_before_the_light():
    from mpmath import mpf, sqrt, workdps

    with workdps(50):
        expected = float(mpf(-1000) + sqrt(mpf(1000) ** 2 + mpf(1e-4) ** 2))
    assert float(path_length(0.0, 1000.0, 1e-4)) == pytest.approx(expected, rel=4 * EPSILON)
    assert path_length([0.0, 2.0], 1.0, 0.0).tolist() == [0.0, 2.0]


@given(x=finite, foot=st.floats(min_value=-10, max_value=10), height=st.floats(min_value=0.1, max_value=1e3))
def test_conversions_undo_each_other(x, foot, height):
    # tan and sinh multiply the rounding of a steep angle or a large w: by (s/h)^2 and s/h, at most 1e8 and 1e4 here.
    theta, w = theta_of_x(x, foot, height), w_of_x(x, foot, height)
    steep = 1 + ((x - foot) / height) ** 2
    assert x_of_theta(theta, foot, height) == pytest.approx(x, abs=4 * EPSILON * (1e3 + height * steep))
    assert x_of_w(w, foot, height) == pytest.approx(x, abs=64 * EPSILON * 1e3)
    assert theta_of_w(w) == pytest.approx(float(theta), abs=8 * EPSILON)
    assert w_of_theta(theta) == pytest.approx(float(w), abs=8 * EPSILON * np.sqrt(steep) + 1e-14)
    assert np.exp(w) * height == pytest.approx(float(path_length(x, foot, height)), rel=64 * EPSILON)
    assert np.tan(theta / 2 + np.pi / 4) == pytest.approx(float(np.exp(w)), rel=8 * EPSILON * steep)
