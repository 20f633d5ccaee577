# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes with a box and a sphere of fog, under a directional light or a lamp, and
their airlight by a sum.
"""

from typing import Any

import mitsuba as mi
import numpy as np

from tests.helpers import airlight_sum
from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene

TOWARDS = np.array([-0.37, 0.23, 0.81]) / np.linalg.norm([-0.37, 0.23, 0.81])


def sun(direction=None, irradiance=(5.0, 4.0, 3.0)) -> dict[str, Any]:
    """Return a directional light; `direction` is that in which it shines."""
    way = -TOWARDS if direction is None else np.asarray(direction)
    return {
        "type": "directional",
        "direction": [float(c) for c in way],
        "irradiance": {"type": "rgb", "value": list(irradiance)},
    }


# Numbers that are exact in float32: the chords below are those of Mitsuba's shapes to all digits.
BRICK = np.array([-0.5, 0.125, 0.59375]), np.array([0.3125, 0.4375, 0.375])  # centre, half edges
PEARL = np.array([0.5, 0.1875, 0.59375]), 0.4375  # centre, radius


def brick(sigma_t: Any = (0.9, 0.5, 0.2), albedo=(0.9, 0.4, 0.3), **medium: Any) -> dict[str, Any]:
    """Return a box of fog."""
    at = mi.ScalarTransform4f().translate(BRICK[0].tolist()).scale(BRICK[1].tolist())
    return bounded_medium({"type": "cube", "to_world": at}, sigma_t, albedo, **medium)


def pearl(sigma_t: Any = 1.3, albedo=(0.2, 0.5, 0.8), **medium: Any) -> dict[str, Any]:
    """Return a sphere of fog."""
    return bounded_medium(
        {"type": "sphere", "center": PEARL[0].tolist(), "radius": PEARL[1]},
        sigma_t,
        albedo,
        **medium,
    )


def sunny(*, size=(12, 9), **changes: Any) -> dict[str, Any]:
    """Return a camera in vacuum and a sun; `changes` add or replace entries."""
    scene = clear_scene(size=size, lamp=None, sun=sun()) | changes
    scene["sensor"] |= {"fov": 25.0}  # both media fill most of the view
    return scene


def ball_over_floor() -> dict[str, Any]:
    """Return the entries of the sphere and the floor of the tiny scene."""
    return {name: tiny_scene()[name] for name in ("ball", "floor")}


CHORDS = {"brick": airlight_sum.box(*BRICK), "pearl": airlight_sum.ball(*PEARL)}


def plain_airlight(reference, pixel: int, **how: Any):
    """Return the airlight along a pixel's ray from the only light of a scene with brick
    and pearl, by a plain sum.
    """
    if reference.lights:
        light = airlight_sum.Light(reference.lights[0].position, 1.0, reference.lights[0].intensity)
    else:
        light = airlight_sum.Light(
            -reference.directional[0].direction, 0.0, reference.directional[0].irradiance
        )
    bodies, around = airlight_sum.bodies_of(reference, CHORDS)
    return airlight_sum.airlight_sum(
        reference.origin, reference.direction[pixel], light, bodies, around=around, **how
    )
