# SPDX-License-Identifier: BSD-3-Clause
"""Claim: times are medians of turns after warm-up, exponents are theirs, a jump is a cliff; each work has its steps."""

import sys

import mitsuba as mi
import numpy as np
import pytest

from analytic.errors import InputError
from realtime.frame.renderer import frame_renderer
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.clock import peak_memory, time_in_turns, time_repeated
from validation.study import frame_times as timing
from validation.study.configuration import configuration
from validation.study.frame_times import time_frame
from validation.study.growth import growth, ladder, study_growth, subdivided, triangles_of
from validation.study.study import Measure, Study


@pytest.mark.parametrize("exponent", [0.0, 0.37, 1.0, 1.7])
def test_a_power_is_found_and_is_no_cliff(exponent):
    works = [1000 * 4**level for level in range(5)]
    found = growth("map", "light_moved", works, [7.3 * work**exponent for work in works])
    assert found.exponent == pytest.approx(exponent, abs=1e-12)
    assert found.steepest == pytest.approx(exponent, abs=1e-12)
    assert not found.cliff


def test_a_jump_is_a_cliff():
    """The times of shadow planes before their wedges: 17 times the time for 4 times the triangles."""
    works = [20480, 81920, 327680, 1310720, 5242880]
    found = growth("triangles", "frame", works, [57, 81, 128, 2148, 5645])
    assert found.cliff
    assert found.at == 1310720
    assert found.steepest == pytest.approx(np.log(2148 / 128) / np.log(4))
    # The same after them, and light volumes: none.
    assert not growth("triangles", "frame", works, [57, 81, 128, 259, 512]).cliff
    assert not growth("triangles", "frame", works, [32, 34, 38, 39, 45]).cliff
    # Short times are those of launches: a jump of them says nothing.
    assert not growth("triangles", "frame", works, [0.1, 0.1, 0.1, 3.9, 4.1]).cliff


@pytest.mark.parametrize(
    ("kind", "scene", "why"),
    [
        ("speed", "open-fog", "expected some of size, triangles"),
        ("triangles", "open-fog", "has 0 triangles"),
        ("lights", "fence", "area lights only"),
    ],
)
def test_what_a_scene_does_not_have_is_refused(kind, scene, why, variant):
    with pytest.raises(InputError, match=why):
        ladder(kind, scene, (24, 18))


def test_a_study_measures_every_step_and_says_who_refuses(variant):
    steps = ladder("map", "sphere-spot", (24, 18))[:2]
    told = []
    study = Study(
        scenes=("sphere-spot",),
        sizes=((24, 18),),
        configurations=(configuration("light-volumes"), configuration("unshadowed")),
        measure=Measure("stages", 0.01),
    )
    found = study_growth(study, "map", steps, progress=lambda *done: told.append(done))
    measured, refused = found
    assert (measured.scene, measured.size, measured.label) == ("sphere-spot", (24, 18), "light-volumes (exact)")
    assert [cost.work for cost in measured.costs] == [128, 256]
    assert all(getattr(cost, name).median_ms > 0 for cost in measured.costs for name in ("frame", "rays"))
    assert measured.refused is None
    assert refused.costs == ()
    assert "map" in refused.refused
    assert told[-1][:2] == (4, 4)


def test_a_scene_keeps_what_has_no_triangles_to_cut(variant):
    box = mi.ScalarTransform4f().translate([0.13, 0.17, 0.71]).scale(0.37)
    scene = mi.load_dict(tiny_scene(block={"type": "cube", "to_world": box}))
    count = triangles_of(scene)
    assert count == 12 + sum(shape.face_count() for shape in scene.shapes() if shape.id() == "floor")
    finer = subdivided(scene, 2)
    assert triangles_of(finer) == 16 * count
    assert {shape.id() for shape in finer.shapes()} == {shape.id() for shape in scene.shapes()}
    before, after = read_scene(scene), read_scene(finer)
    assert after.features == before.features
    assert (after.camera.width, after.camera.height) == (before.camera.width, before.camera.height)
    with pytest.raises(InputError, match="no opaque meshes"):
        subdivided(mi.load_dict(tiny_scene(floor=None)), 1)


class Clock:
    """A clock that goes on only while work is done: no test waits, and no other load counts."""

    def __init__(self):
        self.now, self.calls = 0.0, []

    def perf_counter(self):
        return self.now

    def process_time(self):
        return 2 * self.now

    def work(self, name, *times):
        """Work that takes these times [ms] one after the other, the last one again and again."""

        def done():
            self.now += 1e-3 * times[min(self.calls.count(name), len(times) - 1)]
            self.calls.append(name)

        return done


@pytest.fixture
def clock(variant, monkeypatch):
    clock = Clock()
    monkeypatch.setattr("analytic.clock.time", clock)
    return clock


@pytest.mark.claim("times-are-medians", tolerance="rounding")
def test_times_are_medians_and_quartiles_without_the_warm_up(clock):
    timing = time_repeated(clock.work("a", 300, 300, 1, 2, 300, 4, 5), seconds=0.0, least=5, most=5)
    assert len(clock.calls) == 7
    assert (timing.low_ms, timing.median_ms, timing.high_ms) == pytest.approx((2, 4, 5))
    assert timing.cpu_ms == pytest.approx(2)  # the least, of two processors
    assert time_repeated(clock.work("b", 1), seconds=10.0, most=17).repetitions == 17
    assert time_repeated(clock.work("c", 1), seconds=0.0, least=3).repetitions == 3


def test_works_are_timed_in_turns(clock):
    slow, fast = time_in_turns([clock.work("slow", 20), clock.work("fast", 5)], seconds=0.0, least=5)
    assert clock.calls == ["slow", "fast"] * 7  # two turns of warm-up
    assert (slow.repetitions, fast.repetitions) == (5, 5)
    assert (slow.median_ms, fast.median_ms) == pytest.approx((20, 5))


@pytest.mark.parametrize(("spent", "turns"), [(0.0, 1), (1e6, 5)])
def test_a_slow_frame_is_timed_a_few_times(variant, monkeypatch, spent, turns):
    """A frame that takes minutes must not be rendered thirty times."""
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
        times.light_moved_camera_cached,
        times.colours_changed,
    )
    assert {spread.repetitions for spread in each} == {turns}
    assert all(0 < spread.low_ms <= spread.median_ms <= spread.high_ms for spread in each)
    assert times.frame.median_ms <= times.light_moved.median_ms <= times.objects_moved.median_ms
    assert times.colours_changed.median_ms <= times.light_moved_camera_cached.median_ms
    if turns == 1:
        assert times.frame.median_ms == pytest.approx(times.surface.median_ms + times.airlight.median_ms)
        assert all(spread.low_ms == spread.median_ms == spread.high_ms for spread in each)


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="only Linux lets a process forget an earlier peak")
def test_the_peak_is_that_of_what_was_held_together(variant):
    def work(mebibytes):
        held = np.ones(mebibytes * 2**17)
        assert held.sum() > 0

    work(200)  # an earlier peak does not count
    # The kernel counts pages in batches, and the allocator takes some.
    assert 94 < peak_memory(lambda: work(96)) < 104
    assert peak_memory(lambda: None) < 4
