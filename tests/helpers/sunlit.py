# SPDX-License-Identifier: BSD-3-Clause
"""Bounded media under a directional light."""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.scene.camera import ray_directions
from airlight.validation.scenes.meshes import box, placed, rotation
from airlight.validation.scenes.parts import medium_boundary
from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene

Array = NDArray[np.float64]

TURN = rotation((0.4, 1.0, 0.1), 33.0)
SIDES = np.array([1.1, 0.9, 1.4])
CUBE_AT = (0.7, 0.5, 0.8)
SPHERE_AT, SPHERE_RADIUS = (-0.9, 0.1, 1.6), 0.55
PLANK_AT, PLANK_SIDES = (-0.5, 0.2, 2.1), np.array([1.3, 0.8, 0.25])
ALONG = (0.51, 0.29, -0.81)


def sun(direction=ALONG, irradiance=(3.0, 2.0, 1.0)) -> dict[str, Any]:
    return {
        "type": "directional",
        "direction": list(direction),
        "irradiance": {"type": "rgb", "value": list(irradiance)},
    }


def unit(vector) -> Array:
    return np.asarray(vector, dtype=float) / np.linalg.norm(vector)


def cube(*, centre=CUBE_AT, sides=SIDES, turn=TURN, sigma_t=1.1, g=0.4) -> dict[str, Any]:
    medium = {
        "type": "homogeneous",
        "sigma_t": sigma_t,
        "albedo": {"type": "rgb", "value": [0.2, 0.5, 0.9]},
        "phase": {"type": "hg", "g": g},
    }
    return medium_boundary("cube", placed(box(tuple(sides)), centre, turn), medium)


def plank() -> dict[str, Any]:
    return cube(centre=PLANK_AT, sides=PLANK_SIDES, sigma_t=1.7, g=0.0)


def fog_sphere(
    centre=SPHERE_AT, radius=SPHERE_RADIUS, sigma_t: Any = (0.9, 0.5, 0.7), **medium: Any
) -> dict[str, Any]:
    return bounded_medium(
        {"type": "sphere", "center": list(centre), "radius": radius},
        sigma_t,
        (0.9, 0.4, 0.3),
        **medium,
    )


def shaded(*, size=(16, 12), **changes: Any) -> dict[str, Any]:
    """Return the box of fog over the floor with a solid sphere between it and the sun."""
    solid = {"type": "sphere", "center": [0.33, 0.27, 1.35], "radius": 0.29}
    things = {"lamp": sun(), "cube": cube(), "solid": solid, "floor": tiny_scene()["floor"]}
    return clear_scene(size=size, **(things | changes))


def rays(scene) -> tuple[Array, Array]:
    """Return the camera's place and the directions of all pixels in the order of the image."""
    camera = scene.camera
    direction, _ = ray_directions(camera, dr.arange(mi.UInt32, camera.width * camera.height))
    return np.array(camera.origin, dtype=float).ravel(), np.array(direction, dtype=float).T
