# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest

from analytic.errors import InputError
from validation.papers.constant_distance import constant_distance_study


def test_a_thin_medium_does_not_care_for_r(variant):
    (thin,) = constant_distance_study(sizes=(0.3,), optical_depths=(1e-4,), image=(24, 18))
    # The exponent is worth sigma_t (R - leg) = 1e-4 (1.2 - 0.75)/2 on average.
    assert thin.relative_rmse < 1e-4
    assert thin.scale == pytest.approx(1, abs=1e-4)


@pytest.mark.claim("mean-distance-of-the-paper", tolerance="5 % of the bias")
def test_a_sphere_lit_from_afar_is_too_dark_as_the_mean_leg_says(variant):
    """To first order in sigma_t the bias is that of the mean leg: -sigma_t (1.2 - 0.75) radius."""
    (row,) = constant_distance_study(sizes=(0.01,), optical_depths=(0.02,), image=(48, 36))
    # Second order: sigma_t times the radius is 0.01. The pixels' chords stand in for the volume: a few per cent.
    assert row.relative_bias == pytest.approx(-0.01 * 0.45, rel=0.05)


def test_error_grows_with_optical_depth_and_no_factor_mends_it(variant):
    rows = constant_distance_study(sizes=(0.4,), optical_depths=(0.1, 1.0, 5.0), image=(32, 24))
    errors = [row.relative_rmse for row in rows]
    assert np.all(np.diff(errors) > 0)
    assert np.all(np.diff([row.shape for row in rows]) > 0)
    assert all(row.shape < row.relative_rmse for row in rows)
    assert rows[-1].scale > 2  # far too dark
    # The lamp is above: chords lie within 40 degrees of their feet, where the series serves a thin medium.
    assert rows[0].polynomial == pytest.approx(rows[0].relative_rmse, rel=0.02)
    assert all(row.printed > row.relative_rmse for row in rows)  # it counts R twice


@pytest.mark.slow
def test_the_truth_judges_alike(variant):
    (by_truth,) = constant_distance_study(sizes=(0.4,), optical_depths=(1.0,), image=(32, 24), against="truth")
    (by_exact,) = constant_distance_study(sizes=(0.4,), optical_depths=(1.0,), image=(32, 24))
    assert by_exact.relative_rmse == pytest.approx(by_truth.relative_rmse, rel=1e-4)
    assert by_exact.shape == pytest.approx(by_truth.shape, rel=1e-4)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"sizes": (1.5,)}, "size: got 1.5"),
        ({"optical_depths": (-1.0,)}, "optical depth: got -1.0"),
        ({"against": "x"}, "against"),
    ],
)
def test_bad_input_is_named(arguments, message):
    with pytest.raises(InputError, match=message):
        constant_distance_study(**arguments)
