# SPDX-License-Identifier: BSD-3-Clause
"""Claim: rows take the figure that they name, with its spread, and what was not measured stays so."""

import pytest

from validation.fidelity.figures import at, impossible, largest, milliseconds, rate, ratio, smallest
from validation.fidelity.row import NotMeasured, Spread

TIMING = {"median_ms": 20.0, "low_ms": 10.0, "high_ms": 40.0}


def test_a_number_is_taken_from_its_place():
    assert at("a", 1, "b")({"a": [None, {"b": 3}]}) == 3.0
    with pytest.raises(KeyError):
        at("a")({})


def test_rates_turn_the_quartiles_over():
    assert rate(TIMING) == Spread(50.0, 25.0, 100.0)
    assert milliseconds(TIMING) == Spread(20.0, 10.0, 40.0)
    assert rate(None, "too slow") == NotMeasured("not measured: too slow")


def test_a_ratio_has_the_widest_spread():
    assert ratio(lambda _: 6.0, lambda _: 3.0)({}) == 2.0
    assert ratio(lambda _: Spread(6.0, 4.0, 8.0), lambda _: Spread(2.0, 1.0, 4.0))({}) == Spread(3.0, 1.0, 8.0)
    missing = impossible("gone")
    assert ratio(missing, lambda _: 1.0)({}) == ratio(lambda _: 1.0, missing)({}) == NotMeasured("gone")


def test_the_largest_and_the_smallest_of_several():
    takes = (lambda _: 2.0, lambda _: Spread(5.0, 1.0, 9.0), lambda _: 3.0)
    assert largest(*takes)({}) == Spread(5.0, 1.0, 9.0)
    assert smallest(*takes)({}) == 2.0
    assert largest(*takes, impossible("gone"))({}) == NotMeasured("gone")
