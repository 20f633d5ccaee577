# SPDX-License-Identifier: BSD-3-Clause
"""A sphere below a spot light, over a floor: Biri 2006, section 6."""

from typing import Any

import mitsuba as mi
import numpy as np

from validation.scenes.parts import camera, fog, grid, lathe, mitsuba_mesh, placed

_LIGHT = (0.37, 0.29, 4.31)
_CENTRE = (0.11, -0.07, 1.93)
_RADIUS = 0.47


def sphere_spot() -> dict[str, Any]:
    """Return a sphere of 32 x 17 facets, its axis towards the light, so that the silhouette is one ring of 32 edges."""
    return {
        "type": "scene",
        "fog": fog(0.237, (0.91, 0.89, 0.83)),
        "sensor": camera((0.63, -5.31, 1.87), (0.19, 0.05, 1.63), fov=51.7, size=(800, 600)),
        "spot": {
            "type": "spot",
            "to_world": mi.ScalarTransform4f().look_at(origin=_LIGHT, target=_CENTRE, up=[0, 1, 0]),
            "cutoff_angle": 24.3,
            "beam_width": 24.3,
            "intensity": {"type": "rgb", "value": [67.0, 71.0, 83.0]},
        },
        "sphere": mitsuba_mesh("sphere", _sphere(), (0.57, 0.31, 0.23)),
        "floor": mitsuba_mesh(
            "floor", grid((-9.1, -6.3, -0.03), (18.2, 0, 0), (0, 15.7, 0), (1, 1)), (0.43, 0.41, 0.37)
        ),
    }


def _sphere():
    # Rings lie in the middle of 17 equal bands of the polar angle, and fans close the ends. The rotation points the
    # axis at the light.
    polar = np.pi * (1 - (np.arange(17) + 0.5) / 17)
    sphere = lathe(_RADIUS * np.sin(polar), _RADIUS * np.cos(polar), 32)
    towards = np.subtract(_LIGHT, _CENTRE)
    towards = towards / np.linalg.norm(towards)
    side = np.cross(towards, (1.0, 0.0, 0.0))
    side = side / np.linalg.norm(side)
    return placed(sphere, _CENTRE, np.stack([np.cross(side, towards), side, towards], axis=1))
