# SPDX-License-Identifier: BSD-3-Clause
import math

import numpy as np
import pytest

from analytic.errors import InputError
from validation.kernels.convergence import convergence, declared, gauss_rate
from validation.kernels.rays import table, with_truth

# Errors swing about their envelope by the phase of the singularity: rates within 4 % (of a decade in three sizes, 1 in
# 60), orders within 0.1 of 2 where the grid of a table meets the rays by chance, 0.01 where nothing is random.
BANDS = {"quadrature": 0.04, "quadrature-theta": 0.04, "taylor": 0.02, "uniform": 0.005, "equiangular": 0.005}


@pytest.mark.claim("declared-orders")
@pytest.mark.parametrize("kernel", BANDS)
def test_measured_rate_is_the_declared_one(variant, kernel):
    study = convergence(kernel)
    assert study.measured == pytest.approx(study.declared.value, rel=BANDS[kernel])
    assert study.measured == (study.rate if study.declared.kind == "rate" else study.order)


def test_tables_interpolate_linearly(variant):
    assert convergence("table").measured == pytest.approx(2.0, abs=0.1)
    assert convergence("table-tail", (32, 64, 128), cases=declared()["table-tail"].cases).order == pytest.approx(
        2, abs=0.2
    )


def test_rate_of_gauss_is_that_of_legendre_on_a_pole():
    """1/(1 + (x/b)^2) on [-1, 1] has its poles at +-b i."""
    b = 0.7
    exact = 2 * b * math.atan(1 / b)
    errors = []
    for n in (8, 16):
        nodes, weights = np.polynomial.legendre.leggauss(n)
        errors.append(abs(weights @ (1 / (1 + (nodes / b) ** 2)) - exact))
    # The error is 2 pi b rho^-(2n + 1) up to terms smaller by 1/n^2 and rho^-2n.
    assert (errors[1] / errors[0]) ** (1 / 8) == pytest.approx(gauss_rate(b * 1j, -1, 1), rel=2e-3)


def test_rate_does_not_depend_on_the_unit_or_the_half_plane():
    assert gauss_rate(0.5 + 1j, 0, 2) == pytest.approx(gauss_rate(5 - 10j, 0, 20))
    assert gauss_rate(3.0, -1, 1) == pytest.approx(gauss_rate(-3.0, -1, 1)) == pytest.approx((3 + 8**0.5) ** -2)


def test_own_rays_and_sizes_declare_nothing(variant):
    unit = np.array([1.0])
    cases = table(
        ["isotropic"], 0 * unit, foot=unit, height=unit, x0=0 * unit, x1=2 * unit, sigma_t=0.3 * unit, tags=["own"]
    )
    study = convergence("uniform", (16, 32, 64), cases=with_truth(cases))
    assert study.order == pytest.approx(2, abs=0.01)
    assert study.declared is study.measured is None
    assert len(study.errors) == 3


def test_kernel_without_a_declaration_needs_rays():
    with pytest.raises(InputError, match="'closed-form' declares no order or rate; give sizes and cases"):
        convergence("closed-form")


def test_exact_values_leave_no_slope(variant):
    """A vacuum is constant in the angle: nothing but rounding is left at any size."""
    unit = np.array([1.0])
    cases = table(
        ["isotropic"], 0 * unit, foot=unit, height=unit, x0=0 * unit, x1=2 * unit, sigma_t=0 * unit, tags=["own"]
    )
    study = convergence("equiangular", (4, 8), cases=with_truth(cases))
    assert max(study.errors) < 1e-14
    assert (study.order, study.rate) == (None, None)
