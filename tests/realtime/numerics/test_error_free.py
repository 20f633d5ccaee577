# SPDX-License-Identifier: BSD-3-Clause
from fractions import Fraction

import numpy as np
import pytest


def exact(values):
    return [Fraction(float(x)) for x in values]


@pytest.mark.parametrize("precision", ["single", "double"])
def test_sums_and_products_keep_all_digits(variant, precision):
    from realtime.numerics.array_types import array_types
    from realtime.numerics.error_free import two_product, two_sum

    types = array_types(precision)
    rng = np.random.default_rng(4)
    real = np.float32 if precision == "single" else np.float64
    a, b = (rng.normal(size=500) * 10.0 ** rng.uniform(-4, 4, 500) for _ in range(2))
    a, b = a.astype(real), b.astype(real)
    for operation, wanted in ((two_sum, Fraction.__add__), (two_product, Fraction.__mul__)):
        high, low = (exact(np.array(part)) for part in operation(types.scalar(a), types.scalar(b)))
        assert [value + error for value, error in zip(high, low)] == [wanted(x, y) for x, y in zip(exact(a), exact(b))]


def test_vector_products_keep_twice_the_digits(variant):
    """Of nearly parallel vectors, whose cross product cancels, and nearly perpendicular ones."""
    import mitsuba as mi

    from realtime.numerics.error_free import two_cross, two_dot

    rng = np.random.default_rng(6)
    a = rng.normal(size=(3, 4000)).astype(np.float32)
    b = (a * (1 + 1e-6 * rng.normal(size=(3, 4000)))).astype(np.float32)
    x, y = a.astype(np.float64), b.astype(np.float64)
    high, low = (np.array(part, dtype=np.float64) for part in two_cross(mi.Vector3f(a), mi.Vector3f(b)))
    # float64 is exact but for rounding in the 53rd digit; twice 24 digits are 48.
    assert np.max(np.abs(high + low - np.cross(x.T, y.T).T)) < 2.0**-45 * np.max(x**2)
    c = np.cross(x.T, rng.normal(size=(4000, 3))).T.astype(np.float32)
    high, low = (np.array(part, dtype=np.float64) for part in two_dot(mi.Vector3f(a), mi.Vector3f(c)))
    assert np.max(np.abs(high + low - np.sum(x * c, axis=0))) < 2.0**-44 * np.max(np.abs(x * c))
