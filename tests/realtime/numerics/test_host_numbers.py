# SPDX-License-Identifier: BSD-3-Clause
"""Both ways to the host bring the same numbers, bit for bit."""

import numpy as np
import pytest

from realtime.numerics import host_numbers
from realtime.numerics.array_types import array_types


@pytest.mark.parametrize("on_processor", [True, False], ids=["element by element", "in one transfer"])
@pytest.mark.parametrize("precision", ["single", "double"])
def test_numbers_come_back_by_value(variant, monkeypatch, on_processor, precision):
    import drjit as dr

    types = array_types(precision)
    monkeypatch.setattr(host_numbers, "_on_processor", lambda number: on_processor)
    place, width = types.vector(0.1, -2.3, 4.7e5), types.scalar(1 / 3)
    dr.make_opaque(place, width)
    literal = types.scalar(0.7)
    read = host_numbers.host_numbers(place, width, literal)
    real = np.float32 if precision == "single" else np.float64
    assert [part.dtype for part in read] == [np.float64] * 3
    np.testing.assert_array_equal(read[0], np.array([0.1, -2.3, 4.7e5], dtype=real).astype(np.float64))
    np.testing.assert_array_equal(read[1], [real(1 / 3)])
    np.testing.assert_array_equal(read[2], [real(0.7)])
