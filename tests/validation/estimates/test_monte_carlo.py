# SPDX-License-Identifier: BSD-3-Clause
"""Batches through the cache: the same numbers whatever was in it, and nothing lost by an interruption."""

import errno
import time
from dataclasses import fields

import mitsuba as mi
import numpy as np
import pytest

import validation.estimates.monte_carlo
from analytic.errors import InputError
from reference.monte_carlo.batches import LARGEST_SEED, Batches, single_batch
from reference.scene.read import read_truth
from reference.storage.cache import cache_folder
from reference.storage.kept import fresh_results
from tests.helpers.scenes import tiny_scene
from validation.estimates.monte_carlo import BLOCK, monte_carlo_batches


@pytest.fixture
def scene(variant):
    return mi.load_dict(tiny_scene(size=(4, 3)))


@pytest.fixture
def traced(monkeypatch, own_cache):
    """Put random numbers in the place of the tracer, and list the seeds that were asked for."""
    seeds = []

    def trace(truth, seed, samples, *, max_depth=2, counts=None):
        seeds.append(seed)
        mean = np.random.default_rng([seed, samples, max_depth]).exponential(size=(2, 12, 3))
        return single_batch(seed, samples, mean)

    monkeypatch.setattr(validation.estimates.monte_carlo, "volpath_batch", trace)
    return seeds


def volpath(scene, **options):
    return monte_carlo_batches(scene, "volpath", **({"samples": 4} | options))


def assert_same(actual, expected):
    for field in fields(Batches):
        np.testing.assert_array_equal(getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name)
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


@pytest.mark.claim("runs-go-on", tolerance="none: equal")
@pytest.mark.parametrize(("first", "count"), [(0, 2), (0, 21), (5, 3), (5, 20)])
def test_the_cache_never_changes_what_is_returned(scene, traced, monkeypatch, tmp_path, first, count):
    """A run from an empty cache, a second one, and one from a cache that holds more on both sides: the same bits."""
    fresh = volpath(scene, batches=count, first_seed=first)
    assert traced == list(range(first, first + count))
    again = volpath(scene, batches=count, first_seed=first)
    assert (fresh.cached, again.cached, again.damaged) == (0, count, 0)
    assert_same(again.batches, fresh.batches)
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path / "other"))
    volpath(scene, batches=count + 17, first_seed=max(0, first - 3))
    assert_same(volpath(scene, batches=count, first_seed=first).batches, fresh.batches)
    assert fresh.batches.seeds == tuple(range(first, first + count))


@pytest.mark.claim("standard-errors")
def test_moments_are_those_of_all_batches(scene, traced):
    pooled = volpath(scene, batches=21, first_seed=5).batches
    means = np.stack(
        [validation.estimates.monte_carlo.volpath_batch(read_truth(scene), seed, 4).mean for seed in range(5, 26)]
    )
    # Sums of 21 numbers in another order: a few roundings.
    np.testing.assert_allclose(pooled.mean, means.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(pooled.standard_error, means.std(axis=0, ddof=1) / np.sqrt(21), rtol=1e-12)
    np.testing.assert_array_equal(pooled.totals, means.mean(axis=2))


@pytest.mark.claim("runs-go-on")
@pytest.mark.parametrize("stop", [1, 8, 13])
def test_an_interrupted_run_goes_on_where_it_stopped(scene, traced, stop):
    def interrupt(done, total, what):
        assert (total, what) == (14, "volpath")
        if done == stop:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        volpath(scene, batches=14, progress=interrupt)
    traced.clear()
    resumed = volpath(scene, batches=14)
    assert traced == list(range(stop, 14))
    assert resumed.cached == stop
    traced.clear()
    assert_same(resumed.batches, volpath(scene, batches=14).batches)


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", ["flipped byte", "truncated", "empty", "of another seed"])
@pytest.mark.parametrize("name", ["000000-000007", "000009"])
def test_damage_is_found_counted_and_mended(scene, traced, damage, name):
    whole = volpath(scene, batches=11)
    (folder,) = cache_folder().iterdir()
    path = folder / f"{name}.npz"
    content = bytearray(path.read_bytes())
    if damage == "flipped byte":
        content[len(content) // 2] ^= 1
    elif damage == "of another seed":
        volpath(scene, batches=8, first_seed=16)
        content = bytearray((folder / ("000016-000023.npz" if "-" in name else "000008.npz")).read_bytes())
    path.write_bytes(content[: {"truncated": len(content) // 3, "empty": 0}.get(damage, len(content))])
    mended = volpath(scene, batches=11)
    assert_same(mended.batches, whole.batches)
    assert mended.damaged == 1
    assert volpath(scene, batches=11).damaged == 0


@pytest.mark.parametrize("failing", [2, 7])
def test_a_full_disk_says_what_was_kept(scene, traced, monkeypatch, failing):
    write = validation.estimates.monte_carlo.store
    stored: list[str] = []

    def full(key, arrays, spent):
        if len(stored) == failing:
            raise OSError(errno.ENOSPC, "No space left on device", "file.npz")
        stored.append(key)
        write(key, arrays, spent)

    monkeypatch.setattr(validation.estimates.monte_carlo, "store", full)
    with pytest.raises(OSError, match=f"{failing} finished batches are kept; make room") as raised:
        volpath(scene, batches=12)
    assert raised.value.filename == str(cache_folder())
    monkeypatch.setattr(validation.estimates.monte_carlo, "store", write)
    traced.clear()
    volpath(scene, batches=12)
    assert traced == list(range(failing, 12))


def test_enough_is_asked_at_the_end_of_blocks_and_sees_the_same_from_the_cache(scene, traced):
    asked = []

    def enough(batches):
        asked.append(batches)
        return len(batches.seeds) >= 16

    first = volpath(scene, batches=40, enough=enough)
    volpath(scene, batches=40)
    second = volpath(scene, batches=40, enough=enough)
    assert [len(batches.seeds) for batches in asked] == [8, 16, 8, 16]
    assert_same(asked[1], asked[3])
    assert_same(first.batches, second.batches)


@pytest.mark.claim("report-kept")
def test_a_fresh_run_traces_again_what_is_older_than_it(scene, traced):
    volpath(scene, batches=BLOCK + 1)
    traced.clear()
    with fresh_results(time.time()):
        first = volpath(scene, batches=BLOCK + 1)
        assert traced == list(range(BLOCK + 1))
        assert (first.cached, first.damaged) == (0, 0)
        assert volpath(scene, batches=BLOCK + 1).cached == BLOCK + 1


@pytest.mark.parametrize("seed", [-1, LARGEST_SEED - 1, LARGEST_SEED])
def test_seeds_out_of_range_are_refused(scene, traced, seed):
    with pytest.raises(InputError, match=rf"seed: got {seed} for 2 batches"):
        volpath(scene, batches=2, first_seed=seed)
