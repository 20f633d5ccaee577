# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the grid as it is used keeps to its figure; apart from tests that compute with few streams."""

import pytest

from realtime.clouds.canonical.transport_grid import canonical_transport, on_device
from realtime.numerics.array_types import array_types
from tests.helpers.canonical_errors import look_up_errors, random_points
from validation.slab.phases import phase_pair


@pytest.mark.slow
@pytest.mark.claim("clouds-grid-figure", tolerance="2 % of T and 3 % of sigma in c at half of 480 points, each set")
def test_the_whole_grid_keeps_to_its_figure(variant):
    phase = phase_pair("mie-modified").deterministic
    transport = canonical_transport(phase, 1.0)
    assert transport.size <= 50e6
    types = array_types("single")
    for row in look_up_errors(on_device(transport, types), types, random_points(phase, 1.0, 480)):
        assert row["T"]["p50"] <= 0.02
        assert row["c"]["p50"] <= 0.03
