# SPDX-License-Identifier: BSD-3-Clause
"""Claim: whether light reaches what the camera sees is found by rays against the triangles of the casters."""

from dataclasses import replace

import numpy as np

from validation.random_scenes.draw import draw_scene
from validation.random_scenes.drawn import DrawnCamera, DrawnLight
from validation.random_scenes.ranges import Ranges
from validation.random_scenes.reach import reach

_CAMERA = DrawnCamera((0.0, -4.0, 0.1), (0.0, 0.0, 0.0), 47.0, "endless", False)
_LAMP = DrawnLight("light-1", "point", (0.0, 0.3, 5.0), (0.0, 0.0, 0.0), (1.0, 1.0, 1.0), 1.0)


def _scene(**changes):
    drawn = replace(draw_scene(0, Ranges()), centre=(0.0, 0.0, 0.0), scale=1.0, camera=_CAMERA, lights=(_LAMP,))
    return replace(drawn, **changes)


def _plate(z, half):
    corners = np.array([[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]])
    return corners[[[0, 1, 2], [0, 2, 3]]]


def test_without_casters_all_is_lit():
    found = reach(_scene(), [])
    assert (found.lit, found.near, found.camera_lit) == (1.0, 0.0, True)
    assert found.enough


def test_a_plate_under_the_lamp_keeps_the_light_away():
    found = reach(_scene(), [_plate(4.0, 30.0)])
    assert (found.lit, found.camera_lit) == (0.0, False)
    assert not found.enough
