# SPDX-License-Identifier: BSD-3-Clause
"""Area lights in froxels: one loop over the points of a table is the sum over the lights one by one.

Protects the claim on the order of convergence in `penumbra-plane`.
"""

import numpy as np
import pytest

from realtime.scene.read_scene import read_scene
from tests.helpers.frames import read, relative_rmse, render
from tests.helpers.lamps import lit_by
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


@pytest.mark.parametrize("kind", ["disk", "sphere"])
def test_surfaces_are_those_of_other_methods_and_airlight_nearly(variant, kind):
    scene = read(lit_by(kind))
    froxels = render(scene, "froxel-fog", points=3, width=32, height=24, slices=96, shadow="ray")
    marched = render(scene, "ray-march", points=3, steps=400)
    np.testing.assert_allclose(froxels.surface, marched.surface, rtol=1e-4, atol=1e-5 * marched.surface.mean())
    relative = np.abs(froxels.airlight - marched.airlight) / marched.airlight.mean()
    assert np.median(relative) < 0.03
    mapped = render(scene, "froxel-fog", points=3, width=32, height=24, slices=96, map=512)
    assert np.median(np.abs(mapped.airlight - froxels.airlight) / froxels.airlight.mean()) < 0.003
