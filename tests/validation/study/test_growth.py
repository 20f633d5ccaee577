# SPDX-License-Identifier: BSD-3-Clause
"""Claim: exponents are those of times, a jump is a cliff; each work has
its steps, of one anchor.
"""

import sys

import mitsuba as mi
import numpy as np
import pytest

from airlight.errors import InputError
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.clock import peak_memory
from airlight.validation.scenes.loading import load_scene
from airlight.validation.scenes.meshes import rotation
from airlight.validation.study.configuration import Configuration, configuration
from airlight.validation.study.growth import (
    growth,
    ladder,
    study_growth,
    subdivided,
    triangles_of,
    with_copies,
)
from airlight.validation.study.study import Measure, Study
from tests.helpers.scenes import bounded_medium, tiny_scene


@pytest.mark.parametrize("exponent", [0.0, 0.37, 1.0, 1.7])
def test_a_power_is_found_and_is_no_cliff(exponent):
    works = [1000 * 4**level for level in range(5)]
    found = growth("map", "light_moved", works, [7.3 * work**exponent for work in works])
    assert found.exponent == pytest.approx(exponent, abs=1e-12)
    assert found.steepest == pytest.approx(exponent, abs=1e-12)
    assert not found.cliff


def test_a_jump_is_a_cliff():
    """The times of shadow planes before their wedges: 17 times the time
    for 4 times the triangles.
    """
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
    # Nor is it the cliff that a sentence names where there is one behind it.
    behind = growth("triangles", "frame", works, [0.1, 3.9, 8, 100, 200])
    assert (behind.cliff, behind.at) == (True, 1310720)
    assert behind.steepest == pytest.approx(np.log(100 / 8) / np.log(4))


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


def test_each_step_has_more_work_than_the_one_before():
    """One pixel had two steps of one pixel, and its exponent was a division by zero."""
    works = [step.work for step in ladder("size", "open-fog", (1, 1))]
    assert works == [1, 4, 16]
    assert growth("size", "frame", works, works).exponent == pytest.approx(1)


def test_meshes_grow_until_memory_would_end(monkeypatch):
    monkeypatch.setattr("airlight.validation.study.growth.triangles_of", lambda scene: 300_000)
    assert [step.work for step in ladder("triangles", "sphere-spot", (4, 3))] == [
        300_000 * 4**level for level in range(3)
    ]


def test_a_shader_is_refused_before_anything_is_timed():
    """It has no time of a frame after the light moved: the study ended with a KeyError."""
    study = Study(scenes=("open-fog",), configurations=(Configuration("fog.glsl"),))
    with pytest.raises(InputError, match=r"fog\.glsl is a shader"):
        study_growth(study, "size", ladder("size", "open-fog", (4, 3)))


def test_a_study_measures_every_step_and_says_who_refuses(variant):
    steps = ladder("map", "sphere-spot", (24, 18))[:2]
    told = []
    study = Study(
        scenes=("sphere-spot",),
        sizes=((24, 18),),
        configurations=(
            configuration("ray-march", parameters={"shadow": "map", "steps": 3}),
            configuration("unshadowed"),
        ),
        measure=Measure("stages", 0.01),
    )
    found = study_growth(study, "map", steps, progress=lambda *done: told.append(done))
    measured, refused = found
    assert (measured.scene, measured.size, measured.label) == (
        "sphere-spot",
        (24, 18),
        "ray-march (shadow=map, steps=3)",
    )
    assert [cost.work for cost in measured.costs] == [128, 256]
    assert all(
        getattr(cost, name).median_ms > 0 for cost in measured.costs for name in ("frame", "rays")
    )
    assert measured.refused is None
    assert measured.run.anchor.median_ms > 0
    assert measured.run.between >= 1
    assert refused.costs == ()
    assert "map" in refused.refused
    assert told[-1][:2] == (4, 4)


def test_a_scene_keeps_what_has_no_triangles_to_cut(variant):
    box = mi.ScalarTransform4f().translate([0.13, 0.17, 0.71]).scale(0.37)
    scene = mi.load_dict(tiny_scene(block={"type": "cube", "to_world": box}))
    count = triangles_of(scene)
    assert count == 12 + sum(
        shape.face_count() for shape in scene.shapes() if shape.id() == "floor"
    )
    finer = subdivided(scene, 2)
    assert triangles_of(finer) == 16 * count
    assert {shape.id() for shape in finer.shapes()} == {shape.id() for shape in scene.shapes()}
    before, after = read_scene(scene), read_scene(finer)
    assert after.features == before.features
    assert (after.camera.width, after.camera.height) == (before.camera.width, before.camera.height)
    with pytest.raises(InputError, match="no opaque meshes"):
        subdivided(mi.load_dict(tiny_scene(floor=None)), 1)


@pytest.mark.skipif(
    not sys.platform.startswith("linux"), reason="only Linux lets a process forget an earlier peak"
)
def test_the_peak_is_that_of_what_was_held_together(variant):
    def work(mebibytes):
        held = np.ones(mebibytes * 2**17)
        assert held.sum() > 0

    work(200)  # an earlier peak does not count
    # The kernel counts pages in batches, and the allocator takes some.
    assert 94 < peak_memory(lambda: work(96)) < 104
    assert peak_memory(lambda: None) < 4


def test_copies_of_a_light_stand_near_it_and_have_its_intensity_together(variant):
    scene = read_scene(load_scene("sphere-spot", (8, 6)).scene)
    (light,) = scene.lights
    more = with_copies(scene, 4)
    assert [light.kind for light in more.lights] == ["spot"] * 4
    place, eye = (
        np.array(each, dtype=float).ravel() for each in (light.position, scene.camera.origin)
    )
    total = sum(np.array(each.intensity, dtype=float) for each in more.lights)
    np.testing.assert_allclose(total, np.array(light.intensity, dtype=float), rtol=1e-6)
    away = [np.array(each.position, dtype=float).ravel() - place for each in more.lights]
    distances = np.linalg.norm(away, axis=1)
    step = 0.07 * np.linalg.norm(place - eye)
    assert distances[0] == 0
    # In the plane across, sqrt(n) steps: a spiral; the third coordinate adds at most 0.3 of it.
    np.testing.assert_allclose(
        np.hypot(*np.array(away).T[:2]) / step, np.sqrt(np.arange(4)), rtol=1e-4
    )
    assert (np.abs(np.array(away)[:, 2]) <= 0.3 * step * np.sqrt(np.arange(4)) + 1e-6).all()
    assert len({tuple(np.round(each, 6)) for each in away}) == 4


def test_copies_of_a_light_from_infinity_are_turned(variant):
    sun = {"type": "directional", "direction": [0.3, 0.2, -1.0], "irradiance": 2.0}
    camera = {name: value for name, value in tiny_scene()["sensor"].items() if name != "medium"}
    body = bounded_medium({"type": "cube"}, 0.3, (0.9, 0.9, 0.9))
    more = with_copies(
        read_scene(mi.load_dict(tiny_scene(lamp=sun, fog=None, sensor=camera, body=body))), 3
    )
    axes = [np.array(each.exact_axis, dtype=float).ravel() for each in more.lights]
    turned = [rotation((0.31, 0.53, 0.79), 2.3 * number) @ axes[0] for number in range(3)]
    np.testing.assert_allclose(axes, turned, atol=1e-6)
    assert [light.kind for light in more.lights] == ["directional"] * 3


def test_sizes_are_halves_to_four_times_the_width(variant):
    steps = ladder("size", "open-fog", (10, 7))
    assert [step.work for step in steps] == [5 * 4, 70, 280, 40 * 28]
    assert (steps[0].scene().camera.width, steps[0].scene().camera.height) == (5, 4)
