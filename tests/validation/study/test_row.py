# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a row has every column in its order, no value that is not finite, and its Parquet the types of the list."""

import math

import numpy as np
import pytest

from analytic.errors import InputError
from validation.study.row import COLUMNS, checked_row


def test_a_row_has_every_column_and_no_number_that_is_none():
    row = checked_row({"property.depth": 2, "p99": math.nan, "max": np.float32(0.5), "key": "a", "status": "done"})
    assert list(row) == [*(column.name for column in COLUMNS), "property.depth"]
    assert row["p99"] is None
    assert (row["max"], row["property.depth"]) == (0.5, 2.0)


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"key": "a", "status": "done", "p98": 1.0}, "'p98', which is no column"),
        ({"status": "done"}, "key None"),
        ({"key": "a", "status": "done", "width": 1.5}, "1.5 in the column width, wanted int32"),
        ({"key": "a", "status": "done", "property.x": "much"}, "'much' in the column property.x"),
    ],
)
def test_what_is_no_row_is_refused_by_name(values, message):
    with pytest.raises(InputError, match=message):
        checked_row(values)
