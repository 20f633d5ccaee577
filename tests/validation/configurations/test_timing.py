# SPDX-License-Identifier: BSD-3-Clause
import time
from types import SimpleNamespace

import pytest

from tests.helpers.scenes import tiny_scene
from validation.configurations.timing import time_frame, time_in_turns, time_repeated, times_in_turns


def test_median_is_the_time_of_the_work(variant):
    """A sleep that is known; the sleeps of a busy machine are longer, never shorter."""
    timing = time_repeated(lambda: time.sleep(0.01), seconds=0.0, least=5)
    assert timing.repetitions == 5
    assert 10 <= timing.low_ms <= timing.median_ms <= timing.high_ms
    assert timing.median_ms < 200


@pytest.mark.claim("times-are-medians")
def test_warm_up_is_not_timed(variant):
    calls = []

    def work():
        calls.append(len(calls))
        time.sleep(0.3 if len(calls) <= 2 else 0.0)

    timing = time_repeated(work, seconds=0.0, least=3)
    assert len(calls) == 5
    assert timing.high_ms < 100


def test_number_of_repetitions_is_bounded(variant):
    assert time_repeated(lambda: None, seconds=10.0, most=17).repetitions == 17
    assert time_repeated(lambda: None, seconds=0.0, least=3).repetitions == 3


@pytest.mark.claim("times-are-medians")
def test_one_outlier_does_not_move_the_median(variant):
    calls = []

    def work():
        calls.append(0)
        if len(calls) == 4:
            time.sleep(0.2)

    timing = time_repeated(work, seconds=0.0, least=21)
    assert timing.median_ms < 20


@pytest.mark.claim("times-are-medians")
def test_quartiles_are_those_of_the_times(variant, monkeypatch):
    """A clock of our own: repetitions of 1, 2, 3, 4 and 5 ms."""
    # One reading for the end of the time, then: is there time left (not asked below `least`), start, stop.
    readings = iter([0.0, *(value for n in range(1, 6) for value in (n, n + n / 1000)), 100.0])
    monkeypatch.setattr("validation.configurations.timing.time", SimpleNamespace(perf_counter=lambda: next(readings)))
    timing = time_repeated(lambda: None, seconds=1.0, least=5)
    assert (timing.low_ms, timing.median_ms, timing.high_ms) == pytest.approx((2, 3, 4))


def test_works_are_timed_in_turns(variant):
    calls = []

    def work(name, seconds):
        calls.append(name)
        time.sleep(seconds)

    slow, fast = time_in_turns([lambda: work("slow", 0.02), lambda: work("fast", 0.005)], seconds=0.0, least=5)
    assert calls == ["slow", "fast"] * 7  # two turns of warm-up
    assert slow.repetitions == fast.repetitions == 5
    assert slow.low_ms >= 20
    assert fast.low_ms >= 5
    assert fast.median_ms < slow.median_ms


def test_every_other_turn_goes_backwards_on_request(variant):
    """What comes second may find the caches warm; each time stays with its work."""
    calls = []

    def work(name, seconds):
        calls.append(name)
        time.sleep(seconds)

    works = [lambda: work("slow", 0.02), lambda: work("fast", 0.01)]
    slow, fast = times_in_turns(works, seconds=0.0, least=5, most=5, alternate=True).T
    assert calls[4:] == ["slow", "fast", "fast", "slow"] * 2 + ["slow", "fast"]
    assert len(slow) == len(fast) == 5
    assert slow.min() >= 20
    assert fast.min() >= 10


@pytest.fixture(scope="module")
def renderer(variant):
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    scene = read_scene(mi.load_dict(tiny_scene(size=(16, 12))))
    return frame_renderer(scene, METHODS["ray-march"], steps=8, shadow="map", map=16)


def test_every_stage_of_a_frame_is_timed(renderer):
    times = time_frame(renderer, seconds=0.02)
    for name in (
        "frame",
        "surface",
        "airlight",
        "light_moved",
        "objects_moved",
        "light_moved_camera_kept",
        "colours_changed",
    ):
        timing = getattr(times, name)
        assert 0 < timing.low_ms <= timing.median_ms <= timing.high_ms, name
        assert timing.repetitions >= 3


def test_timing_does_not_change_the_frame(renderer):
    import numpy as np

    from realtime.frame.renderer import render_frame

    before = render_frame(renderer)
    time_frame(renderer, seconds=0.01)
    after = render_frame(renderer)
    np.testing.assert_array_equal(before.airlight, after.airlight)
    np.testing.assert_array_equal(before.surface, after.surface)


def test_scene_without_anything_to_move_can_be_timed(variant):
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    scene = read_scene(mi.load_dict(tiny_scene(ball=None, floor=None)))
    times = time_frame(frame_renderer(scene, METHODS["ray-march"], steps=3), seconds=0.01)
    assert times.objects_moved.median_ms > 0


def test_moved_builds_the_acceleration_structure_again_and_rebuild_does_not(variant, monkeypatch):
    """What moves when only the light does must not cost what objects cost."""
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from validation.configurations import timing
    from validation.configurations.methods import configuration, prepared
    from validation.scenes.loading import load_scene

    renderer = prepared(read_scene(load_scene("sphere-spot", (8, 6)).scene), configuration("shadow-planes"))
    updates = []
    update = mi.SceneParameters.update
    monkeypatch.setattr(mi.SceneParameters, "update", lambda self, *args: updates.append(1) or update(self, *args))
    measured = {}

    def counted(work, **_):
        before = len(updates)
        work()
        measured[len(measured)] = len(updates) - before
        return timing.Timing(1.0, 1.0, 1.0, 1)

    monkeypatch.setattr(timing, "time_repeated", counted)
    time_frame(renderer)
    # frame, surface, airlight, light_moved, moved, light_moved_camera_kept, colours_changed
    assert list(measured.values()) == [0, 0, 0, 0, 1, 0, 0]


@pytest.mark.parametrize(("spent", "turns"), [(0.0, 1), (1e6, 5)])
def test_a_slow_frame_is_timed_a_few_times(variant, monkeypatch, spent, turns):
    """A frame that takes minutes must not be rendered thirty times."""
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from validation.configurations import timing

    monkeypatch.setattr(timing, "_TURNS", spent)
    scene = read_scene(mi.load_dict(tiny_scene(size=(16, 12))))
    renderer = frame_renderer(scene, METHODS["ray-march"], steps=3)
    assert time_frame(renderer, seconds=0.01).frame.repetitions >= 5  # not slow
    times = time_frame(renderer, slow=-1.0)
    each = (
        times.frame,
        times.surface,
        times.airlight,
        times.light_moved,
        times.objects_moved,
        times.light_moved_camera_kept,
        times.colours_changed,
    )
    assert {spread.repetitions for spread in each} == {turns}
    assert times.frame.median_ms <= times.light_moved.median_ms <= times.objects_moved.median_ms
    assert times.colours_changed.median_ms <= times.light_moved_camera_kept.median_ms
    if turns == 1:
        assert times.frame.median_ms == pytest.approx(times.surface.median_ms + times.airlight.median_ms)
        assert all(spread.low_ms == spread.median_ms == spread.high_ms for spread in each)


def test_frames_above_the_usual_limit_are_slow(variant, monkeypatch):
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from validation.configurations import timing

    monkeypatch.setattr(timing, "SLOW", -1.0)
    monkeypatch.setattr(timing, "_TURNS", 0.0)
    scene = read_scene(mi.load_dict(tiny_scene(size=(16, 12))))
    assert time_frame(frame_renderer(scene, METHODS["ray-march"], steps=3)).frame.repetitions == 1
