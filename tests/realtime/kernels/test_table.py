# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a table's entries are its integrals; the published form is good near the light alone, the tails everywhere."""

import numpy as np
import pytest
from mpmath import exp, inf, mpf, pi, quad, tan

from realtime.kernels.table import table, table_records
from tests.helpers.kernel_values import RAY, kernel_values, take
from validation.kernels.case_files import read_cases


@pytest.fixture(scope="module")
def cases(data_folder):
    read = read_cases(data_folder / "airlight_integral.csv")
    return take(read, np.array(read.phase) == "isotropic")


def errors(cases, precision, **parameters):
    rays = (cases.foot, cases.height, cases.x0, cases.x1, cases.sigma_t)
    return np.abs(kernel_values(table, rays, precision=precision, **parameters) / cases.value - 1)


@pytest.mark.parametrize("size", [5, 64])
def test_entries_are_the_integrals(size):
    def sun(p, q):
        return quad(lambda xi: exp(-10 * p * tan(xi)), [0, q * pi / 8, q * pi / 2])

    def tail(p, q):
        alpha = q**2 / (1 - q**2)
        return (1 + alpha) * quad(lambda y: exp(-alpha * y) / (1 + 2 * p * y + y * y), [0, 0.1, 1, 10, inf])

    def head(p, q):
        alpha = q / (1 - q)
        return (1 + alpha) * quad(lambda y: exp(-alpha * y) / (1 + (p * y) ** 2), [0, 0.1, 1])

    published = table_records("sun", size)[:, 0].reshape(1, size - 1, size - 1)
    scaled = table_records("tail", size)[:, 0].reshape(2, size - 1, size - 1)
    for i, j in ((1, 1), (1, size - 2), (size - 2, size - 2)):
        for values, integral in zip((*published, *scaled), (sun, tail, head)):
            expected = integral(mpf(i) / (size - 1), mpf(j) / (size - 1))
            assert values[i, j] == pytest.approx(float(expected), rel=1e-12)


@pytest.mark.claim("table-edge")
@pytest.mark.parametrize("precision", ["single", "double"])
def test_tail_form_on_certified_cases(variant, cases, precision):
    error = errors(cases, precision, form="tail")
    sliver = np.array(cases.tag) == "sliver"
    assert error[~sliver].max() < 6e-4  # (1/63)^2 / 8 = 3e-5 times the curvature of the entries: 3e-4 measured
    assert np.median(error) < 5e-5
    # A difference of nearly equal reads: interpolation errs by 1/63 of the slope, and float32 adds its rounding.
    assert error[sliver].max() < (0.2 if precision == "single" else 3e-3)


@pytest.mark.claim("table-edge")
def test_published_form_reads_the_edge_beyond_its_table(variant):
    """Beyond u = 10 the value is that of u = 10 times the true prefactor: far too large or small, by what that says."""
    foot, height, x0, x1, _ = RAY
    rays = (foot, height, x0, x1, np.array([10, 30]) / height)
    inside, outside = kernel_values(table, rays, precision="double")
    assert outside / inside == pytest.approx(np.exp(-(30 - 10) / height * foot), rel=1e-9)
    truth = kernel_values(table, rays, precision="double", form="tail", size=512)[1]
    assert not 0.1 < outside / truth < 10
