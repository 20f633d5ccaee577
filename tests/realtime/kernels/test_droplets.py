# SPDX-License-Identifier: BSD-3-Clause
"""Kernels in fog of droplets: against certified values, and on rays of many magnitudes."""

from pathlib import Path

import numpy as np
import pytest

CERTIFIED = Path(__file__).parents[2] / "data" / "airlight_integral_droplets.csv"


@pytest.mark.claim("droplets-kernels", tolerance="1e-5 in float32, 1e-7 in float64; droplets of 6 um 1e-4")
@pytest.mark.parametrize(("precision", "allowed"), [("single", 1e-5), ("double", 1e-7)])
def test_the_default_kernel_meets_certified_values(variant, precision, allowed):
    from analytic.cases import read_cases
    from validation.kernels.cases import integrate_cases

    cases = read_cases(CERTIFIED)
    assert integrate_cases(cases, "exact", precision) == pytest.approx(cases.value, rel=allowed)


@pytest.mark.parametrize(
    ("words", "single", "double"),
    [("hg-draine:5", 1e-5, 1e-10), ("hg-draine:50", 1e-5, 1e-10), ("mie:2:8", 1e-5, 1e-7), ("mie", 1e-4, 2e-7)],
)
@pytest.mark.claim("droplets-kernels")
def test_the_default_kernel_on_many_rays(variant, words, single, double):
    from realtime.kernels.exact import exact
    from validation.kernels.rays import wide_rays
    from validation.kernels.values import evaluate_cases

    rays = wide_rays(1024, words)
    for precision, allowed in (("single", single), ("double", double)):
        value = evaluate_cases(rays, exact, precision).J
        bright = rays.value > 1e-30
        assert np.max(np.abs(value[bright] / rays.value[bright] - 1)) < allowed


def test_kernels_that_need_a_series_take_hg_draine_and_refuse_droplets(variant):
    from analytic.cases import read_cases
    from realtime.kernels.taylor import taylor
    from validation.kernels.values import evaluate_cases

    cases = read_cases(CERTIFIED)
    refused = evaluate_cases(cases, taylor, "single").refused
    assert {name.partition(":")[0] for name in refused} == {"mie"}
    assert "mie" in next(iter(refused.values()))
