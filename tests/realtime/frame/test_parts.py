# SPDX-License-Identifier: BSD-3-Clause
"""Large images are rendered in parts: the same pixels, with what a frame needs beside them that of a part."""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

import realtime.frame.renderer as module
from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer
from realtime.kernels.registry import KERNELS
from realtime.methods.registry import METHODS as REGISTRY
from realtime.scene.animate import coloured_light, turned_light
from realtime.scene.read_scene import read_scene
from tests.helpers.scenes import tiny_scene
from validation.scenes.loading import resize
from validation.scenes.meshes import rotation
from validation.scenes.parts import area_lamp
from validation.study.frame_times import timed_image

# No method sees the rays of another part, and a part begins where a block of tiles does: the same bits.
METHODS = {
    "shadow-planes": {},
    "light-volumes, a disk": {"map": 64, "points": 3},
}


def scene(*, lamp=False):
    disk = area_lamp("disk", (0.31, -0.57, 1.93), (0.13, 0.29, -1.0), 0.17, (5.3, 4.9, 4.1))
    lamps = {"lamp": disk} if lamp else {}
    box = mi.ScalarTransform4f().translate([0.13, 0.17, 0.71]).rotate([0.3, 1, 0.2], 29.0).scale(0.37)
    built = mi.load_dict(tiny_scene(ball={"type": "cube", "to_world": box}, **lamps))
    resize(built, (83, 47))
    return read_scene(built)


def renderer(name):
    method = REGISTRY[name.partition(",")[0]]
    return frame_renderer(scene(lamp="disk" in name), method, kernel=KERNELS["exact"].function, **METHODS[name])


STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}


def same(frame, other):
    for layer in ("airlight", "surface", "distance"):
        np.testing.assert_array_equal(getattr(frame, layer), getattr(other, layer))


@pytest.mark.parametrize("name", METHODS)
def test_frames_of_an_animation_are_the_same_in_parts(name, variant, monkeypatch):
    """What is shaded again by a frame that follows is shaded in parts too; the state is one for all parts."""
    made = renderer(name)
    read, turn = made.scene, rotation([0.3, 0.9, -0.2], 11.0)
    turned = replace(read, lights=tuple(turned_light(light, np.array([0.1, 0.2, 0.3]), turn) for light in read.lights))
    coloured = replace(turned, lights=tuple(coloured_light(light, 0.4) for light in turned.lights))
    moves = [(read, {}), (turned, {"light_moved": True}), (coloured, {}), (read, {"light_moved": True})]
    moves += [(read, {"geometry_moved": True, "light_moved": True})]
    expected, cache = [], None
    for now, moved in moves:
        stages, cache = next_frame(made, now, cache, **(STILL | moved))
        expected.append(module.image_frame(replace(made, scene=now), stages))
    assert np.any(expected[0].airlight != expected[1].airlight) or not read.lights
    monkeypatch.setattr(module, "_LARGE", 2048)
    monkeypatch.setattr(module, "_PART", 1024)
    prepared, kept = [], None
    structures = {
        key: replace(stages, prepare=lambda scene, run=stages.prepare: prepared.append(scene) or run(scene))
        for key, stages in made.structures.items()
    }
    counted = replace(made, structures=structures)
    for (now, moved), whole in zip(moves, expected, strict=True):
        frame, kept, _ = timed_image(counted, now, kept, **(STILL | moved))
        same(frame, whole)
        assert len(kept) == 4
    if not read.area_lights:
        assert len(prepared) <= len(moves)  # not once for each part
