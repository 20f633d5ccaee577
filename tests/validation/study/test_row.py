# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a row has every column in its order and no value that is not finite; a Parquet can hold it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from validation.metrics.errors import Metrics
from validation.study.configuration import Configuration
from validation.study.row import COLUMNS, arrow_schema, property_names, row_values
from validation.study.run import cell_row
from validation.study.study import Cell

CELL = Cell("random:7", (16, 12), ("medium.sigma_t=0.1",), Configuration("ray-march", None, (("steps", 4),)))


def test_a_row_has_every_column_and_no_number_that_is_none():
    error = Metrics(192, 0.1, math.nan, 0.2, np.float32(0.5), 0.1, 0.2, math.inf, 3, 0)
    row = row_values(replace(cell_row(CELL, key="a", error=error), properties={"depth": 2}))
    assert list(row) == [*(each.key for each in COLUMNS), "properties.depth"]
    assert [row[f"error.{name}"] for name in ("pixels", "relative_bias", "relative_rmse", "max")] == [
        192,
        None,
        0.5,
        None,
    ]
    assert (row["scene"], row["seed"], row["medium"], row["parameters"]) == (
        "random:7",
        7,
        "medium.sigma_t=0.1",
        '{"steps": 4}',
    )
    assert (row["status"], row["times.frame.median_ms"], row["published.psnr"]) == ("done", None, None)
    assert row["command"] == (
        "airlight view random:7 --method ray-march --set steps=4 --change medium.sigma_t=0.1 --size 16x12"
    )


def test_a_parquet_holds_rows_with_units_and_meanings():
    pa = pytest.importorskip("pyarrow", reason="the extra `sweep` is not installed")
    row = row_values(replace(cell_row(CELL, key="a"), properties={"depth": 2}))
    schema = arrow_schema(property_names([row]))
    table = pa.Table.from_pylist([row], schema=schema)
    assert table.to_pylist() == [row | {"properties.depth": 2.0}]
    about = schema.field("error.bias").metadata
    assert about == {b"unit": b"W/(m^2 sr)", b"meaning": b"mean error"}
    assert all(each.meaning for each in COLUMNS)
