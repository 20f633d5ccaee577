# SPDX-License-Identifier: BSD-3-Clause
import json
from pathlib import Path

import numpy as np
import pytest

from validation.frames.result_cache import find_kept, keep, keeper, kept_result, own_sources, slot, source_digest

MACHINE = {"processor": "abacus", "threads": "2"}
IDENTITY = {"scene": "x", "size": (4, 3)}


def place(common=None, **made_from):
    return slot(common or keeper(MACHINE), "method", identity=IDENTITY, fingerprint={"scene": "0a"} | made_from)


def compute(calls):
    def computed():
        calls.append(1)
        return {"error": 0.1 * 3, "none": None, "pair": (1, 2)}, {"exr": b"\x00light\xff", "picture": b""}

    return computed


def test_what_was_computed_is_found_again(own_cache):
    calls = []
    first, second = (kept_result(place(), compute(calls)) for _ in range(2))
    assert len(calls) == 1
    assert (first.cached, second.cached) == (False, True)
    assert first.data == second.data == {"error": 0.1 * 3, "none": None, "pair": [1, 2]}
    assert second.files == {"exr": b"\x00light\xff", "picture": b""}
    assert (first.measured, first.seconds) == (second.measured, second.seconds)


@pytest.mark.claim("report-kept")
@pytest.mark.parametrize("change", ["scene", "source", "versions", "machine", "fresh"])
def test_what_was_made_from_something_else_is_computed_again(own_cache, monkeypatch, tmp_path, change):
    calls = []
    kept_result(place(), compute(calls))
    common = keeper(MACHINE)
    made_from = {}
    if change == "scene":
        made_from = {"scene": "0b"}
    if change == "source":
        (tmp_path / "page.py").write_text("x = 1")
        common = keeper(MACHINE, more=[tmp_path / "page.py"])
    if change == "versions":
        monkeypatch.setattr("importlib.metadata.version", lambda name: "99")
        common = keeper(MACHINE)
    if change == "machine":
        common = keeper(MACHINE | {"threads": "64"})
    if change == "fresh":
        common = keeper(MACHINE, fresh=True)
    assert find_kept(place(common, **made_from)) is None
    assert not kept_result(place(common, **made_from), compute(calls)).cached
    assert len(calls) == 2


def test_a_new_result_replaces_the_old_one_and_another_machine_has_its_own(own_cache):
    def files():
        return list(own_cache.rglob("*.npz"))

    kept_result(place(), compute([]))
    kept_result(place(scene="0b"), compute([]))
    assert len(files()) == 1
    kept_result(place(keeper(MACHINE | {"threads": "64"})), compute([]))
    assert len(files()) == 2


@pytest.mark.claim("damaged-cache")
@pytest.mark.parametrize("damage", ["cut", "flipped", "foreign"])
def test_a_damaged_entry_counts_as_none_and_is_replaced(own_cache, damage):
    kept_result(place(), compute([]))
    (path,) = own_cache.rglob("*.npz")
    content = path.read_bytes()
    middle = content.index(b"light")
    damaged = {
        "cut": content[:-200],
        "flipped": content[:middle] + b"L" + content[middle + 1 :],
        "foreign": b"no archive",
    }[damage]
    path.write_bytes(damaged)
    assert find_kept(place()) is None
    calls = []
    kept_result(place(), compute(calls))
    assert len(calls) == 1
    assert find_kept(place()).files["exr"] == b"\x00light\xff"


def test_what_is_not_a_number_is_not_kept(own_cache):
    """A report may not hold it: better said where it comes from."""
    with pytest.raises(ValueError, match="not JSON compliant"):
        keep(place(), ({"error": float("nan")}, {}), 0.0)
    assert find_kept(place()) is None


def test_an_exception_leaves_nothing(own_cache):
    def fails():
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        kept_result(place(), fails)
    assert find_kept(place()) is None


def test_source_is_digested_by_content_and_name(tmp_path):
    one, two = tmp_path / "one.py", tmp_path / "two.py"
    one.write_text("x = 1\n")
    two.write_text("x = 1\n")
    assert source_digest([one]) != source_digest([two])
    before = source_digest([one, two])
    assert source_digest([two, one]) == before
    two.write_text("x = 2\n")
    assert source_digest([one, two]) != before


def test_every_side_that_computes_is_part_of_the_source():
    root = Path(__file__).parents[3]
    names = {path.relative_to(root).as_posix() for path in own_sources()}
    assert {
        "analytic/integral.py",
        "realtime/frame/renderer.py",
        "reference/quadrature/image.py",
        "validation/frames/benchmark.py",
    } <= names
    assert not any(name.startswith("reports/") for name in names)


def test_large_files_come_back_whole(own_cache):
    content = np.random.default_rng(3).bytes(1_000_003)
    keep(place(), ({}, {"exr": content}), 0.0)
    assert find_kept(place()).files["exr"] == content
    assert json.dumps(find_kept(place()).data) == "{}"
