# SPDX-License-Identifier: BSD-3-Clause
"""Claim: the time left that a report prints is right within a factor of two, and what is kept takes none."""

import itertools

import pytest

from reference.storage.kept import Spent, fresh_results, store
from reports.machine.progress import part_of, seconds_left
from reports.report.claims import paper_parts
from reports.report.expected import PAGE_SECONDS, other_seconds, scene_seconds, shares
from reports.report.measure import _steps
from reports.report.papers import other_parts
from reports.report.scene import SceneKeys
from validation.configurations.methods import STANDARD
from validation.frames.scene_study import EFFORTS
from validation.scenes.registry import FOG_SCENES

EFFORT = EFFORTS["default"]
USED = tuple(chosen for chosen in STANDARD if "points" not in dict(chosen.parameters))  #: where no light has an extent
#: Seconds on this machine: truth, checks, multiple scattering, each method.
COSTS = {"open-fog": (1.0, 6.0, 1.0, 1.0), "hall": (20.0, 80.0, 9.0, 12.0), "windows": (4.0, 90.0, 5.0, 3.0)}
STABILITY = 40.0


def simulated():
    """Run a report on a clock of our own; return pairs of the time left that it would print and the true one [s]."""
    now, told = 0.0, []
    others = other_parts(EFFORT, list(COSTS))
    keys = {name: SceneKeys.of(name, EFFORT) for name in COSTS}
    steps = _steps(lambda share, what: told.append((now, share)), keys, USED, others)
    for name, (*parts, method) in COSTS.items():
        expected = scene_seconds(name, EFFORT.image, keys[name].named(USED), complete=True)
        inner = {part: part_of(steps[name], *share) for part, share in shares(expected).items()}
        costs = dict(zip(("truth", "agreement", "multiple"), parts)) | {each.label: method for each in USED}
        for part, seconds in costs.items():
            inner[part](0.0, part)
            now += seconds
    steps["0"](0.0, "stability")
    now += STABILITY
    return [(seconds_left(moment, share), now - moment) for moment, share in told if moment > 0]


def test_on_a_new_machine_the_time_left_is_known_within_a_factor_of_two(own_cache):
    """After a twentieth of the time. Open fog, which comes first, takes a tenth of what a hall takes: counted by scenes
    the time left began at a fifth of the truth and grew."""
    pairs = simulated()
    late = [(left, true) for left, true in pairs if 60 < true < 0.95 * pairs[0][1]]
    assert len(late) > 20
    assert all(true / 2 < left < 2 * true for left, true in late)


def test_what_is_kept_takes_no_time(own_cache):
    keys = {label: f"report-method-{number}" for number, label in enumerate(("truth", "agreement", "a", "b"))}
    unknown = scene_seconds("hall", (320, 240), keys)
    assert unknown == {"truth": 15.0, "agreement": 50.0, "a": 10.0, "b": 10.0}
    for label in ("truth", "a"):
        store(keys[label], {}, Spent(1.0, 1.0))
    # Nobody knows yet whether the scene has a use for a variant that is missing where others are kept.
    assert scene_seconds("hall", (320, 240), keys) == {"truth": 0.0, "agreement": 50.0, "a": 0.0, "b": 0.0}
    assert scene_seconds("hall", (320, 240), keys, complete=True) == unknown | {"truth": 0.0, "a": 0.0}
    assert other_seconds(keys["b"], "stability") == 20.0
    assert other_seconds(keys["a"], "stability") == 0.0
    with fresh_results(2e9):
        assert scene_seconds("hall", (320, 240), keys) == unknown


def test_every_scene_and_part_has_its_usual_time():
    from reports.report.expected import _OTHERS, _TYPICAL

    assert set(_TYPICAL) == set(FOG_SCENES)
    asked = EFFORTS["full"], list(FOG_SCENES)
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
