# SPDX-License-Identifier: BSD-3-Clause
"""Claim: rays that kernels are tried on cover every magnitude, are exact float32 numbers, and have a certified J."""

import numpy as np
import pytest

from analytic.cases import read_cases
from analytic.certified import integrate_certified
from analytic.phase import PHASE_NAMES, PhaseFunction
from validation.kernels import rays as kernel_rays
from validation.kernels.rays import case_row, hard_rays, slivers, wide_rays
from validation.kernels.values import TABLE, evaluate_cases, take

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


def test_table_has_mean_one_and_is_exact_in_float32():
    values = np.array(TABLE)
    assert np.trapezoid(values, np.linspace(-1, 1, len(values))) == 2.0
    np.testing.assert_array_equal(values, values.astype(np.float32))


def test_truth_is_kept_and_found_again(monkeypatch, tmp_path):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path))  # other tests ask for other truths
    first = wide_rays(64)

    def fail(*columns, **options):
        raise AssertionError("computed again")

    monkeypatch.setattr(kernel_rays, "airlight_segments", fail)
    np.testing.assert_array_equal(wide_rays(64).value, first.value)
    with pytest.raises(AssertionError, match="computed again"):
        wide_rays(64, "rayleigh")  # another phase function is another truth


def test_row_of_a_case_can_be_read_and_run_again(rays, tmp_path, variant):
    from validation.configurations.kernel_names import find_kernel

    k = next(k for k, name in enumerate(rays.phase) if name == "hg" and np.isinf(rays.x1[k]))
    path = tmp_path / "worst.csv"
    path.write_text(",".join(rays.header) + "\n" + case_row(rays, k) + "\n")
    again = read_cases(path)
    for name in (*COLUMNS, "value"):
        assert getattr(again, name)[0] == getattr(rays, name)[k]
    function = find_kernel("quadrature")
    row = take(rays, np.array([k]))
    assert evaluate_cases(again, function, "single").J == evaluate_cases(row, function, "single").J


def test_row_of_a_file_is_its_text(data_folder):
    path = data_folder / "airlight_integral.csv"
    assert case_row(read_cases(path), 3) == path.read_text().splitlines()[4]
