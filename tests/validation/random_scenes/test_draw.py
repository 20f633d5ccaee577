# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a drawn scene is sound: no light or camera within a caster, all within its ranges, nothing round."""

from collections import Counter

import numpy as np
import pytest

from validation.random_scenes.draw import draw_scene
from validation.random_scenes.ranges import Ranges

SEEDS = range(300)


@pytest.fixture(scope="module")
def scenes():
    return [draw_scene(seed, Ranges()) for seed in SEEDS]


def _clearance(caster, place):
    return np.linalg.norm(np.subtract(caster.position, place)) - caster.radius


@pytest.mark.claim("random-clear", tolerance="none: the balls around casters hold neither")
def test_no_caster_holds_the_camera_or_a_light_unless_meant_to(scenes):
    for drawn in scenes:
        for caster in drawn.casters:
            if caster.kind in ("floor", "wall", "room"):
                continue
            assert _clearance(caster, drawn.camera.origin) > 0, drawn.seed
            for light in drawn.lights:
                caged = caster.kind == "cage" and caster.position == light.position
                assert caged or _clearance(caster, light.position) > 0, (drawn.seed, caster.name, light.name)


def test_all_lie_on_one_side_of_floor_and_wall(scenes):
    from validation.scenes.parts import rotation

    for drawn in scenes:
        near = [light.position for light in drawn.lights if light.kind != "directional"]
        for caster in drawn.casters:
            if caster.kind in ("floor", "wall"):
                normal = rotation(*caster.turn) @ [0, 0, 1]
                for place in (drawn.camera.origin, *near):
                    assert np.subtract(place, caster.position) @ normal > 0, drawn.seed
            if caster.kind == "room":
                for place in (drawn.camera.origin, *near):
                    own = rotation(*caster.turn).T @ np.subtract(place, caster.position)
                    assert np.all(np.abs(own) < np.multiply(caster.numbers, caster.radius)), drawn.seed


@pytest.mark.slow
def test_every_choice_is_made(scenes):
    ranges = Ranges()
    counts = {
        "light_kinds": Counter(light.kind for drawn in scenes for light in drawn.lights),
        "caster_kinds": Counter(caster.kind for drawn in scenes for caster in drawn.casters),
        "bounds_kinds": Counter(medium.bounds for drawn in scenes for medium in drawn.media),
        "phases": Counter(medium.phase.partition(":")[0] for drawn in scenes for medium in drawn.media),
    }
    for name, counted in counts.items():
        wanted = {word for word, weight in getattr(ranges, name).items() if weight} - {"mesh"}
        assert wanted <= set(counted), name
    assert {"floor", "wall", "room", "cage", "ball"} <= set(counts["caster_kinds"])
    assert {len(drawn.lights) for drawn in scenes} == set(range(1, 9))
    assert {len(medium.sigma_t) for drawn in scenes for medium in drawn.media} == {1, 3}
    assert {drawn.camera.inside == "clear air" for drawn in scenes} == {True, False}
    assert {drawn.camera.in_shadow for drawn in scenes} == {True, False}
    depths = [medium.optical_depth for drawn in scenes for medium in drawn.media]
    assert min(depths) < 2e-3
    assert max(depths) > 15


@pytest.mark.claim("random-not-round", tolerance="no number has fewer than four digits after the first in 300 scenes")
def test_no_number_is_round(scenes):
    for drawn in scenes:
        numbers = [drawn.scale, *drawn.centre, *drawn.camera.origin, drawn.camera.fov]
        for medium in drawn.media:
            numbers += [*medium.sigma_t, *medium.albedo]
        for light in drawn.lights:
            numbers += [*light.position, *light.colour]
        for number in numbers:
            assert number != float(f"{number:.4g}"), drawn.seed


def test_a_draw_is_the_same_again_and_another_attempt_is_not():
    assert draw_scene(11, Ranges()) == draw_scene(11, Ranges())
    first, second = draw_scene(11, Ranges()), draw_scene(11, Ranges(), attempt=1)
    assert first.scale == second.scale
    assert first.camera.origin != second.camera.origin
