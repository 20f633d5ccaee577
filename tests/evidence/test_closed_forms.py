# SPDX-License-Identifier: BSD-3-Clause
"""The closed forms that the truth of lights with extent is held against are right themselves."""

import numpy as np
import pytest

from tests.evidence.closed_forms import polygon_in_disk, polygon_overlap, sphere_airlight, sphere_fluence

#: Foot at 0, from -2 to 3, attenuation from -2 on; computed twice in mpmath, over directions and over the cap.
CERTIFIED = [
    (0.21, 0.83, 0.1, 0.04880854432449),
    (0.21, 0.83, 0.3, 0.4626164168379),
    (0.21, 0.83, 0.6, 2.123635219885),
    (1.3, 0.83, 0.3, 0.02890607888329),
    (0.21, 0.35, 0.3, 1.619271567439),
]


@pytest.mark.parametrize(("sigma_t", "height", "radius", "expected"), CERTIFIED)
def test_sphere_beside_a_ray(sigma_t, height, radius, expected):
    value = sphere_airlight(sigma_t, height, radius, foot=2.0, x0=0.0, x1=5.0)
    assert value == pytest.approx(expected, rel=2e-12)


def test_a_sphere_in_clear_air_fills_its_cone():
    distance = np.array([1.0001, 1.5, 7.0, 1e4])
    cone = np.pi / distance**2 * 2 / (1 + np.sqrt((1 - 1 / distance) * (1 + 1 / distance)))
    assert sphere_fluence(0.0, distance, 1.0) == pytest.approx(cone, rel=1e-12)


def test_polygons_by_counting_points():
    triangle = np.array([[-0.3, -0.6], [1.4, 0.1], [0.1, 0.9]])
    rectangle = np.array([[-0.5, -0.4], [0.5, -0.4], [0.5, 0.4], [-0.5, 0.4]])
    x, y = (np.arange(2000)[:, None] + 0.5) / 1000 - 1, (np.arange(2000) + 0.5) / 1000 - 1
    inside = np.ones((2000, 2000), bool)
    for start, end in zip(triangle, np.roll(triangle, -1, axis=0)):
        inside &= (end - start)[0] * (y - start[1]) > (end - start)[1] * (x - start[0])
    assert polygon_in_disk(triangle) == pytest.approx(np.mean(inside & (x**2 + y**2 < 1)) * 4, rel=1e-4)
    assert polygon_in_disk(triangle[::-1]) == pytest.approx(polygon_in_disk(triangle), rel=1e-14)
    assert polygon_overlap(triangle, rectangle) == pytest.approx(
        np.mean(inside & (np.abs(x) < 0.5) & (np.abs(y) < 0.4)) * 4, rel=1e-3
    )
    assert polygon_overlap(triangle + 5, rectangle) == 0
