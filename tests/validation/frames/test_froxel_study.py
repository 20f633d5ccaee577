# SPDX-License-Identifier: BSD-3-Clause
"""The study of froxel fog: finer grids err less, and ghosts fade by the weight of the history once the light rests."""

import numpy as np
import pytest

from tests.helpers.area_lamps import lit_by


def scene():
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene

    return read_scene(mi.load_dict(lit_by("disk")))


def test_errors_fall_with_the_grid(variant):
    from validation.frames.froxel_study import grid_errors

    errors = [each.p50 for each in grid_errors(scene(), [(4, 3, 6), (16, 12, 48)], points=2)]
    assert errors[1] < 0.3 * errors[0]


@pytest.mark.claim("froxel-ghost", tolerance="1e-3 relative, while the ghost is above rounding")
def test_a_ghost_fades_by_the_weight_when_the_light_rests(variant):
    from validation.frames.froxel_study import ghosts
    from validation.scenes.record import Animation

    kinds = ((0.5, False), (0.9, False), (0.9, True))
    half, long, clamped = ghosts(scene(), Animation(), kinds, grid=(16, 12, 24), points=2, turn=0.2, frames=(3, 5))
    assert half.errors[0] == 0
    for ghost in (half, long):
        falls = np.array(ghost.errors[4:]) / ghost.errors[3:-1]
        np.testing.assert_allclose(falls, ghost.weight, rtol=1e-3)
    assert half.errors[3] < long.errors[3]
    assert clamped.errors[3] < long.errors[3]
