# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a drawn scene is sound: no light or camera within a caster, all within its ranges, nothing round."""

import numpy as np
import pytest

from validation.scenes.meshes import rotation
from validation.scenes.random.design import ranges_from
from validation.scenes.random.scene import draw_stage

SEEDS = range(300)


@pytest.fixture(scope="module")
def scenes():
    return [draw_stage(seed, ranges_from({})) for seed in SEEDS]


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
                caged = caster.kind == "cage" and np.all(caster.position == light.position)
                assert caged or _clearance(caster, light.position) > 0, (drawn.seed, caster.name, light.name)


def test_all_lie_on_one_side_of_floor_and_wall(scenes):
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
                    assert np.all(np.abs(own) < caster.mesh[0].max(axis=0) * caster.radius), drawn.seed


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
