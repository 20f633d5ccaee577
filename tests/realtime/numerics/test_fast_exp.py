# SPDX-License-Identifier: BSD-3-Clause
import numpy as np


def test_relative_error_over_the_stated_range(variant):
    import mitsuba as mi

    from realtime.numerics.fast_exp import exp_bounded

    x = np.linspace(-87, 88, 2_000_001).astype(np.float32)
    value = np.array(exp_bounded(mi.Float(x)), dtype=np.float64)
    assert np.max(np.abs(value / np.exp(x.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring


def test_extremes(variant):
    import mitsuba as mi

    from realtime.numerics.fast_exp import exp_bounded

    value = np.array(exp_bounded(mi.Float([-1e4, -np.inf, np.nan, 0.0])))
    assert np.all((value[:2] > 0) & (value[:2] < 2e-38))
    assert np.isnan(value[2])
    assert value[3] == 1


def test_coefficients_are_those_of_the_fit():
    """Fit 2^f again, by Chebyshev interpolation: near-minimax, so the coefficients agree to the size of the error."""
    from realtime.numerics.fast_exp import _EXP2

    degree = len(_EXP2) - 1
    node = 0.5 * np.cos(np.pi * (np.arange(degree + 1) + 0.5) / (degree + 1))
    fit = np.polyfit(node, np.exp2(node), degree)
    f = np.linspace(-0.5, 0.5, 1001)
    assert np.max(np.abs(np.polyval(fit, f) / np.polyval(_EXP2, f) - 1)) < 3e-8  # half a float32 rounding
    assert np.max(np.abs(np.polyval(_EXP2, f) / np.exp2(f) - 1)) < 3e-8


def test_power_of_two_over_the_stated_range(variant):
    import mitsuba as mi

    from realtime.numerics.fast_exp import exp2_bounded

    x = np.linspace(-125, 125, 1_000_001).astype(np.float32)
    value = np.array(exp2_bounded(mi.Float(x)), dtype=np.float64)
    assert np.max(np.abs(value / np.exp2(x.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring


def test_hyperbolic_sine_over_the_stated_range(variant):
    import mitsuba as mi

    from realtime.numerics.fast_exp import WIDEST, sinh_bounded

    y = np.append(np.linspace(-WIDEST, WIDEST, 100_000), np.geomspace(1e-30, 1, 1000)).astype(np.float32)
    value = np.array(sinh_bounded(mi.Float(y)), dtype=np.float64)
    assert np.max(np.abs(value / np.sinh(y.astype(np.float64)) - 1)) < 2e-7  # stated in the docstring
