# SPDX-License-Identifier: BSD-3-Clause
"""From frame to frame: what stands still stays, a moved light leaves a ghost that fades as the weight says.

Protects the claim on ghosts under a moving light.
"""

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer, image_frame
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from tests.helpers.frames import relative_rmse
from tests.helpers.scenes import tiny_scene
from tests.realtime.methods.froxel_fog.test_method import lamp_above

STILL = {"camera_moved": False, "geometry_moved": False, "light_moved": False}
GRID = {"width": 24, "height": 18, "slices": 24, "far": 6.1}


def scene(**changes):
    return read_scene(mi.load_dict(tiny_scene(size=(24, 18), lamp=lamp_above()) | changes))


def frames(steps, **parameters):
    """Return the airlight of frames of scenes that follow one another, each with what moved."""
    renderer = frame_renderer(steps[0][0], METHODS["froxel-fog"], **(GRID | parameters))
    cache, images = None, []
    for now, moved in steps:
        stages, cache = next_frame(renderer, now, cache, **(STILL | moved))
        images.append(image_frame(replace(renderer, scene=now), stages).airlight)
    return images


def darker(now, share):
    return replace(now, lights=tuple(replace(light, intensity=light.intensity * share) for light in now.lights))


def shifted_camera(now, vector):
    return replace(now, camera=replace(now.camera, origin=now.camera.origin + type(now.camera.origin)(*vector)))


@pytest.mark.claim("froxel-ghost", tolerance="1e-4 relative: the weight to the power of the frames since")
def test_the_ghost_of_a_light_that_changed_fades_like_a_power_of_the_weight(variant):
    weight = 0.7
    bright = scene()
    dark = darker(bright, 0.25)
    images = frames([(bright, {})] + [(dark, {})] * 5, history=weight)
    left = images[0] - frames([(dark, {})])[0]
    for number, image in enumerate(images):
        ghost = np.sum((image - frames([(dark, {})])[0]) * left) / np.sum(left**2)
        assert ghost == pytest.approx(weight**number, rel=1e-4)


@pytest.mark.claim("froxel-jitter", tolerance="below 0.8 of the error of a frame alone")
def test_frames_that_sample_elsewhere_come_closer_to_a_finer_grid(variant):
    now = scene()
    coarse = {"width": 24, "height": 18, "slices": 12}
    fine = frames([(now, {})], slices=384, width=24, height=18)[0]
    alone = frames([(now, {})], **coarse)[0]
    many = frames([(now, {})] * 128, history=0.97, jitter="frames", **coarse)[-1]
    assert relative_rmse(many, fine) < 0.8 * relative_rmse(alone, fine)


def test_history_follows_a_camera_that_moves(variant):
    now = scene()
    there = shifted_camera(now, (0.31, 0.0, 0.0))
    moved = {"camera_moved": True}
    fresh = frames([(there, {})])[0]
    followed = frames([(now, {}), (there, moved)], history=0.9)[1]
    stayed = frames([(now, {})])[0]
    assert relative_rmse(followed, fresh) < 0.3 * relative_rmse(0.9 * stayed + 0.1 * fresh, fresh)


def test_what_the_last_frame_did_not_see_starts_anew(variant):
    now = scene()
    away = shifted_camera(now, (0.0, 60.0, 0.0))  # sees nothing of what the grid held
    moved = {"camera_moved": True}
    np.testing.assert_array_equal(
        frames([(darker(now, 4.0), {}), (away, moved)], history=0.9)[1], frames([(away, {})], history=0.9)[0]
    )
