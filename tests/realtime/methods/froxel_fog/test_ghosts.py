# SPDX-License-Identifier: BSD-3-Clause
"""Claim: a history leaves a ghost of a light that moved, which fades by its weight in every frame at rest."""

from dataclasses import replace
from itertools import islice

import mitsuba as mi
import numpy as np
import pytest

from realtime.frame.incremental import next_frame
from realtime.frame.renderer import frame_renderer, image_frame
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import read_scene
from tests.helpers.area_lamps import lit_by
from validation.scenes.animation import animate
from validation.scenes.record import Animation

MOVING, RESTING = 3, 5
GRID = {"width": 16, "height": 12, "slices": 24, "points": 2}


def frames(steps, **history):
    """Yield the airlight of frames that follow one another: scenes, and whether their light has moved."""
    renderer, cache = frame_renderer(steps[0][0], METHODS["froxel-fog"], **GRID, **history), None
    for scene, moved in steps:
        still = {"camera_moved": False, "geometry_moved": False, "light_moved": moved}
        stages, cache = next_frame(renderer, scene, cache, **still)
        yield np.asarray(image_frame(replace(renderer, scene=scene), stages).airlight, dtype=np.float64)


@pytest.mark.claim("froxel-ghost", tolerance="1e-3 relative, while the ghost is above rounding")
def test_a_ghost_fades_by_the_weight_when_the_light_rests(variant):
    scene = read_scene(mi.load_dict(lit_by("disk")))
    moved = list(islice(animate(scene, Animation(moves=("light",)), 31), MOVING + 1))
    steps = [(now, number > 0) for number, now in enumerate(moved)] + [(moved[-1], False)] * RESTING
    alone = list(frames(steps))

    def ghost(**history):
        images = zip(frames(steps, **history), alone)
        return [np.sqrt(np.mean((image - without) ** 2)) / without.mean() for image, without in images]

    half, long = ghost(history=0.5), ghost(history=0.9)
    assert half[0] == 0
    for errors, weight in ((half, 0.5), (long, 0.9)):
        np.testing.assert_allclose(np.array(errors[MOVING + 1 :]) / errors[MOVING:-1], weight, rtol=1e-3)
    assert half[MOVING] < long[MOVING]
