# SPDX-License-Identifier: BSD-3-Clause
"""Batches through the cache, merged or alone: the same numbers, nothing lost by an
interruption; when runs end.
"""

import errno
import time
from dataclasses import fields
from types import SimpleNamespace

import mitsuba as mi
import numpy as np
import pytest

import airlight.validation.estimates.images
import airlight.validation.estimates.monte_carlo
from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.reference.monte_carlo.batches import Batches, single_batch
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.quadrature.surface import surface_hits
from airlight.reference.scene.read import read_reference
from airlight.reference.storage.cache import cache_folder
from airlight.reference.storage.exr import Image
from airlight.reference.storage.store import fresh_results
from airlight.validation.estimates.agreement import MASK_PIXELS, pixel_angle
from airlight.validation.estimates.images import (
    Budget,
    batch_plan,
    cloud_orders,
    monte_carlo_reference,
    near_light,
    relative_errors,
)
from airlight.validation.estimates.merge import merged_references
from airlight.validation.estimates.monte_carlo import BLOCK, monte_carlo_batches
from airlight.validation.scenes.loading import LoadedScene, load_scene
from tests.helpers.scenes import tiny_scene


@pytest.fixture
def scene(variant):
    return mi.load_dict(tiny_scene(size=(4, 3)))


@pytest.fixture
def traced(monkeypatch, own_cache):
    """Put random numbers in the place of the tracer, and list the seeds that were asked for."""
    seeds = []

    def trace(reference, seed, samples, *, max_depth=2, counts=None):
        seeds.append(seed)
        mean = np.random.default_rng([seed, samples, max_depth]).exponential(size=(2, 12, 3))
        return single_batch(seed, samples, mean)

    monkeypatch.setattr(airlight.validation.estimates.monte_carlo, "volpath_batch", trace)
    return seeds


def volpath(scene, **options):
    return monte_carlo_batches(scene, "volpath", **({"samples": 4} | options))


def assert_same(actual, expected):
    for field in fields(Batches):
        np.testing.assert_array_equal(
            getattr(actual, field.name), getattr(expected, field.name), err_msg=field.name
        )
        assert type(getattr(actual, field.name)) is type(getattr(expected, field.name))


@pytest.mark.claim("runs-go-on", tolerance="none: equal")
@pytest.mark.parametrize(("first", "count"), [(0, 2), (0, 21), (5, 3), (5, 20)])
def test_the_cache_never_changes_what_is_returned(
    scene, traced, monkeypatch, tmp_path, first, count
):
    """A run from an empty cache, a second one, and one from a cache that holds more on
    both sides: the same bits.
    """
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
        [
            airlight.validation.estimates.monte_carlo.volpath_batch(
                read_reference(scene), seed, 4
            ).mean
            for seed in range(5, 26)
        ]
    )
    # Sums of 21 numbers in another order: a few roundings.
    np.testing.assert_allclose(pooled.mean, means.mean(axis=0), rtol=1e-13)
    np.testing.assert_allclose(
        pooled.standard_error, means.std(axis=0, ddof=1) / np.sqrt(21), rtol=1e-12
    )
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


def test_batches_that_workers_bring_are_told_once(scene, traced):
    """Those of earlier rounds were counted again in each: 33 of 40 were told for the 17th."""
    trace = airlight.validation.estimates.monte_carlo.volpath_batch

    def bring(seeds):
        return ((trace(None, seed, 4), Spent()) for seed in seeds)

    told = []
    for batches in (40, 48):  # from an empty cache, and from one that has the first
        run = volpath(
            scene,
            batches=batches,
            elsewhere=(bring, 16),
            progress=lambda done, total, what: told.append(done),
        )
        assert len(run.batches.seeds) == batches
    assert told == list(range(1, 49))


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", ["flipped byte", "truncated", "empty", "of another seed"])
@pytest.mark.parametrize("name", ["000000-000007", "000009"])
def test_damage_is_found_counted_and_repaired(scene, traced, damage, name):
    whole = volpath(scene, batches=11)
    (folder,) = cache_folder().iterdir()
    path = folder / f"{name}.npz"
    content = bytearray(path.read_bytes())
    if damage == "flipped byte":
        content[len(content) // 2] ^= 1
    elif damage == "of another seed":
        volpath(scene, batches=8, first_seed=16)
        content = bytearray(
            (folder / ("000016-000023.npz" if "-" in name else "000008.npz")).read_bytes()
        )
    path.write_bytes(
        content[: {"truncated": len(content) // 3, "empty": 0}.get(damage, len(content))]
    )
    repaired = volpath(scene, batches=11)
    assert_same(repaired.batches, whole.batches)
    assert repaired.damaged == 1
    assert volpath(scene, batches=11).damaged == 0


@pytest.mark.parametrize("failing", [2, 7])
def test_a_full_disk_says_what_was_kept(scene, traced, monkeypatch, failing):
    write = airlight.validation.estimates.monte_carlo.store
    stored: list[str] = []

    def full(key, arrays, spent):
        if len(stored) == failing:
            raise OSError(errno.ENOSPC, "No space left on device", "file.npz")
        stored.append(key)
        write(key, arrays, spent)

    monkeypatch.setattr(airlight.validation.estimates.monte_carlo, "store", full)
    with pytest.raises(OSError, match=f"{failing} finished batches are kept; make room") as raised:
        volpath(scene, batches=12)
    assert raised.value.filename == str(cache_folder())
    monkeypatch.setattr(airlight.validation.estimates.monte_carlo, "store", write)
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


@pytest.mark.parametrize("budget", [{"error": 0.1}, {"seconds": 1.0}, {"samples": 2}])
def test_the_last_seeds_are_refused_by_name(scene, budget):
    """A run to an error from the last seed on had one batch: a traceback of a ValueError."""
    with pytest.raises(InputError, match="seed: got 1048575 for 2 batches"):
        monte_carlo_reference(
            LoadedScene("fog", scene, "", ""),
            "volpath",
            budget=Budget(**budget),
            seed=(1 << 20) - 1,
        )


SHAPE = (3, 4, 3)


def batch_means(seeds):
    """Random batch means, the same for a seed in every file, (batches, 2, height, width, 3)."""
    return np.stack([np.random.default_rng(seed).exponential(size=(2, *SHAPE)) for seed in seeds])


def header(seeds, words):
    return {
        "airlight:scene": "fog",
        "airlight:scene_digest": "ab12",
        "airlight:estimator": "volpath",
        "airlight:spp": 16 * len(seeds),
        "airlight:batch_spp": 16,
        "airlight:batches": len(seeds),
        "airlight:seed": min(seeds),
        "airlight:seeds": words,
        "airlight:version:mitsuba": "3.9.1",
    }


def reference(numbers, words, **changes):
    means = batch_means(numbers)
    layers = {}
    for number, name in enumerate(("airlight", "surface")):
        layers[name] = means[:, number].mean(axis=0)
        layers[f"{name}_se"] = means[:, number].std(axis=0, ddof=1) / np.sqrt(len(numbers))
    own = {f"airlight:{name.replace('__', ':')}": value for name, value in changes.items()}
    return Image(layers, np.full(SHAPE[:2], 7.0), header(numbers, words) | own)


A, B, C = (range(4), "0-3"), ((4, 5, 9), "4-5,9"), ((6, 7, 8, 10, 11), "6-8,10-11")


@pytest.mark.claim("merge")
def test_merged_moments_are_those_of_all_batches():
    merged = merged_references([(words, reference(seeds, words)) for seeds, words in (A, B, C)])
    means = batch_means(range(12))
    for number, name in enumerate(("airlight", "surface")):
        np.testing.assert_allclose(merged.layers[name], means[:, number].mean(axis=0), rtol=1e-13)
        error = means[:, number].std(axis=0, ddof=1) / np.sqrt(12)
        np.testing.assert_allclose(merged.layers[f"{name}_se"], error, rtol=1e-12)
    expected = {
        "spp": 192,
        "batches": 12,
        "seed": 0,
        "seeds": "0-11",
        "merged": 3,
        "estimator": "volpath",
    }
    assert {name: merged.attributes[f"airlight:{name}"] for name in expected} == expected


@pytest.mark.claim("merge")
@pytest.mark.parametrize(
    ("changes", "words"),
    [
        (
            {"scene_digest": "cd34"},
            r"a.exr and b.exr differ in the scene or its size \(ab12 and cd34\)",
        ),
        (
            {"estimator": "single-scatter"},
            r"differ in the estimator \(volpath and single-scatter\)",
        ),
        (
            {"seeds": "3-5"},
            "a.exr and b.exr share the seeds 3; compute one of them again with another --seed",
        ),
        ({"seeds": "4-9"}, "b.exr: its header names 6 seeds and 3 batches"),
        ({"batch_spp": "few"}, "b.exr: its header names few samples a pixel of a batch; expected"),
        (
            {"seeds": ""},
            "b.exr is no Monte Carlo reference of `airlight reference`: it lacks seeds",
        ),
    ],
)
def test_files_that_do_not_go_together_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        merged_references([("a.exr", reference(*A)), ("b.exr", reference(*B, **changes))])


@pytest.mark.parametrize("samples", [1, 2, 31, 64, 100, 1024, 2048, 4096, 8193, 100_000])
def test_samples_are_split_into_batches_that_have_at_least_as_many(samples):
    batches, each = batch_plan(Budget(samples=samples), 100)
    assert batches >= min(32, max(2, samples))  # 32 give a standard error that is known to 13 %
    assert each in (1, 2, 4, 8, 16, 32, 64)
    # Never less than asked for, and not a whole batch more, but for the two
    # that a standard error needs.
    assert samples <= batches * each < samples + max(each, 2)


def batches(mean, error, count=4):
    mean, error = np.asarray(mean, float), np.asarray(error, float)
    return Batches(
        tuple(range(count)), 1, mean, error**2 * count * (count - 1), np.zeros((count, 2, 3))
    )


def test_errors_by_hand():
    """Two pixels; each channel of each layer has its own error, and the largest counts."""
    airlight = [[1.0, 2.0, 1.0], [3.0, 2.0, 1.0]]
    # red: sqrt(0.09 + 0.16)/4; the worst is 0.3 of 1
    airlight_error = [[0.3, 0.0, 0.0], [0.4, 0.0, 0.0]]
    surface = [[5.0, 5.0, 5.0], [0.0, 5.0, 5.0]]
    surface_error = [[0.5, 0.0, 0.0], [0.0, 0.0, 0.5]]  # 0.5 of 5 and of 10
    traced = batches([airlight, surface], [airlight_error, surface_error])
    errors = relative_errors(traced, np.zeros(2, dtype=bool))
    assert errors.pooled == pytest.approx(0.125, rel=1e-12)
    assert errors.worst == pytest.approx(0.3, rel=1e-12)
    # Without the first pixel of the airlight: 0.4/3 pooled and worst.
    errors = relative_errors(traced, np.array([True, False]))
    assert (errors.pooled, errors.worst) == pytest.approx((0.4 / 3, 0.4 / 3), rel=1e-12)


@pytest.mark.claim("pixels-beside-a-light")
def test_pixels_beside_a_light_are_those_that_the_reference_names(variant):
    """The same pixels as from the quadrature's own angles; a light in view, one
    behind us, one in the sphere.
    """
    behind = {"type": "point", "position": [0.3, -6.0, 1.1]}
    hidden = {"type": "point", "position": [0.1, 0.3, 0.65]}
    scene = mi.load_dict(tiny_scene(size=(40, 30), behind=behind, hidden=hidden))
    reference = read_reference(scene)
    expected = reference_image(scene, checks=2).light_angle <= MASK_PIXELS * pixel_angle(reference)
    assert 0 < expected.sum() < 40
    np.testing.assert_array_equal(
        near_light(reference, surface_hits(reference).distance), expected.ravel()
    )


@pytest.mark.parametrize("odd", [np.nan, np.inf])
@pytest.mark.parametrize("layer", [0, 1])
def test_no_target_is_met_by_what_is_no_number(odd, layer):
    """A mean of NaN with a standard error of 0 ended a run at once."""
    mean = np.ones((2, 4, 3))
    mean[layer, 2] = odd
    batches = Batches(tuple(range(32)), 1, mean, np.zeros_like(mean), np.ones((32, 2, 3)))
    errors = relative_errors(batches, np.zeros(4, dtype=bool))
    assert (errors.pooled, errors.worst) == (None, None)
    assert errors.unknown is not None


def test_an_error_of_no_pixel_is_not_zero():
    """All airlight beside a light, lit or not the surface, or no light at all:
    nothing is known of the error.
    """
    lit, dark = np.ones((4, 3)), np.zeros((4, 3))
    some = np.array([True, True, False, False])
    beside = lit * some[:, None]  # lit only where pixels are left out
    cases = [
        (lit, dark, ~np.zeros(4, bool)),
        (lit, lit, ~np.zeros(4, bool)),
        (beside, lit, some),
        (dark, dark, ~some),
    ]
    for fog, surface, near in cases:
        errors = relative_errors(batches([fog, surface], [0.1 * fog, 0.1 * surface]), near)
        assert (errors.pooled, errors.worst) == (None, None)
    # A layer that is dark everywhere takes nothing from what is known of the other.
    errors = relative_errors(batches([lit, dark], [0.1 * lit, dark]), some)
    assert (errors.pooled, errors.worst) == pytest.approx((0.1 / np.sqrt(2), 0.1))


@pytest.fixture
def clock(monkeypatch):
    """A clock of our own; `clock.now` is what it shows [s]."""
    clock = SimpleNamespace(now=50.0, process_time=lambda: 0.0, perf_counter=lambda: clock.now)
    monkeypatch.setattr("airlight.analytic.clock.time", clock)
    return clock


@pytest.fixture
def loaded(variant, monkeypatch, own_cache, clock):
    """A scene whose batches are random numbers of relative deviation
    0.4, and take a second each.
    """

    import airlight.validation.estimates.monte_carlo

    def trace(reference, seed, samples, **options):
        clock.now += 1.0
        mean = np.random.default_rng(seed).normal(1.0, 0.4, (2, 12, 3))
        return single_batch(seed, samples, mean)

    monkeypatch.setattr(airlight.validation.estimates.monte_carlo, "volpath_batch", trace)
    # behind the camera: no pixel is left out
    lamp = {"type": "point", "position": [0.3, -9.0, 1.1]}
    return LoadedScene("tiny", mi.load_dict(tiny_scene(size=(4, 3), lamp=lamp)), "", "")


def run(loaded, budget):
    told = []
    reference = monte_carlo_reference(
        loaded, "volpath", budget=budget, progress=lambda *args: told.append(args)
    )
    return reference, told


def test_progress_shows_the_error_falling_to_its_target(loaded):
    # One batch has the pooled error 0.4/sqrt(12) = 0.115, K batches
    # 0.115/sqrt(K): some 133 for 0.01.
    reference, told = run(loaded, Budget(error=0.01))
    batches = reference.image.attributes["airlight:batches"]
    assert reference.reached
    assert 100 < batches < 200
    assert batches % 8 == 0
    fractions = [fraction for fraction, _ in told]
    assert fractions[:8] == [0.0] * 8  # nothing is known of the error yet
    # The fraction follows the estimate of the error, whose square is known to some 20 % by then.
    assert fractions[batches // 2] == pytest.approx(0.5, abs=0.15)
    assert 0.85 < fractions[-1] < 1
    errors = [float(what.split()[5]) for _, what in told[8:]]
    assert errors[0] > 2 * errors[-1]
    assert told[-1][1].startswith(f"volpath, {batches} batches, pooled error 0.01")
    assert told[-1][1].endswith(" of 0.01")


@pytest.mark.claim("targets-of-a-run")
def test_no_run_stops_on_a_target_before_its_error_is_known(loaded):
    reference, _ = run(loaded, Budget(error=0.5))
    assert reference.image.attributes["airlight:batches"] == 32


@pytest.mark.claim("targets-of-a-run")
def test_a_run_whose_error_is_not_known_ends_and_reaches_nothing(loaded, monkeypatch):
    monkeypatch.setattr(
        airlight.validation.estimates.images,
        "near_light",
        lambda reference, distance: np.ones(12, dtype=bool),
    )
    reference, _ = run(loaded, Budget(error=0.5))
    assert (reference.image.attributes["airlight:batches"], reference.reached) == (32, False)


@pytest.mark.claim("targets-of-a-run")
def test_time_budget_never_starts_a_batch_that_would_end_too_late(loaded):
    reference, told = run(loaded, Budget(seconds=10.5))
    assert reference.image.attributes["airlight:batches"] == 10
    assert [fraction for fraction, _ in told] == pytest.approx([n / 10.5 for n in range(1, 11)])
    assert reference.reached is None
    again, told = run(loaded, Budget(seconds=3.2))
    # Cached batches cost no time.
    assert (again.cached, again.image.attributes["airlight:batches"]) == (10, 13)
    assert len(told) == 3


def test_sets_are_disjoint():
    assert cloud_orders("1, 2,3-4,5-inf") == ("1", "2", "3-4", "5-inf")
    assert cloud_orders("sets")[-1] == "31-inf"
    assert cloud_orders("all") == ()
    with pytest.raises(InputError, match="names order 3 twice"):
        cloud_orders("1-3,3-4")
    with pytest.raises(InputError, match="expected for example"):
        cloud_orders("many")


def test_a_reference_has_the_layers_and_is_kept(variant, tmp_path, monkeypatch):
    monkeypatch.setenv("AIRLIGHT_CACHE_DIR", str(tmp_path))
    loaded = load_scene("ring", (8, 6))
    orders = cloud_orders("1,2-inf")
    first = monte_carlo_reference(loaded, "cloud-paths", budget=Budget(samples=64), orders=orders)
    again = monte_carlo_reference(loaded, "cloud-paths", budget=Budget(samples=64), orders=orders)
    assert (first.cached, again.cached) == (0, 32)
    layers = first.image.layers
    sampled = ("airlight", "surface", "airlight_1", "airlight_2_inf", "surface_straight")
    assert set(layers) == {name + end for name in sampled for end in ("", "_se")} | {
        "opacity",
        "background",
    }
    for name, values in layers.items():
        np.testing.assert_array_equal(values, again.image.layers[name])
    np.testing.assert_allclose(
        layers["airlight"], layers["airlight_1"] + layers["airlight_2_inf"], rtol=1e-5, atol=1e-9
    )
    clear = layers["opacity"] == 0
    assert clear.any()
    assert not layers["airlight"][clear].any()
    assert (layers["airlight"][~clear] > 0).any()
