# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the time left that a report prints is right from the start, where this machine has made one before."""

import itertools

import pytest

from reports.machine.progress import part_of, seconds_left
from reports.report.claims import paper_parts
from reports.report.expected import PAGE_SECONDS, SceneEntries, other_seconds, scene_seconds, shares
from reports.report.measure import _steps
from reports.report.papers import other_parts
from validation.configurations.methods import STANDARD, Configuration
from validation.frames.result_cache import cache_entry, result_cache, store_result
from validation.frames.scene_study import EFFORTS
from validation.scenes.registry import FOG_SCENES

MACHINE = {"processor": "abacus", "threads": "2"}
EFFORT = EFFORTS["default"]
USED = tuple(chosen for chosen in STANDARD if "points" not in dict(chosen.parameters))  #: where no light has an extent
#: Seconds on this machine: truth, checks, multiple scattering, each method.
COSTS = {"open-fog": (1.0, 6.0, 1.0, 1.0), "hall": (20.0, 80.0, 9.0, 12.0), "windows": (4.0, 90.0, 5.0, 3.0)}
STABILITY = 40.0


@pytest.fixture
def cache(own_cache):
    return result_cache(MACHINE)


@pytest.fixture
def later(tmp_path):
    """The cache after a change of the code."""
    (tmp_path / "new.py").write_text("x = 1")
    return result_cache(MACHINE, more=[tmp_path / "new.py"])


def keep_all(cache):
    for name, (*parts, method) in COSTS.items():
        entries = SceneEntries.of(cache, name, EFFORT)
        for kind, seconds in zip(("truth", "agreement", "multiple"), parts):
            store_result(entries.part(kind), ({}, {}), seconds)
        for chosen in USED:
            store_result(entries.method(chosen), ({}, {}), method)
    store_result(cache_entry(cache, "stability", identity={"rays": EFFORT.rays}), ({}, {}), STABILITY)


def simulated(cache, *, speed=1.0):
    """Run a report on a clock of our own; return pairs of the time left that it would print and the true one [s]."""
    now, told = 0.0, []
    others = other_parts(EFFORT, list(COSTS), cache)
    steps = _steps(lambda share, what: told.append((now, share)), cache, dict.fromkeys(COSTS, EFFORT), USED, others)
    for name, (*parts, method) in COSTS.items():
        expected = scene_seconds(SceneEntries.of(cache, name, EFFORT), USED, complete=True)
        inner = {part: part_of(steps[name], *share) for part, share in shares(expected).items()}
        costs = dict(zip(("truth", "agreement", "multiple"), parts)) | {each.label: method for each in USED}
        for part, seconds in costs.items():
            inner[part](0.0, part)
            now += seconds / speed
    steps["0"](0.0, "stability")
    now += STABILITY / speed
    return [(seconds_left(moment, share), now - moment) for moment, share in told if moment > 0]


@pytest.mark.parametrize("speed", [1.0, 0.3])
def test_the_time_left_is_that_of_the_last_run_on_this_machine(cache, later, speed):
    """Also where everything now takes three times as long: within a tenth as soon as that can be known."""
    keep_all(cache)
    pairs = simulated(later, speed=speed)
    assert len(pairs) > 30
    assert pairs[0][1] > 300
    assert all(left == pytest.approx(true, rel=0.1, abs=5) for left, true in pairs)


def test_on_a_new_machine_the_time_left_is_known_within_a_factor_of_two(own_cache):
    """After a twentieth of the time. Open fog, which comes first, takes a tenth of what a hall takes: counted by scenes
    the time left began at a fifth of the truth and grew."""
    pairs = simulated(result_cache(MACHINE))
    late = [(left, true) for left, true in pairs if 60 < true < 0.95 * pairs[0][1]]
    assert len(late) > 20
    assert all(true / 2 < left < 2 * true for left, true in late)


def test_what_is_kept_takes_no_time(cache, later):
    keep_all(cache)
    entries = SceneEntries.of(cache, "hall", EFFORT)
    assert set(scene_seconds(entries, USED).values()) == {0.0}
    assert other_seconds(cache_entry(cache, "stability", identity={"rays": EFFORT.rays}), "stability") == 0.0
    assert sum(scene_seconds(SceneEntries.of(later, "hall", EFFORT), USED).values()) > 200


def test_a_variant_that_a_scene_never_needed_takes_no_time_until_it_is_known_to_be_measured(cache):
    keep_all(cache)
    entries, new = SceneEntries.of(cache, "hall", EFFORT), Configuration("ray-march", None, (("steps", 7),))
    assert scene_seconds(entries, [*USED, new])[new.label] == 0.0
    assert scene_seconds(entries, [*USED, new], complete=True)[new.label] > 0.0


def test_a_scene_of_the_users_own_may_have_changed(cache, tmp_path):
    entries = SceneEntries.of(cache, str(tmp_path / "mine.xml"), EFFORT)
    store_result(entries.part("truth", {"scene": "0a"}), ({}, {}), 7.0)
    assert scene_seconds(entries, ())["truth"] == 7.0


def test_every_scene_and_part_has_its_usual_time():
    from reports.report.expected import _OTHERS, _TYPICAL

    assert set(_TYPICAL) == set(FOG_SCENES)
    asked = EFFORTS["full"], list(FOG_SCENES), result_cache(MACHINE)
    full = {part.kind for part in (*other_parts(*asked), *paper_parts(*asked))}
    assert full == set(_OTHERS)
    assert PAGE_SECONDS > 0


def test_shares_are_those_of_the_time():
    parts = shares({"a": 1.0, "b": 2.0, "c": 0.0, "d": 1.0})
    assert parts["b"] == pytest.approx((0.25, 0.75), abs=0.01)
    assert parts["c"][1] - parts["c"][0] < 0.01
    bounds = list(parts.values())
    assert (bounds[0][0], bounds[-1][1]) == (0.0, 1.0)
    assert all(first[1] == second[0] for first, second in itertools.pairwise(bounds))
