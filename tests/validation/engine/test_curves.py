# SPDX-License-Identifier: BSD-3-Clause
"""Curves and primaries are those of their standards."""

import numpy as np
import pytest

from validation.engine.curves import PRIMARIES, from_srgb, to_pq, to_srgb
from validation.fog_model.view import EDGES


def test_pq_has_the_values_of_its_standard():
    """SMPTE ST 2084: 10 000 cd/m^2 is 1, 100 cd/m^2 is 0.508, black is 7e-7."""
    np.testing.assert_allclose(to_pq(np.array([0.0, 1.0, 100.0, 200.0]), 100.0), [0.0, 0.508078, 1.0, 1.0], atol=1e-6)


def test_primaries_keep_white_and_are_those_of_their_standards():
    """ITU-R BT.2087 has the matrix of Rec. 2020; the ACES documents have that of ACEScg, by Bradford's adaptation."""
    for matrix in PRIMARIES.values():
        np.testing.assert_allclose(matrix.sum(axis=1), 1, atol=1e-12)
    expected = [[0.6274, 0.3293, 0.0433], [0.0691, 0.9195, 0.0114], [0.0164, 0.0880, 0.8956]]
    np.testing.assert_allclose(PRIMARIES["Rec. 2020"], expected, atol=6e-5)
    expected = [[0.61310, 0.33952, 0.04738], [0.07019, 0.91635, 0.01345], [0.02062, 0.10957, 0.86981]]
    np.testing.assert_allclose(PRIMARIES["ACEScg (AP1)"], expected, atol=1e-4)


def test_decoding_undoes_the_srgb_curve():
    values = np.array([0.0, 0.001, 0.02, 0.5, 3.0])
    np.testing.assert_allclose(from_srgb(to_srgb(values)), values, rtol=1e-6)


@pytest.mark.parametrize(("edge", "middle"), [("linear", 0.5), ("square", 0.25), ("smoothstep", 0.5)])
def test_edges_of_spots_go_from_dark_to_full(edge, middle):
    np.testing.assert_allclose(EDGES[edge](np.array([0.0, 0.5, 1.0])), [0, middle, 1])
