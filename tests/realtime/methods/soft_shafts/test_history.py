# SPDX-License-Identifier: BSD-3-Clause
"""The last frame counts where it still holds, and nowhere else."""

from dataclasses import replace

import numpy as np
import pytest

from tests.helpers.lamps import lamp_scene, renderer

SHARED = {"points": 16, "pattern": "sobol", "interleave": True, "steps": 8, "surfaces": "ray", "filter": "none"}


def frames(made, scenes, *, camera=False, light=False):
    """Render scenes one after the other; return airlight and surface of each."""
    from realtime.frame.incremental import next_frame
    from realtime.frame.renderer import image_frame

    cache, images = None, []
    for number, scene in enumerate(scenes):
        moved = {"camera_moved": camera or number == 0, "geometry_moved": False, "light_moved": light or number == 0}
        stages, cache = next_frame(made, scene, cache, **moved)
        images.append(image_frame(made, stages))
    return images


def shifted(scene, step):
    """Return the scene with its camera a little to the side."""
    import drjit as dr

    origin = scene.camera.origin + type(scene.camera.origin)(step, 0.3 * step, 0)
    dr.make_opaque(origin)
    return replace(scene, camera=replace(scene.camera, origin=origin))


@pytest.mark.claim("history-lowers-noise", tolerance="0.7 of the median error of a frame alone, after ten frames")
def test_a_moving_camera_gathers_more_points(variant):
    scene = lamp_scene(size=(64, 48), ball=None)
    many = renderer(scene, points=64, pattern="sobol", steps=128, filter="none", surfaces="ray", spacing="equiangular")
    errors = {}
    for weight in (0.0, 0.8):
        made = renderer(scene, **SHARED | {"spacing": "uniform", "steps": 2}, history=weight)
        path = [shifted(made.scene, 0.004 * step) for step in range(-9, 1)]
        last = frames(made, path, camera=True)[-1].airlight[4:-4, 4:-4]
        truth = frames(many, path[-1:])[0].airlight[4:-4, 4:-4]
        errors[weight] = np.median(np.abs(last - truth) / truth)
    assert errors[0.8] < 0.7 * errors[0.0]


def test_a_light_that_jumps_leaves_nothing_behind(variant):
    """What a pixel and its neighbours do not hold now is cut off: a lamp that is out leaves no ghost."""
    made = renderer(lamp_scene(size=(32, 24)), history=0.9, **SHARED)
    light = made.scene.area_lights[0]
    dark = replace(made.scene, area_lights=(replace(light, radiance=0 * light.radiance),))
    images = frames(made, [made.scene, made.scene, dark], light=True)
    assert images[1].airlight.max() > 1e-3
    assert np.all(images[2].airlight == 0)
    assert np.all(images[2].surface == 0)
