# SPDX-License-Identifier: BSD-3-Clause
"""Large images are rendered in parts: the same pixels, with what a frame needs beside them that of a part."""

import numpy as np
import pytest

from tests.helpers.scenes import tiny_scene

# No method sees the rays of another part, and a part begins where a block of tiles does: the same bits.
METHODS = {
    "ray-march": {"steps": 7},
    "shadow-planes": {},
    "light-volumes": {"map": 64},
    "light-volumes, a disk": {"map": 64, "points": 3},
}


def scene(*, lamp=False):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene
    from validation.scenes.loading import resize
    from validation.scenes.parts import area_lamp

    disk = area_lamp("disk", (0.31, -0.57, 1.93), (0.13, 0.29, -1.0), 0.17, (5.3, 4.9, 4.1))
    lamps = {"lamp": disk} if lamp else {}
    box = mi.ScalarTransform4f().translate([0.13, 0.17, 0.71]).rotate([0.3, 1, 0.2], 29.0).scale(0.37)
    built = mi.load_dict(tiny_scene(ball={"type": "cube", "to_world": box}, **lamps))
    resize(built, (83, 47))
    return read_scene(built)


def renderer(name):
    from realtime.frame.renderer import frame_renderer
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS as REGISTRY

    method = REGISTRY[name.partition(",")[0]]
    return frame_renderer(scene(lamp="disk" in name), method, kernel=KERNELS["exact"].function, **METHODS[name])


@pytest.mark.parametrize("name", METHODS)
def test_an_image_in_parts_is_that_of_the_whole(name, variant, monkeypatch):
    import realtime.frame.renderer as module

    made = renderer(name)
    whole = module.render_frame(made)
    assert len(module.parts(made)) == 1
    monkeypatch.setattr(module, "_LARGE", 2048)
    monkeypatch.setattr(module, "_PART", 1024)
    pixels = [np.array(part.pixel) for part in module.parts(made)]
    assert [len(part) for part in pixels] == [1024, 1024, 1024, 829]
    assert set(np.concatenate(pixels)) == set(range(83 * 47))
    in_parts = module.render_frame(made)
    for layer in ("airlight", "surface", "distance"):
        np.testing.assert_array_equal(getattr(in_parts, layer), getattr(whole, layer))


@pytest.mark.parametrize("parameters", [{"tolerance": 0.01}, {"evaluation": "mesh"}])
def test_what_needs_the_whole_image_is_not_divided(parameters, variant, monkeypatch):
    import realtime.frame.renderer as module
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS as REGISTRY

    monkeypatch.setattr(module, "_LARGE", 256)
    read = scene()
    if "tolerance" in parameters:
        from dataclasses import replace

        read = replace(read, camera=replace(read.camera, width=84, height=48))
    made = module.frame_renderer(
        read, REGISTRY["light-volumes"], kernel=KERNELS["exact"].function, map=64, **parameters
    )
    assert module.parts(made) == (made,)


def test_a_frame_in_parts_is_timed_by_its_stages(variant, monkeypatch):
    import realtime.frame.renderer as module
    from validation.configurations.timing import time_frame

    monkeypatch.setattr(module, "_LARGE", 2048)
    monkeypatch.setattr(module, "_PART", 1024)
    times = time_frame(renderer("shadow-planes"))
    assert times.frame.repetitions == 3
    assert 0 < times.surface.median_ms < times.frame.median_ms < times.objects_moved.median_ms
