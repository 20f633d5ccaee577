# SPDX-License-Identifier: BSD-3-Clause
"""Claim: times that are compared are of one run, in turns; an anchor says whether the
machine changed meanwhile.
"""

import mitsuba as mi
import numpy as np
import pytest

from airlight.analytic.clock import Spent
from airlight.errors import InputError
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.clock import Piece, in_turns, time_in_turns, time_repeated, timing_of
from airlight.validation.study import turns as module
from airlight.validation.study.configuration import configuration
from airlight.validation.study.study import Cell, Measure
from airlight.validation.study.turns import time_cells, time_frame
from airlight.validation.timing import ANCHORS, anchored
from tests.helpers.scenes import tiny_scene


@pytest.mark.claim("times-are-medians", tolerance="rounding")
def test_times_are_medians_and_quartiles_without_the_warm_up(clock):
    timing = time_repeated(clock.work("a", 300, 300, 1, 2, 300, 4, 5), seconds=0.0, least=5, most=5)
    assert len(clock.calls) == 7
    assert (timing.low_ms, timing.median_ms, timing.high_ms) == pytest.approx((2, 4, 5))
    assert timing.cpu_ms == pytest.approx(2)  # the least, of two processors
    assert time_repeated(clock.work("b", 1), seconds=10.0, most=17).repetitions == 17
    assert time_repeated(clock.work("c", 1), seconds=0.0, least=3).repetitions == 3


def test_works_are_timed_in_turns(clock):
    slow, fast = time_in_turns(
        [clock.work("slow", 20), clock.work("fast", 5)], seconds=0.0, least=5
    )
    assert clock.calls == ["slow", "fast"] * 7  # two turns of warm-up
    assert (slow.repetitions, fast.repetitions) == (5, 5)
    assert (slow.median_ms, fast.median_ms) == pytest.approx((20, 5))


def test_a_piece_that_takes_part_in_few_rounds_has_them_evenly(clock):
    pieces = [Piece(clock.work("fast", 1), 0.0), Piece(clock.work("slow", 9), 0.0, rounds=2)]
    fast, slow = in_turns(pieces, rounds=5)
    assert clock.calls == ["fast", "fast", "fast", "slow", "fast", "fast", "slow"]
    assert (len(fast), len(slow)) == (5, 2)


def test_a_piece_is_repeated_in_its_turn_for_its_part_of_the_time(clock):
    (rounds,) = in_turns([Piece(clock.work("a", 10), 0.19)], rounds=4, most=200)
    assert [len(each) for each in rounds] == [5, 5, 5, 5]
    (rounds,) = in_turns([Piece(clock.work("a", 10), 10.0)], rounds=4, most=6)
    assert [len(each) for each in rounds] == [1, 2, 1, 2]


@pytest.mark.claim("times-of-one-run")
def test_a_machine_that_gets_slower_changes_no_ratio_and_the_anchor_says_so(clock):
    """From the middle on all takes three times as long: of two works one after the
    other one would seem slower.
    """
    clock.pace = lambda now: 1.0 if now < 1.0 else 3.0
    first, second = time_in_turns(
        [clock.work("a", 20), clock.work("b", 40)], seconds=2.4, least=4, warm_up=0
    )
    assert second.median_ms / first.median_ms == pytest.approx(2, rel=0.1)


def ends(rng, scale, repetitions=ANCHORS, spread=0.02):
    """Times of an anchor at the ends of rounds, which scatter by the normal law about `scale`."""
    scatter = 1 + spread * rng.standard_normal((len(scale), repetitions))
    return [
        timing_of([Spent(1e-3 * ms) for ms in each])
        for each in scatter * np.asarray(scale)[:, None]
    ]


@pytest.mark.claim("times-of-one-run", tolerance="99 % of quiet runs are called steady")
def test_a_machine_that_does_not_change_is_called_steady():
    rng = np.random.default_rng(20261128)
    runs = [ends(rng, np.full(10, 3.1)) for _ in range(400)]
    steady = [anchored("", 5, each, each[0]).steady for each in runs]
    # Four standard errors of a fraction of 1 % of 400.
    assert np.mean(steady) > 0.99 - 4 * np.sqrt(0.01 / 400)


@pytest.mark.claim("times-of-one-run")
@pytest.mark.parametrize("slower", [1.1, 2.5])
def test_a_change_beyond_the_quartiles_is_said(slower):
    rng = np.random.default_rng(20261128)
    run = anchored(
        "", 5, ends(rng, np.repeat([3.1, slower * 3.1], (7, 3))), timing_of([Spent(3.1e-3)])
    )
    assert run.steady is False
    assert run.between == pytest.approx(slower, rel=0.03)
    assert run.within < 1.06


@pytest.fixture(scope="module")
def scene(variant):
    return read_scene(mi.load_dict(tiny_scene(size=(16, 12))))


BRIEF = Measure("stages", 0.001)


@pytest.mark.parametrize(("spent", "turns"), [(0.0, 1), (1e6, 5)])
def test_a_slow_frame_is_timed_a_few_times(scene, monkeypatch, spent, turns):
    """A frame that takes minutes must not be rendered thirty times."""
    monkeypatch.setattr(module, "_PATIENCE", spent)
    renderer = frame_renderer(scene, METHODS["ray-march"], steps=3)
    times = time_frame(renderer, seconds=0.0, slow=-1.0)
    assert {each.repetitions for each in times.measured.values()} == {turns}
    assert len(times.measured) == 7
    assert all(
        0 < each.low_ms <= each.median_ms <= each.high_ms for each in times.measured.values()
    )
    assert times.frame.median_ms <= times.light_moved.median_ms <= times.objects_moved.median_ms
    assert times.colours_changed.median_ms <= times.light_moved_camera_cached.median_ms
    if turns == 1:
        assert times.frame.median_ms == pytest.approx(
            times.surface.median_ms + times.airlight.median_ms
        )


@pytest.mark.claim("times-of-one-run")
def test_methods_take_turns_and_one_that_fails_in_a_turn_is_lost_alone(scene, monkeypatch):
    names = ("unshadowed", "ray-march", "min-max")
    cells = [Cell("tiny", (16, 12), (), configuration(name), BRIEF) for name in names]
    order, turn = [], module.whole_turn

    def failing(renderer):
        real, name = turn(renderer), renderer.method.name

        def each():
            order.append(name)
            if name == "ray-march" and order.count(name) == 3:
                raise InputError("method ray-march: gave up")
            return real()

        return each

    monkeypatch.setattr(module, "whole_turn", failing)
    # a method that is slow beside other work is warmed up, and has all rounds
    for name in ("_PATIENCE", "_RECORDED"):
        monkeypatch.setattr(module, name, np.inf)
    found = time_cells([*cells, None], lambda cell: scene)
    first, lost, last, nothing = found
    assert lost.times is None
    assert lost.lost == "method ray-march: gave up"
    assert nothing == module.CellTimes()
    assert first.times.run == last.times.run
    assert first.times.run.rounds == 5
    warm_up = len(names)
    assert order[:warm_up] == list(names)  # all compile before the first is timed
    changes = sum(before != after for before, after in zip(order[warm_up:], order[warm_up + 1 :]))
    assert changes >= 2 * 5 - 1  # in each round both take their turns


@pytest.mark.claim("times-of-one-run")
def test_a_method_of_the_user_takes_its_turns_in_its_process(variant, tmp_path):
    from airlight.reports.machine.own_process import in_own_process
    from airlight.validation.study.reference import load_cell

    file = tmp_path / "mine.py"
    file.write_text("def fog(view):\n    return type(view.medium.albedo)(0.1)\n")
    names = (f"{file}:fog", "unshadowed")
    mine, ours = (Cell("open-fog", (8, 6), (), configuration(name), BRIEF) for name in names)
    read = read_scene(load_cell(mine).scene)
    found = time_cells([mine, ours], lambda cell: read, apart=in_own_process)
    assert [each.lost for each in found] == [None, None]
    assert found[0].times.run == found[1].times.run
    assert all(each.times.frame.repetitions >= 5 for each in found)
