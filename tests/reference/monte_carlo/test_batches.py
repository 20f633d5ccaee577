# SPDX-License-Identifier: BSD-3-Clause
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.monte_carlo.batches import LARGEST_SEED, combined_moments, parse_seed_ranges, seed_ranges


@given(st.sets(st.integers(0, LARGEST_SEED - 1), min_size=1, max_size=40))
def test_words_name_the_same_seeds(seeds):
    assert parse_seed_ranges(seed_ranges(seeds)) == tuple(sorted(seeds))


@pytest.mark.parametrize("words", ["", "a", "3-1", "1,1", "0-4,2", "-1", "1-", f"{LARGEST_SEED}", "1.5", "0-99999999"])
def test_other_words_are_refused(words):
    with pytest.raises(ValueError, match=r"seeds|invalid literal"):
        parse_seed_ranges(words)


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_pooled_moments_are_those_of_all_numbers(n, m, seed):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(3.0, 1.0, (n, 5)), rng.normal(4.0, 2.0, (m, 5))
    parts = [(len(x), x.mean(axis=0), ((x - x.mean(axis=0)) ** 2).sum(axis=0)) for x in (first, second)]
    mean, squares = combined_moments(*parts)
    together = np.concatenate([first, second])
    # Sums of at most 18 numbers of order 1 to 10: roundings of 1e-16 each.
    np.testing.assert_allclose(mean, together.mean(axis=0), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(squares, ((together - together.mean(axis=0)) ** 2).sum(axis=0), rtol=1e-12, atol=1e-12)
