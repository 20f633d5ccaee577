# SPDX-License-Identifier: BSD-3-Clause
import mitsuba as mi
import numpy as np

from realtime.numerics.array_types import array_types
from realtime.numerics.functions import WIDEST, exp2_bounded, exp_bounded, exp_expm1_bounded, sinh_bounded


def test_relative_error_over_the_stated_range(variant):
    x = np.linspace(-87, 88, 2_000_001).astype(np.float32)
    value = np.array(exp_bounded(mi.Float(x)), dtype=np.float64)
    assert np.max(np.abs(value / np.exp(x.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring


def test_power_of_two_over_the_stated_range(variant):
    x = np.linspace(-125, 125, 1_000_001).astype(np.float32)
    value = np.array(exp2_bounded(mi.Float(x)), dtype=np.float64)
    assert np.max(np.abs(value / np.exp2(x.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring


def test_hyperbolic_sine_over_the_stated_range(variant):
    y = np.append(np.linspace(-WIDEST, WIDEST, 100_000), np.geomspace(1e-30, 1, 1000)).astype(np.float32)
    value = np.array(sinh_bounded(mi.Float(y)), dtype=np.float64)
    assert np.max(np.abs(value / np.sinh(y.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring


def test_differences_of_exponentials_over_the_stated_range(variant):
    x = np.append(np.linspace(-87, 88, 1_000_001), np.outer([-1, 1], np.geomspace(1e-30, 1, 10_000))).astype(np.float32)
    for precision, error in (("single", 5e-7), ("double", 2e-15)):
        power, less = np.array(exp_expm1_bounded(array_types(precision).scalar(x)), dtype=np.float64)
        np.testing.assert_allclose(less, np.expm1(x.astype(np.float64)), rtol=error)
        np.testing.assert_allclose(power, np.exp(x.astype(np.float64)), rtol=error)
