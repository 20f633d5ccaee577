# SPDX-License-Identifier: BSD-3-Clause
"""Claim: order 1 and opacity of the methods for clouds are those of light paths, which
share no code with them.
"""

import numpy as np
import pytest

from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.estimates.images import Budget, monte_carlo_reference
from airlight.validation.scenes.loading import LoadedScene
from tests.helpers.clouds import SUN, cloud, loaded, ring

pytestmark = pytest.mark.usefixtures("variant")

TWO = {
    "type": "homogeneous",
    "sigma_t": {"type": "rgb", "value": [0.0163, 0.0271, 0.0414]},
    "albedo": {"type": "rgb", "value": [0.97, 0.93, 0.89]},
    "phase": {"type": "hg", "g": 0.35},
}


@pytest.mark.statistical
@pytest.mark.slow
@pytest.mark.claim(
    "cloud-single-scattering", tolerance="4.5 standard errors of the mean; seeds are fixed"
)
def test_order_one_is_that_of_light_paths():
    """Two clouds of different droplets, one behind the other and in one another's light."""
    back = cloud("back", ring((61.3, 190.7, -40.1)), TWO)
    scene = loaded(sun=SUN, front=cloud("front", ring()), back=back)
    sampled = monte_carlo_reference(
        LoadedScene("rings", scene, "", ""),
        "cloud-paths",
        budget=Budget(samples=1024),
        orders=("1",),
    ).image
    method = METHODS["cloud-octaves"]
    frame = render_frame(
        frame_renderer(read_scene(scene), method, octaves=1, steps=128, extra_layers=True)
    )
    reference, error = (
        sampled.layers[name].astype(np.float64) for name in ("airlight_1", "airlight_1_se")
    )
    difference = frame.airlight - reference
    assert np.count_nonzero(error) > 150
    # Four batches: the error of a pixel is known to 40 %, that of all pixels together well.
    assert 0.5 < np.sum(difference**2) / np.sum(error**2) < 1.6
    assert abs(difference.sum()) < 4.5 * np.sqrt((error**2).sum())
    assert frame.extra["opacity"] == pytest.approx(sampled.layers["opacity"], abs=1e-3)
