# SPDX-License-Identifier: BSD-3-Clause
"""Batches: seeds, moments, where samples go, and a path tracer that follows the counts."""

import mitsuba as mi
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from airlight.reference.monte_carlo.batches import (
    EQUAL,
    LARGEST_SEED,
    LAYERS,
    allocated,
    combined_moments,
    merged,
    parse_seed_ranges,
    seed_ranges,
    single_batch,
)
from airlight.reference.monte_carlo.volpath import volpath_batch
from airlight.reference.scene.read import read_reference
from tests.helpers.scenes import tiny_scene


@given(st.sets(st.integers(0, LARGEST_SEED - 1), min_size=1, max_size=40))
def test_words_name_the_same_seeds(seeds):
    assert parse_seed_ranges(seed_ranges(seeds)) == tuple(sorted(seeds))


@pytest.mark.parametrize(
    "words", ["", "a", "3-1", "1,1", "0-4,2", "-1", "1-", f"{LARGEST_SEED}", "1.5", "0-99999999"]
)
def test_other_words_are_refused(words):
    with pytest.raises(ValueError, match=r"seeds|invalid literal"):
        parse_seed_ranges(words)


@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_pooled_moments_are_those_of_all_numbers(n, m, seed):
    rng = np.random.default_rng(seed)
    first, second = rng.normal(3.0, 1.0, (n, 5)), rng.normal(4.0, 2.0, (m, 5))
    parts = [
        (len(x), x.mean(axis=0), ((x - x.mean(axis=0)) ** 2).sum(axis=0)) for x in (first, second)
    ]
    mean, squares = combined_moments(*parts)
    together = np.concatenate([first, second])
    # Sums of at most 18 numbers of order 1 to 10: roundings of 1e-16 each.
    np.testing.assert_allclose(mean, together.mean(axis=0), rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(
        squares, ((together - together.mean(axis=0)) ** 2).sum(axis=0), rtol=1e-12, atol=1e-12
    )


# Where samples go ---------------------------------------------------------------------------------


SHAPE = (6, 8)
PIXELS = SHAPE[0] * SHAPE[1]


def pilot_with(spread):
    """Two batches whose pixels differ by twice the given spread in each layer."""
    image = np.repeat(np.asarray(spread).reshape(1, PIXELS, 1), 2, axis=0) * np.ones(3)
    return merged(single_batch(0, 4, image), single_batch(1, 4, -image))


def everywhere():
    return {layer: np.ones(SHAPE, dtype=bool) for layer in LAYERS}


@pytest.mark.claim("samples-shared-out")
def test_more_goes_where_more_spreads_and_the_sum_stays():
    spread = np.full(SHAPE, 0.01)
    spread[:3] = 0.09
    counts = allocated(pilot_with(spread), 1000, shape=SHAPE, masks=everywhere())[0].reshape(SHAPE)
    # Away from the border between the halves: a quarter for all, the rest by 9 to 1.
    assert counts[0, 0] / counts[-1, 0] == pytest.approx(
        (EQUAL + 0.75 * 1.8) / (EQUAL + 0.75 * 0.2), rel=0.1
    )
    assert counts.mean() == pytest.approx(1000, rel=1e-3)  # rounding of 48 counts


@pytest.mark.claim("samples-shared-out")
@pytest.mark.statistical
def test_the_mean_is_the_same_and_spreads_less(variant):
    """Rationale: counts that follow the spread leave the mean of every pixel where it was.

    Setup: 64 batches with equal counts and 64 with allocated ones, other seeds. Expected: image
    means that differ by less than 4 of their standard errors (1 in 16 000 by chance), and a smaller
    error of the image mean for the airlight.
    """
    reference = read_reference(mi.load_dict(tiny_scene(size=(12, 9))))
    shape = (reference.height, reference.width)
    masks = {layer: np.ones(shape, dtype=bool) for layer in LAYERS}

    def run(first, count, counts=None):
        batches = [
            volpath_batch(reference, first + number, 32, counts=counts) for number in range(count)
        ]
        pooled = batches[0]
        for batch in batches[1:]:
            pooled = merged(pooled, batch)
        return pooled

    counts = allocated(run(1000, 16), 32, shape=shape, masks=masks)
    assert counts.max() > 2 * counts.min()
    equal, unequal = run(0, 64), run(200, 64, counts)
    for number in range(len(LAYERS)):
        means = [pooled.mean[number].mean() for pooled in (equal, unequal)]
        errors = [
            np.sqrt((pooled.standard_error[number][:, 1] ** 2).sum()) / len(counts[0])
            for pooled in (equal, unequal)
        ]
        assert means[0] > 0
        assert abs(means[0] - means[1]) < 4 * np.hypot(*errors)
        # By how much depends on the scene; it must not be worse.
        assert errors[1] < errors[0]


def test_counts_are_those_of_each_pixel(variant):
    """A pixel with as many samples as it had in a batch of its own scene has the same
    law; one part or many agree.
    """
    reference = read_reference(mi.load_dict(tiny_scene(size=(4, 3))))
    counts = np.stack([np.arange(1, 13), np.arange(12, 0, -1)]).astype(np.uint32)
    batch = volpath_batch(reference, 5, 8, counts=counts)
    assert batch.mean.shape == (2, 12, 3)
    assert np.all(np.isfinite(batch.mean))
    equal = volpath_batch(reference, 5, 8)
    same = volpath_batch(reference, 5, 8, counts=np.full((2, 12), 8, dtype=np.uint32))
    assert np.array_equal(equal.mean, same.mean)
