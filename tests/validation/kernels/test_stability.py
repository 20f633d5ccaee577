# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the study of kernels finds what is wrong, where it is wrong, and holds `exact` to its bar."""

from dataclasses import replace

import drjit as dr
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.errors import InputError as RealtimeInputError
from realtime.kernels.quadrature import quadrature
from tests.helpers.kernel_values import take
from validation.kernels.cases import Values, evaluate_cases
from validation.kernels.errors import errors_by_group, groups
from validation.kernels.rays import hard_rays, slivers, table
from validation.kernels.stability import GENERATED, gamma_difference, kernel_stability


def gauss(geometry, x0, x1, medium, light):
    return quadrature(geometry, x0, x1, medium, light, nodes=8)


def isotropic(cases):
    return take(cases, np.array(cases.phase) == "isotropic")


def study(function, name="own:kernel"):
    return kernel_stability(name, function, {GENERATED: isotropic(hard_rays(256))}, slivers(64))


def four_rays():
    columns = {name: np.ones(4) for name in ("foot", "height", "sigma_t")}
    rays = table(
        ["isotropic"] * 3 + ["hg"], np.zeros(4), x0=np.zeros(4), x1=np.arange(1.0, 5.0), tags="aabb", **columns
    )
    return replace(rays, value=np.array([1.0, 2.0, 4.0, 8.0]))


def test_errors_are_counted_by_group():
    rays = four_rays()
    values = Values(np.array([1.1, 2.0, -4.0, 8.0]), {}, np.ones(4, dtype=bool))
    errors = errors_by_group(rays, values, "single", groups(rays))
    assert list(errors) == ["all", "a", "b", "phase hg", "phase isotropic"]
    assert errors["all"]["max"] == 2.0
    assert errors["all"]["negative"] == 1
    assert errors["all"]["worst"].startswith("b,isotropic,0.0,1.0,1.0,0.0,3.0,1.0,4.0")
    assert errors["a"]["max"] == pytest.approx(0.1)
    assert errors["a"]["mean"] == pytest.approx(0.05)
    assert (errors["phase hg"]["rays"], errors["phase hg"]["max"]) == (1, 0.0)


@pytest.mark.parametrize("error", [InputError, RealtimeInputError])
def test_refusal_keeps_the_words_of_the_kernel(variant, error):
    def refuses(geometry, x0, x1, medium, light):
        if medium.phase.name == "hg":
            raise error("no lobes here")
        return gauss(geometry, x0, x1, medium, light)

    values = evaluate_cases(four_rays(), refuses, "single")
    assert values.refused == {"hg": "no lobes here"}
    assert values.accepted.tolist() == [True, True, True, False]
    assert np.isnan(values.J[3])
    assert np.isfinite(values.J[:3]).all()


def test_small_relative_mistake_is_found_where_it_is(variant):
    """One part in a thousand, only for rays whose light is behind the camera."""

    def wrong_behind(geometry, x0, x1, medium, light):
        J = quadrature(geometry, x0, x1, medium, light, nodes=16)
        return dr.select(geometry.foot < 0, 1.001 * J, J)

    verdict = study(wrong_behind)
    tags = verdict["sets"][0]["double"]
    assert tags["behind"]["median"] == pytest.approx(1e-3, rel=1e-3)
    assert tags["thin"]["max"] < 1e-4
    assert verdict["sets"][0]["single"]["all"]["worst"].split(",")[0] in ("behind", "infinite")
    # Both precisions have the same mistake: they agree.
    assert verdict["sets"][0]["single_against_double"]["behind"]["median"] < 1e-6
    assert (verdict["exact"], verdict["broken"]) == (False, [])


@pytest.mark.claim("exact-keeps-its-bar")
def test_kernel_that_claims_to_be_exact_is_held_to_it(variant):
    verdict = study(gauss, "exact")
    assert verdict["exact"]
    assert any("float32 maximum, |g| up to 0.9" in words and "isotropic" in words for words in verdict["broken"])
    assert any("float64 maximum" in words for words in verdict["broken"])
    assert not any("NaN" in words or "negative" in words for words in verdict["broken"])


def test_negative_and_missing_values_break_the_claim(variant):
    def bad(geometry, x0, x1, medium, light):
        J = gauss(geometry, x0, x1, medium, light)
        return dr.select(geometry.foot < 0, -J, dr.select(x0 > 0, dr.nan, J))

    words = study(bad, "exact")["broken"]
    for precision in ("float32", "float64"):
        assert any(precision in sentence and "negative" in sentence for sentence in words)
        assert any(precision in sentence and "NaN" in sentence for sentence in words)


@pytest.mark.claim("differences-of-gamma")
def test_differences_of_gamma_lose_what_theory_says(variant):
    """Rounding of the two terms, each to about half an epsilon, over their difference."""
    loss = gamma_difference(gauss, slivers(256), "single")
    assert loss["direct"]["max"] < 1e-4
    assert loss["difference"]["median"] > 1e-3
    assert 0.05 < loss["median_rounding"] < 5
