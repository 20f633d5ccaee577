# SPDX-License-Identifier: BSD-3-Clause
"""Claim: data and files of a result come back as they were."""

import numpy as np
import pytest

from reference.storage.kept import Spent, fresh_results, is_kept
from validation.study.results import cached_result, load_result, store_result


def test_what_was_computed_is_found_again_as_it_comes_from_the_disk(own_cache):
    content = np.random.default_rng(3).bytes(1_000_003)
    calls = []

    def compute():
        calls.append(1)
        return {"error": 0.1 * 3, "none": None, "pair": (1, 2)}, {"exr": content, "picture": b""}

    first, second = (cached_result("report-method-a", compute) for _ in range(2))
    assert len(calls) == 1
    assert (first.cached, second.cached) == (False, True)
    assert first.data == second.data == {"error": 0.1 * 3, "none": None, "pair": [1, 2]}
    assert first.files == second.files == {"exr": content, "picture": b""}
    assert (first.measured, first.seconds) == (second.measured, second.seconds)
    with fresh_results(2e9):
        assert load_result("report-method-a") is None


def test_what_is_not_a_number_is_not_kept(own_cache):
    """A report may not hold it: better said where it comes from."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        store_result("report-method-a", ({"error": float("nan")}, {}), Spent(0.0, 0.0))
    assert not is_kept("report-method-a")
