# SPDX-License-Identifier: BSD-3-Clause
"""Derivatives of kernels: certified ones are right, and those of the kernels are judged by them."""

import numpy as np
import pytest

from analytic.certified import SLOPES, certified_slopes, integrate_certified
from analytic.phase import PhaseFunction
from realtime.kernels.registry import KERNELS
from validation.configurations.kernel_names import find_kernel
from validation.kernels.slopes import certified_slope_cases, forward_slope, slope_errors


def test_certified_derivatives_are_those_of_the_integrand():
    place = (1.25, 0.75, 0.0, 4.5, 0.5)
    phase = PhaseFunction("hg", g=0.25)
    slopes = dict(zip(SLOPES, certified_slopes(*place, phase), strict=True))
    foot, height, x0, x1, sigma_t = place

    def integrand(x):
        s = x - foot
        r = np.hypot(s, height)
        return np.exp(-sigma_t * (x + r)) * phase(-s / r) / r**2

    assert float(slopes["x1"]) == pytest.approx(float(integrand(np.array(x1))), rel=1e-12)
    assert float(slopes["x0"]) == pytest.approx(-float(integrand(np.array(x0))), rel=1e-12)
    # Lengths times a factor and the extinction over it leave J times that factor as it was.
    value = float(integrate_certified(*place, phase, digits=17))
    scaled = sum(float(slopes[name]) * size for name, size in zip(SLOPES[:4], place[:4], strict=True))
    assert scaled - sigma_t * float(slopes["sigma_t"]) == pytest.approx(-value, rel=1e-12)


def test_the_file_has_what_is_computed():
    for cases in certified_slope_cases():
        place = cases.inputs[:, 0]
        phase = PhaseFunction(cases.phase, g=place[5]) if cases.phase == "hg" else PhaseFunction(cases.phase)
        wanted = [float(slope) for slope in certified_slopes(*place[:5], phase)]
        assert cases.slopes[:, 0] == pytest.approx(wanted, rel=1e-14, nan_ok=True)
    assert sum(len(cases.value) for cases in certified_slope_cases()) == 40


@pytest.mark.claim("kernel-slopes", tolerance="1e-4, 1e-8")
def test_derivatives_of_the_default_are_exact(variant):
    for cases in certified_slope_cases():
        errors = slope_errors(find_kernel("exact"), cases)
        assert {each.by for each in errors} >= set(SLOPES[:5])
        for each in errors:
            # What float32 and float64 derivatives must keep; found: 4e-6 and 4e-15.
            assert each.single < 1e-4
            assert each.double < 1e-8


@pytest.mark.parametrize("kernel", ["quadrature", "quadrature-theta", "polynomial"])
def test_other_kernels_have_derivatives_too(variant, kernel):
    assert kernel in KERNELS
    for cases in certified_slope_cases():
        for each in slope_errors(find_kernel(kernel), cases):
            assert each.single is None or each.single < 2e-2  # fixed nodes: as wrong as their values, times some
            assert each.double is None or each.double < 2e-2


def test_a_value_without_gradient_is_no_other(variant):
    cases = certified_slope_cases()[0]
    assert forward_slope(lambda geometry, x0, x1, medium, light: x0 * 0 + 1.0, cases, 4, "double") == pytest.approx(
        np.zeros(len(cases.value))
    )
