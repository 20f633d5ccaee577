# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a table's entries are its integrals; beyond its edge it returns what the edge holds."""

import numpy as np
import pytest
from mpmath import exp, mpf, pi, quad, tan

from realtime.kernels.table import table, table_records
from tests.helpers.kernel_values import RAY, kernel_values, true_values


@pytest.mark.parametrize("size", [5, 64])
def test_entries_are_the_integrals(size):
    values = table_records(size)[:, 0].reshape(size - 1, size - 1)
    for i, j in ((1, 1), (1, size - 2), (size - 2, size - 2)):
        p, q = (mpf(index) / (size - 1) for index in (i, j))
        expected = quad(lambda xi, p=p: exp(-10 * p * tan(xi)), [0, q * pi / 8, q * pi / 2])
        assert values[i, j] == pytest.approx(float(expected), rel=1e-12)


@pytest.mark.claim("table-edge")
def test_published_form_reads_the_edge_beyond_its_table(variant):
    """Beyond u = 10 the value is that of u = 10 times the true prefactor: far too large or small, by what that says."""
    foot, height, x0, x1, _ = RAY
    rays = (foot, height, x0, x1, np.array([10, 30]) / height)
    inside, outside = kernel_values(table, rays, precision="double")
    assert outside / inside == pytest.approx(np.exp(-(30 - 10) / height * foot), rel=1e-9)
    assert not 0.1 < outside / true_values(rays)[1] < 10
