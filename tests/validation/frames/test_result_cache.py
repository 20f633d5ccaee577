# SPDX-License-Identifier: BSD-3-Clause
import json
from pathlib import Path

import numpy as np
import pytest

from validation.frames.result_cache import (
    cache_entry,
    cached_result,
    expected_seconds,
    load_result,
    own_sources,
    result_cache,
    source_digest,
    store_result,
)

ROOT = Path(__file__).resolve().parents[3]
MACHINE = {"processor": "abacus", "threads": "2"}
IDENTITY = {"scene": "x", "size": (4, 3)}


def place(cache=None, **made_from):
    made_from = {"scene": "0a"} | made_from
    return cache_entry(cache or result_cache(MACHINE), "method", identity=IDENTITY, fingerprint=made_from)


def compute(calls):
    def computed():
        calls.append(1)
        return {"error": 0.1 * 3, "none": None, "pair": (1, 2)}, {"exr": b"\x00light\xff", "picture": b""}

    return computed


def test_what_was_computed_is_found_again(own_cache):
    calls = []
    first, second = (cached_result(place(), compute(calls)) for _ in range(2))
    assert len(calls) == 1
    assert (first.cached, second.cached) == (False, True)
    assert first.data == second.data == {"error": 0.1 * 3, "none": None, "pair": [1, 2]}
    assert second.files == {"exr": b"\x00light\xff", "picture": b""}
    assert (first.measured, first.seconds) == (second.measured, second.seconds)


@pytest.mark.claim("report-kept")
@pytest.mark.parametrize("change", ["scene", "source", "versions", "machine", "fresh"])
def test_what_was_made_from_something_else_is_computed_again(own_cache, monkeypatch, tmp_path, change):
    calls = []
    cached_result(place(), compute(calls))
    common = result_cache(MACHINE)
    made_from = {}
    if change == "scene":
        made_from = {"scene": "0b"}
    if change == "source":
        (tmp_path / "page.py").write_text("x = 1")
        common = result_cache(MACHINE, more=[tmp_path / "page.py"])
    if change == "versions":
        monkeypatch.setattr("importlib.metadata.version", lambda name: "99")
        common = result_cache(MACHINE)
    if change == "machine":
        common = result_cache(MACHINE | {"threads": "64"})
    if change == "fresh":
        common = result_cache(MACHINE, fresh=True)
    assert load_result(place(common, **made_from)) is None
    assert not cached_result(place(common, **made_from), compute(calls)).cached
    assert len(calls) == 2


def test_a_new_result_replaces_the_old_one_and_another_machine_has_its_own(own_cache):
    def files():
        return list(own_cache.rglob("*.npz"))

    cached_result(place(), compute([]))
    cached_result(place(scene="0b"), compute([]))
    assert len(files()) == 1
    cached_result(place(result_cache(MACHINE | {"threads": "64"})), compute([]))
    assert len(files()) == 2


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", ["cut", "flipped", "foreign"])
def test_a_damaged_entry_counts_as_none_and_is_replaced(own_cache, damage):
    cached_result(place(), compute([]))
    (path,) = own_cache.rglob("*.npz")
    content = path.read_bytes()
    middle = content.index(b"light")
    damaged = {
        "cut": content[:-200],
        "flipped": content[:middle] + b"L" + content[middle + 1 :],
        "foreign": b"no archive",
    }[damage]
    path.write_bytes(damaged)
    assert load_result(place()) is None
    calls = []
    cached_result(place(), compute(calls))
    assert len(calls) == 1
    assert load_result(place()).files["exr"] == b"\x00light\xff"


def test_what_is_not_a_number_is_not_kept(own_cache):
    """A report may not hold it: better said where it comes from."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        store_result(place(), ({"error": float("nan")}, {}), 0.0)
    assert load_result(place()) is None


def test_an_exception_leaves_nothing(own_cache):
    def fails():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        cached_result(place(), fails)
    assert load_result(place()) is None


def test_source_is_digested_by_content_and_name(tmp_path):
    first, second = tmp_path / "one.py", tmp_path / "two.py"
    first.write_text("x = 1\n")
    second.write_text("x = 1\n")
    assert source_digest([first]) != source_digest([second])
    before = source_digest([first, second])
    assert source_digest([second, first]) == before
    second.write_text("x = 2\n")
    assert source_digest([first, second]) != before


def test_every_side_that_computes_is_part_of_the_source():
    names = {path.relative_to(ROOT).as_posix() for path in own_sources()}
    assert {
        "analytic/panels.py",
        "realtime/frame/renderer.py",
        "reference/quadrature/image.py",
        "validation/frames/benchmark.py",
    } <= names
    assert not any(name.startswith("reports/") for name in names)


def test_large_files_come_back_whole(own_cache):
    content = np.random.default_rng(3).bytes(1_000_003)
    store_result(place(), ({}, {"exr": content}), 0.0)
    assert load_result(place()).files["exr"] == content
    assert json.dumps(load_result(place()).data) == "{}"


def test_a_result_takes_no_time_where_it_is_kept_and_else_what_it_took_last(own_cache, tmp_path):
    assert expected_seconds(place()) is None
    store_result(place(), ({}, {"exr": bytes(9)}), 12.5)
    assert expected_seconds(place()) == 0.0
    assert expected_seconds(place(scene="unknown")) == 0.0  # whose content is known when it is loaded
    (tmp_path / "page.py").write_text("x = 1")
    changed = result_cache(MACHINE, more=[tmp_path / "page.py"])
    assert expected_seconds(place(changed)) == 12.5
    assert expected_seconds(place(result_cache(MACHINE, fresh=True))) == 12.5
    assert expected_seconds(place(result_cache(MACHINE | {"threads": "64"}))) is None
    (path,) = own_cache.rglob("*.npz")
    path.write_bytes(path.read_bytes()[:100])
    assert expected_seconds(place()) is None


def test_keeping_a_result_makes_room_for_it(own_cache, monkeypatch):
    def entry(number):
        return cache_entry(result_cache(MACHINE), "method", identity={"number": number})

    monkeypatch.setenv("AIRLIGHT_CACHE_SIZE", "25kB")
    for number in range(5):
        store_result(entry(number), ({}, {"exr": bytes(10_000)}), 1.0)
    assert [load_result(entry(number)) is not None for number in range(5)] == [False, False, True, True, True]
