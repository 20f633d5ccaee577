# SPDX-License-Identifier: BSD-3-Clause
"""Subdivided meshes are closed where they were; their bumps have more silhouettes as triangles shrink."""

import mitsuba as mi
import pytest

from analytic.errors import InputError
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.study.ladders import subdivided, triangles_of


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
