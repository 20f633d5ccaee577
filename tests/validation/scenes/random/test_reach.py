# SPDX-License-Identifier: BSD-3-Clause
"""Claim: whether light reaches what the camera sees is found by rays against the triangles of the casters."""

from dataclasses import replace

import mitsuba as mi
import numpy as np

from validation.scenes.meshes import grid
from validation.scenes.parts import mitsuba_mesh
from validation.scenes.random.design import ranges_from
from validation.scenes.random.lights import Light
from validation.scenes.random.scene import Camera, draw_stage, reach


def found(*meshes):
    """What light reaches of a stage about the origin of radius 1 under a lamp, with casters."""
    camera = Camera(np.array([0.0, -4.0, 0.1]), np.zeros(3), 47.0, "endless", False)
    lamp = Light("light-1", "point", np.array([0.0, 0.3, 5.0]), np.zeros(3), np.ones(3), 1.0)
    drawn = draw_stage(0, ranges_from({}))
    stage = replace(drawn, centre=np.zeros(3), scale=1.0, camera=camera, lights=(lamp,))
    shapes = {f"caster-{number}": mitsuba_mesh("caster", mesh, (0.5,) * 3) for number, mesh in enumerate(meshes)}
    return reach(stage, mi.load_dict({"type": "scene"} | shapes))


def test_without_casters_all_is_lit(variant):
    without = found()
    assert (without.lit, without.near, without.camera_lit) == (1.0, 0.0, True)
    assert without.enough


def test_a_plate_under_the_lamp_keeps_the_light_away(variant):
    shaded = found(grid((-30.0, -30.0, 4.0), (60.0, 0, 0), (0, 60.0, 0), (1, 1)))
    assert (shaded.lit, shaded.camera_lit) == (0.0, False)
    assert not shaded.enough


def test_a_wall_before_the_camera_is_near(variant):
    assert found(grid((-30.0, -3.0, -30.0), (60.0, 0, 0), (0, 0, 60.0), (1, 1))).near == 1.0
