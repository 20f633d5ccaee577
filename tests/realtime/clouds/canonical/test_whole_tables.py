# SPDX-License-Identifier: BSD-3-Clause
"""Claim: canonical tables as they are used keep to their figure; apart from tests that compute with few streams."""

import pytest

from realtime.clouds.canonical.look_up import on_device
from realtime.clouds.canonical.tables import canonical_tables
from realtime.numerics.array_types import array_types
from tests.helpers.canonical_errors import look_up_errors, random_points
from validation.slab.phases import phase_pair


@pytest.mark.slow
@pytest.mark.claim("clouds-tables-figure", tolerance="1 % of T and 2 % of sigma in c at 95 % of 2000 points, each set")
def test_whole_tables_keep_to_their_figure(variant):
    phase = phase_pair("mie-modified").deterministic
    tables = canonical_tables(phase, 1.0)
    assert tables.size <= 32e6
    types = array_types("single")
    for row in look_up_errors(on_device(tables, types), types, random_points(phase, 1.0, 2000)):
        assert row["T"]["p95"] <= 0.01
        assert row["c"]["p95"] <= 0.02
