# SPDX-License-Identifier: BSD-3-Clause
"""Fog and a lamp in view, no occluder and no surface."""

from typing import Any

from validation.scenes.parts import camera, fog, point_light


def open_fog() -> dict[str, Any]:
    """Return a point light 5.4 m before the camera in grey fog of optical depth 0.94 to the light, isotropic."""
    return {
        "type": "scene",
        "fog": fog(0.173, (0.93, 0.87, 0.78)),
        "sensor": camera((0.31, -4.87, 1.13), (0.07, 0.23, 0.91), fov=58.3, size=(800, 600)),
        "lamp": point_light((0.83, 0.47, 1.57), (23.1, 19.7, 14.3)),
    }
