# SPDX-License-Identifier: BSD-3-Clause
import zlib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from reports.page.image_codec import (
    DIFFERENCE_BITS,
    FLIP_BITS,
    GRADIENT,
    PRECISIONS,
    REFERENCE_BITS,
    difference_codes,
    pack_planes,
    reference_codes,
    reference_values,
)
from tests.helpers.decoding import decode_planes, difference_values


@pytest.mark.parametrize("bits", [REFERENCE_BITS, DIFFERENCE_BITS, FLIP_BITS])
@pytest.mark.parametrize("size", [(1, 1), (1, 9), (9, 1), (37, 64)])
@pytest.mark.parametrize("planes", [1, 3])
def test_planes_come_back_as_they_went(bits, size, planes):
    rng = np.random.default_rng(3)
    low, high = (-(1 << 15), 1 << 15) if bits == DIFFERENCE_BITS else (0, 1 << bits)
    codes = rng.integers(low, high, (*size, planes)).astype(np.int32)
    np.testing.assert_array_equal(decode_planes(pack_planes(codes, bits), size[::-1], bits), codes)


def test_smooth_planes_are_predicted_and_equal_channels_cost_nothing():
    x, y = np.meshgrid(np.arange(200), np.arange(150))
    smooth = np.round(3000 * np.sin(x / 30) * np.cos(y / 40)).astype(np.int32)
    packed = pack_planes(np.repeat(smooth[..., None], 3, axis=2), DIFFERENCE_BITS)
    assert packed.planes[0] == (0, GRADIENT)
    assert {relative for relative, _ in packed.planes[1:]} == {1}
    # Two further planes that are the first again, 120 000 zeros: zlib writes a few bits for each 258 of them.
    alone = pack_planes(smooth[..., None], DIFFERENCE_BITS)
    assert len(packed.data) < len(alone.data) + 600
    assert len(packed.data) < 0.35 * len(zlib.compress(smooth.astype(np.int16).tobytes()))


@pytest.mark.parametrize("precision", PRECISIONS)
def test_differences_keep_their_size_over_all_magnitudes(precision):
    """The bound is that of the module; the second term of its expansion is below 1e-6 here, the margin 1 %."""
    size = np.concatenate([np.geomspace(1e-10, 1e6, 4001), np.zeros(3)])
    difference = np.concatenate([size, -size])[None, :, None]
    codes, k = difference_codes(difference, precision)
    assert k == precision.k
    error = np.abs(difference_values(codes, k, precision.s) - difference)
    bound = 1.01 * np.sqrt(precision.s**2 + difference**2) / (2 * k)
    assert np.all(error <= bound)
    assert error.max() > 0  # it does round


def test_a_method_wrong_by_a_millionth_shows_its_own_errors_and_not_those_of_the_encoding():
    rng = np.random.default_rng(5)
    difference = 1e-6 * rng.standard_normal((40, 50, 3))
    codes, k = difference_codes(difference, PRECISIONS[0])
    back = difference_values(codes, k, PRECISIONS[0].s)
    # Rounding to steps of 5e-8 has a deviation of 1.4e-8, 1.4 % of the errors; a half float would have added 2e-4.
    assert np.std(back - difference) < 0.02 * np.std(difference)


@given(st.lists(st.floats(width=32), min_size=1, max_size=12))
@settings(max_examples=150, deadline=None)
def test_any_float_survives_as_a_difference(values):
    """Nothing is clamped: what is larger than the codes reach makes the steps coarser, infinities and NaN stay."""
    difference = np.array(values, dtype=np.float64)[None, :, None]
    codes, k = difference_codes(difference, PRECISIONS[0])
    assert np.abs(codes).max() <= 32768
    decoded = decode_planes(pack_planes(codes, DIFFERENCE_BITS), (len(values), 1), DIFFERENCE_BITS)
    back = difference_values(decoded, k, PRECISIONS[0].s)
    np.testing.assert_array_equal(np.isnan(back), np.isnan(difference))
    np.testing.assert_array_equal(np.isinf(back), np.isinf(difference))
    finite = np.isfinite(difference)
    bound = np.sqrt(PRECISIONS[0].s ** 2 + difference[finite] ** 2) / (2 * k)
    # Near the end of float32 k is about 340: half a step is 1.5e-3, its square the next term.
    assert np.all(np.abs(back[finite] - difference[finite]) <= 1.01 * bound)
    assert np.all(np.sign(back[finite]) * np.sign(difference[finite]) >= 0)


def test_reference_keeps_sixteen_binary_digits():
    rng = np.random.default_rng(7)
    values = np.concatenate([rng.lognormal(sigma=12, size=5000), -rng.lognormal(size=100), [0.0, 1.0, 2.0**-126]])
    back = reference_values(reference_codes(values.astype(np.float32)))
    single = values.astype(np.float32).astype(np.float64)
    assert np.all(np.abs(back - single) <= 2.0**-16 * np.abs(single))


def test_reference_keeps_what_is_not_finite():
    values = np.array([np.nan, -np.nan, np.inf, -np.inf, np.finfo(np.float32).max, 0.0])
    back = reference_values(reference_codes(values))
    assert np.isnan(back[:2]).all()
    np.testing.assert_array_equal(back[2:4], [np.inf, -np.inf])
    assert back[5] == 0
