# SPDX-License-Identifier: BSD-3-Clause
"""Area lights in froxels: one loop over the points of a table is the sum over the lights one by one.

Protects the claim on the order of convergence in `penumbra-plane`.
"""

import numpy as np
import pytest

from realtime.scene.read_scene import read_scene
from tests.helpers.frames import relative_rmse, render
from validation.scenes.loading import load_scene


@pytest.mark.slow
@pytest.mark.claim("froxel-order", tolerance="at least 0.7 from four grids, a factor of eight apart")
def test_the_error_falls_with_the_grid_under_a_light_with_extent(variant):
    scene = read_scene(load_scene("penumbra-plane", (80, 60)).scene)
    exact = render(scene, "shadow-planes", points=4).airlight
    sizes = np.array([8, 16, 32, 64])
    errors = [
        relative_rmse(render(scene, "froxel-fog", points=4, width=2 * n, height=n, slices=n).airlight, exact)
        for n in sizes.tolist()
    ]
    assert -np.polyfit(np.log(sizes), np.log(errors), 1)[0] > 0.7, errors
    assert errors[-1] < 0.05
