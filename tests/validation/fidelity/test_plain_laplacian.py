# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the plain filter and the departure of a mesh from its map are what they are called."""

import numpy as np
import pytest

from realtime.methods.light_volumes.published.tessellation import divide, edges, triangles
from validation.fidelity.plain_laplacian import departures, laplacian, plain_edges
from validation.fidelity.tessellation import open_edges

SIZE = 16


def heights(function):
    row, column = np.mgrid[: SIZE + 1, : SIZE + 1] / SIZE
    return function(column, row)[None]


def test_the_laplacian_of_the_depth_by_hand():
    depth = heights(lambda u, v: 1 + (SIZE * u) ** 2)
    response = laplacian(1 / depth)[0]
    assert response[1:-1, 1:-1] == pytest.approx(2.0)
    assert laplacian(1 / heights(lambda u, v: 1 + u + 2 * v))[0, 1:-1, 1:-1] == pytest.approx(0, abs=1e-12)


def test_a_mesh_of_all_texels_departs_nowhere_and_a_coarse_one_does():
    curved = heights(lambda u, v: 1 + u * u)
    everything = [np.ones((1, 2**level, 2**level), bool) for level in range(4)]
    nothing = [np.zeros_like(image) for image in everything]
    assert departures(curved, everything).max() == 0
    # Two triangles over the whole face: along the lower side the chord 1 + u against 1 + u^2.
    u = np.arange(SIZE + 1) / SIZE
    assert departures(curved, nothing)[0, 0] == pytest.approx((1 + u) / (1 + u * u) - 1)
    assert departures(heights(lambda u, v: 2 + u - v / 2), nothing).max() == pytest.approx(0, abs=1e-12)


def test_the_threshold_gives_the_wanted_number_of_triangles():
    wavy = heights(lambda u, v: 2 + np.sin(9 * u * v) + (u > 0.6))
    ours = len(triangles(divide(edges(wavy, 1e-2))))
    assert len(triangles(divide(plain_edges(wavy, ours)))) == pytest.approx(ours, rel=0.2)


def test_open_edges_are_counted():
    tetrahedron = np.array([[0, 1, 2], [0, 3, 1], [1, 3, 2], [2, 3, 0]])
    assert open_edges(tetrahedron) == 0
    assert open_edges(tetrahedron[:3]) > 0
    assert open_edges(tetrahedron[[0, 1, 2, 3]][:, [0, 2, 1]]) == 0
