# SPDX-License-Identifier: BSD-3-Clause

import numpy as np
import pytest

from analytic.errors import InputError
from validation.metrics.errors import error_metrics, plain

EXACT = 1e-14  # some roundings of double precision


@pytest.mark.claim("error-formulas", tolerance="rounding")
def test_hand_computed_values():
    # mean(r) = 2.5; d = 1, 0, -1, 2: mean 0.5, mean square 6/4; |d|/r = 1, 0, 1/3, 1/2 sorted 0, 1/3, 1/2, 1.
    reference = np.array([[1.0, 2.0], [3.0, 4.0]])
    metrics = error_metrics(reference, reference + np.array([[1.0, 0.0], [-1.0, 2.0]]))
    assert metrics.pixels == 4
    assert metrics.bias == 0.5
    assert metrics.relative_bias == pytest.approx(0.2, rel=EXACT)
    assert metrics.rmse == pytest.approx(np.sqrt(1.5), rel=EXACT)
    assert metrics.relative_rmse == pytest.approx(np.sqrt(1.5) / 2.5, rel=EXACT)
    assert metrics.p50 == pytest.approx(5 / 12, rel=EXACT)  # half-way between 1/3 and 1/2
    assert metrics.p99 == pytest.approx(1 / 2 + 0.97 / 2, rel=EXACT)  # position 0.99 * 3 = 2.97
    assert metrics.max == 1.0
    assert (metrics.nonfinite, metrics.negative) == (0, 0)


@pytest.mark.claim("error-formulas")
def test_channels_are_values_of_their_own():
    # Two pixels, three channels. mean(r) = 12/6 = 2; d = 3 in one value: bias 0.5, mean square 9/6.
    reference = np.array([[[1.0, 2.0, 3.0], [3.0, 2.0, 1.0]]])
    test = reference.copy()
    test[0, 1, 2] += 3
    metrics = error_metrics(reference, test)
    assert metrics.pixels == 2
    assert metrics.bias == 0.5
    assert metrics.rmse == pytest.approx(np.sqrt(1.5), rel=EXACT)
    assert metrics.p50 == 0.0
    assert metrics.max == 3.0


@pytest.mark.claim("error-formulas")
def test_dim_values_are_measured_against_a_floor():
    # mean(r) = 1, so the black value has the denominator 0.001 and the dim one its own 0.004.
    reference = np.array([[0.0, 0.004, 2.996]])
    metrics = error_metrics(reference, reference + np.array([[0.002, 0.002, 0.0]]))
    assert metrics.max == pytest.approx(2.0, rel=EXACT)
    assert metrics.p50 == pytest.approx(0.5, rel=EXACT)


@pytest.mark.parametrize("factor", [2.0**-400, 1e-7, 3e9, 2.0**400])
def test_relative_numbers_have_no_unit(factor):
    rng = np.random.default_rng(6)
    reference = rng.gamma(0.4, 1.3, (11, 13, 3))
    test = reference * rng.normal(1, 0.1, reference.shape)
    plain, scaled = error_metrics(reference, test), error_metrics(factor * reference, factor * test)
    for name in ("relative_bias", "relative_rmse", "p50", "p99", "max"):
        assert getattr(scaled, name) == pytest.approx(getattr(plain, name), rel=1e-11), name
    assert scaled.rmse == pytest.approx(factor * plain.rmse, rel=1e-11)


@pytest.mark.claim("not-finite-is-counted")
def test_nonfinite_pixels_are_counted_and_left_out():
    reference = np.full((2, 3, 3), 2.0)
    test = np.full((2, 3, 3), 3.0)
    test[0, 0, 1] = np.nan
    test[0, 1] = np.inf
    reference[1, 2, 0] = -np.inf
    metrics = error_metrics(reference, test)
    assert (metrics.pixels, metrics.nonfinite) == (6, 3)
    assert (metrics.bias, metrics.rmse, metrics.relative_bias, metrics.max) == (1, 1, 0.5, 0.5)


def test_black_reference_has_absolute_errors_only():
    metrics = error_metrics(np.zeros((2, 2, 3)), np.full((2, 2, 3), 0.5))
    assert (metrics.bias, metrics.rmse) == (0.5, 0.5)
    as_json = plain(metrics)
    assert all(as_json[name] is None for name in ("relative_bias", "relative_rmse", "p50", "p99", "max"))
    assert as_json["rmse"] == 0.5


@pytest.mark.parametrize(
    ("reference", "test", "mask", "message"),
    [
        (np.ones((3, 4, 3)), np.ones((6, 8, 3)), None, "reference is 4 x 3 pixels.*the test 8 x 6 pixels"),
        (np.ones((3, 4, 3)), np.ones((3, 4)), None, "with 3 channels, the test 4 x 3 pixels; render both"),
        (np.ones((2, 2)), np.ones((2, 2)), np.ones((2, 3), bool), r"a mask of bool \(2, 3\)"),
        (np.ones((2, 2)), np.ones((2, 2)), np.zeros((2, 2), bool), "leaves no pixel"),
    ],
)
def test_refuses_what_does_not_fit(reference, test, mask, message):
    with pytest.raises(InputError, match=message):
        error_metrics(reference, test, mask=mask)
