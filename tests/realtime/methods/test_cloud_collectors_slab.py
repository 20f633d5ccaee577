# SPDX-License-Identifier: BSD-3-Clause
"""A slab through the whole method, its grid included, against its exact radiance: the
claim of cloud-collectors.

The exact radiance is that of `realtime.clouds.slab_orders`, which DISORT checks in
`tests/realtime/clouds`. The grid is made for thicknesses and suns about those of the slab alone:
those of all would take minutes.
"""

import mitsuba as mi
import numpy as np
import pytest

import airlight.realtime.clouds.canonical.transport_grid as grid
from airlight.realtime.clouds.canonical import coordinates
from airlight.realtime.clouds.slab_orders.phases import HenyeyGreensteinPhase
from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.camera import ray_directions
from airlight.realtime.scene.read_scene import read_scene
from airlight.validation.scenes.meshes import box, placed
from airlight.validation.scenes.parts import camera
from airlight.validation.slab.radiance import slab_radiance
from tests.helpers.clouds import DROPLETS, cloud

THICKNESS, EXTINCTION, G, ALBEDO = 110.3, 0.0363, 0.85, 0.99
AXIS = np.array([0.517, 0.211, -0.829]) / np.linalg.norm([0.517, 0.211, -0.829])


@pytest.mark.slow
@pytest.mark.claim("collector-slab", tolerance="2 % RMSE of the mean: linear entries of the grid")
@pytest.mark.parametrize("peak", ["matched", "full"])
def test_a_slab_is_exact_to_two_percent(variant, monkeypatch, peak):
    for name, value in (("THINNEST", 3.0), ("THICKEST", 4.8), ("LOWEST_SUN", 0.7)):
        monkeypatch.setattr(coordinates, name, value)
    monkeypatch.setattr(grid, "SIDES", (4, 8, 4, 33, 9))
    medium = DROPLETS | {"sigma_t": EXTINCTION, "albedo": ALBEDO, "phase": {"type": "hg", "g": G}}
    scene = {
        "type": "scene",
        "sensor": camera(
            (-373.0, 29.0, 403.7), (0.0, 47.0, 137.0), fov=71.3, size=(12, 16), in_fog=False
        ),
        "sun": {
            "type": "directional",
            "direction": list(AXIS),
            "irradiance": {"type": "rgb", "value": 1.0},
        },
        "slab": cloud(
            "slab",
            placed(box((20000.0, 20000.0, THICKNESS)), (11.3, -17.9, 0.5 * THICKNESS)),
            medium,
        ),
    }
    read = read_scene(mi.load_dict(scene))
    renderer = frame_renderer(read, METHODS["cloud-collectors"], peak=peak, steps=64, iterations=14)
    shown = np.array(render_frame(renderer).airlight)[..., 1].ravel()
    pixels = mi.UInt32(np.arange(shown.size))
    back = -np.array(ray_directions(read.camera, pixels)[0]).T
    horizontal = AXIS[:2] / np.linalg.norm(AXIS[:2])
    phi = np.arctan2(
        back[:, 1] * horizontal[0] - back[:, 0] * horizontal[1], back[:, :2] @ horizontal
    )
    asked = back[:, 2] > 0.1
    assert asked.mean() > 0.5
    directions = list(zip(back[asked, 2], phi[asked]))
    phase = HenyeyGreensteinPhase(G)
    mu0, tau = -AXIS[2], EXTINCTION * THICKNESS
    (exact,) = slab_radiance(
        tau, mu0, phase, ALBEDO, depths=[0.0], directions=directions, streams=64
    )
    assert np.sqrt(np.mean((shown[asked] - exact) ** 2)) / exact.mean() < 0.02
