# SPDX-License-Identifier: BSD-3-Clause
"""Claim: data and arrays of a result come back as they were."""

import numpy as np
import pytest

from reference.storage.kept import fresh_results, is_kept
from validation.study.results import cached_result


def test_what_was_computed_is_found_again_as_it_comes_from_the_disk(own_cache):
    image = np.random.default_rng(3).normal(size=(7, 5, 3)).astype(np.float32)
    calls = []

    def compute():
        calls.append(1)
        return {"error": 0.1 * 3, "none": None, "pair": (1, 2)}, {"airlight": image}

    first, second = (cached_result("cell-a", compute) for _ in range(2))
    assert len(calls) == 1
    assert (first.cached, second.cached) == (False, True)
    assert first.data == second.data == {"error": 0.1 * 3, "none": None, "pair": [1, 2]}
    assert first.arrays.keys() == second.arrays.keys() == {"airlight"}
    np.testing.assert_array_equal(second.arrays["airlight"], image)
    assert second.arrays["airlight"].dtype == np.float32
    assert (first.measured, first.seconds) == (second.measured, second.seconds)
    with fresh_results(2e9):
        assert not is_kept("cell-a")


def test_what_is_not_a_number_or_not_worth_it_is_not_kept(own_cache):
    """A report may not hold it: better said where it comes from."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        cached_result("cell-a", lambda: ({"error": float("nan")}, {}))
    refused = cached_result("cell-a", lambda: ({"status": "refused"}, {}), worth=lambda row: row["status"] == "done")
    assert refused.data == {"status": "refused"}
    assert not is_kept("cell-a")
