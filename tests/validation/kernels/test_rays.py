# SPDX-License-Identifier: BSD-3-Clause
"""Claim: rays that kernels are tried on cover every magnitude, are exact float32 numbers, and have a certified J."""

import numpy as np
import pytest

from analytic.phase import PHASE_NAMES, PhaseFunction
from tests.evidence.certified.integral import integrate_certified
from validation.kernels.cases import TABLE
from validation.kernels.rays import hard_rays, slivers, wide_rays

COLUMNS = ("g", "foot", "height", "x0", "x1", "sigma_t")


@pytest.fixture
def rays():  # of one test, so that the truth is kept in the tests' own cache
    return hard_rays(2048)


def spans(column, low, high):
    """Whether values reach within a factor of 4 of both ends and never leave the range (float32 rounding aside)."""
    return low * 0.999 <= column.min() < 4 * low and 0.25 * high < column.max() <= high * 1.001


def test_hard_rays_cover_every_magnitude(rays):
    distance = np.hypot(rays.foot, rays.height)
    assert spans(distance, 1e-6, 1e6)
    assert spans(rays.height / distance, 1e-7, 1.0)
    assert spans(rays.sigma_t * (rays.x0 + np.hypot(rays.x0 - rays.foot, rays.height)), 1e-6, 60)
    assert np.abs(rays.g).max() == np.float32(0.95)
    assert set(rays.phase) == set(PHASE_NAMES)
    assert np.isinf(rays.x1).mean() == pytest.approx(0.1, abs=0.01)
    assert len(set(rays.tag)) == 8
    assert (rays.x1 > rays.x0).all()


@pytest.mark.parametrize("draw", [lambda: hard_rays(1000), lambda: slivers(512), lambda: wide_rays(512, "hg", 0.8)])
def test_inputs_are_exact_float32_and_values_fit_float32(draw):
    cases = draw()
    for name in COLUMNS:
        column = getattr(cases, name)
        np.testing.assert_array_equal(column, column.astype(np.float32), err_msg=name)
    assert np.isfinite(cases.value).all()
    assert (cases.value > 1.2e-38).all()  # the smallest normal number
    assert cases.value.max() < 3e38


def test_truth_is_certified(rays):
    """A few of each tag by mpmath."""
    for tag in set(rays.tag):
        k = rays.tag.index(tag)
        name = rays.phase[k]
        phase = PhaseFunction(name, g=float(rays.g[k]), table=TABLE if name == "tabulated" else None)
        columns = (rays.foot, rays.height, rays.x0, rays.x1, rays.sigma_t)
        expected = integrate_certified(*(float(column[k]) for column in columns), phase, digits=16)
        assert rays.value[k] == pytest.approx(float(expected), rel=1e-12), tag
