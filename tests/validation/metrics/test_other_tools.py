# SPDX-License-Identifier: BSD-3-Clause
from dataclasses import fields

import numpy as np
import pytest

from analytic.errors import InputError
from validation.metrics.other_tools import PublishedErrors, published_errors

EXACT = 1e-13  # some roundings of double precision

# r = 0.09, 0.19, 0.99 and t = r + 0.1, r - 0.1, r: every denominator below is a number that a hand can divide by.
REFERENCE = np.array([[0.09, 0.19, 0.99]])
TEST = REFERENCE + np.array([[0.1, -0.1, 0.0]])


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("mse", (0.01 + 0.01) / 3),
        ("rmse", np.sqrt(0.02 / 3)),
        ("mae", 0.2 / 3),
        ("rae_tev", (0.1 / 0.1 + 0.1 / 0.2) / 3),
        ("rse_tev", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),
        ("mrse_pbrt", (0.01 / 0.01 + 0.01 / 0.04) / 3),
        ("relmse", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),
        ("relmse_trim", (0.01 / 0.0181 + 0.01 / 0.0461) / 3),  # 0.1 % of three values is none
        ("mape", (0.1 / 0.1 + 0.1 / 0.2) / 3),
        ("smape", (0.2 / (0.09 + 0.19 + 0.02) + 0.2 / (0.19 + 0.09 + 0.02)) / 3),
        ("mrse_jeri", (0.01 / 0.0082 + 0.01 / 0.0362) / 3),
        ("psnr", 10 * np.log10(0.99**2 * 3 / 0.02)),
        ("relative", (0.1 / 0.09 + 0.1 / 0.19) / 3),
        ("relative_max", 0.1 / 0.09),
        ("dark_max", 0.0),
    ],
)
def test_hand_computed_values(name, value):
    assert getattr(published_errors(REFERENCE, TEST), name) == pytest.approx(value, rel=EXACT)


def test_trimming_leaves_out_the_largest_thousandth():
    reference = np.ones((20, 50, 3))  # 3000 values: three go
    test = reference.copy()
    test[0, :4, 0] += [5.0, 4.0, 3.0, 2.0]
    errors = published_errors(reference, test)
    assert errors.relmse_trim == pytest.approx(4 / 1.01 / 2997, rel=EXACT)
    assert errors.relmse == pytest.approx((25 + 16 + 9 + 4) / 1.01 / 3000, rel=EXACT)


def test_dark_values_are_counted_and_judged_in_absolute_terms():
    # mean(r) = 1: below 0.001 lie the black value, wrong by 0.02, and the dim one, wrong by 0.01.
    reference = np.array([[0.0, 0.0005, 1.5, 2.4995]])
    errors = published_errors(reference, reference + np.array([[0.02, -0.01, 0.15, 0.0]]))
    assert (errors.values, errors.dark) == (4, 2)
    assert errors.dark_max == pytest.approx(0.02, rel=EXACT)
    assert errors.relative == pytest.approx(0.1 / 2, rel=EXACT)
    assert errors.relative_max == pytest.approx(0.1, rel=EXACT)


@pytest.mark.parametrize("factor", [1e-30, 1e30])
def test_with_the_mean_as_unit_nothing_has_a_unit(factor):
    rng = np.random.default_rng(3)
    reference = rng.gamma(0.5, 0.01, (12, 9, 3))
    test = reference * rng.normal(1, 0.1, reference.shape)
    plain, scaled = (published_errors(f * reference, f * test, unit=None) for f in (1.0, factor))
    assert scaled.unit == pytest.approx(factor * plain.unit, rel=1e-12)
    for field in fields(PublishedErrors)[1:]:
        # 1e-11: the rounding of the factor, squared and divided.
        assert getattr(scaled, field.name) == pytest.approx(getattr(plain, field.name), rel=1e-11), field.name


@pytest.mark.parametrize(
    ("arguments", "options", "message"),
    [
        ((np.ones((3, 4)), np.ones((4, 3))), {}, "reference is 4 x 3 pixels, the test 3 x 4"),
        ((np.ones((3, 4, 3)), np.ones((3, 4))), {}, "with 3 channels, the test 4 x 3 pixels; render both"),
        ((np.ones((3, 4)), np.ones((3, 4))), {"unit": 0.0}, "unit: got 0.0, wanted a radiance above 0"),
    ],
)
def test_refuses_what_does_not_fit(arguments, options, message):
    with pytest.raises(InputError, match=message):
        published_errors(*arguments, **options)
