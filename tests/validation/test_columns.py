# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a record says heading, unit and meaning of every value that it and
the records within it have.
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from airlight.validation.columns import Column, column, columns_of, flat, plain, values_of


@dataclass(frozen=True)
class Inner:
    low: float = column("least", "ms", "of all")


@dataclass(frozen=True)
class Outer:
    name: str
    count: int | None = column(meaning="how many", default=None)
    inner: Inner | None = column("time", meaning="of a frame", default=None)
    others: Mapping[str, float] = field(default_factory=dict)


def test_columns_and_values_have_the_same_keys():
    assert columns_of(Outer) == (
        Column("name", "name", "", "", "string"),
        Column("count", "count", "1", "how many", "int64"),
        Column("inner.low", "time, least", "ms", "of a frame: of all", "float64"),
    )
    assert values_of(Outer("x", 2, Inner(0.5), {"a": 1.0})) == {
        "name": "x",
        "count": 2,
        "inner.low": 0.5,
        "others.a": 1.0,
    }
    assert values_of(Outer("x"))["inner"] is None
    assert flat({"a": {"b": {"c": 1}}, "d": 2}) == {"a.b.c": 1, "d": 2}


def test_plain_makes_what_json_can_hold():
    sample = Outer("x", np.int64(2), Inner(np.float32(0.5)))
    written = plain(
        {"sample": sample, 1: [np.bool_(True), None, (0.25,), float("nan"), np.float32("inf")]}
    )
    assert json.loads(json.dumps(written, allow_nan=False)) == {
        "sample": {"name": "x", "count": 2, "inner": {"low": 0.5}, "others": {}},
        "1": [True, None, [0.25], None, None],
    }
