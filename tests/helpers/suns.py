# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes under a directional light that tests share, and their airlight by the plainest of sums."""

from typing import Any

import numpy as np

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
    import mitsuba as mi

    at = mi.ScalarTransform4f().translate(BRICK[0].tolist()).scale(BRICK[1].tolist())
    return bounded_medium({"type": "cube", "to_world": at}, sigma_t, albedo, **medium)


def pearl(sigma_t: Any = 1.3, albedo=(0.2, 0.5, 0.8), **medium: Any) -> dict[str, Any]:
    """Return a sphere of fog."""
    return bounded_medium(
        {"type": "sphere", "center": PEARL[0].tolist(), "radius": PEARL[1]}, sigma_t, albedo, **medium
    )


def sunny(*, size=(12, 9), **changes: Any) -> dict[str, Any]:
    """Return a camera in clear air and a sun; `changes` add or replace entries."""
    scene = clear_scene(size=size, lamp=None, sun=sun()) | changes
    scene["sensor"] |= {"fov": 25.0}  # both media fill most of the view
    return scene


def ball_over_floor() -> dict[str, Any]:
    """Return the entries of the sphere and the floor of the tiny scene."""
    return {name: tiny_scene()[name] for name in ("ball", "floor")}


def chord(name: str, origin, direction) -> tuple[Any, Any]:
    """Return where lines enter and leave the brick or the pearl; 0, 0 where they miss it."""
    if name == "pearl":
        offset = origin - PEARL[0]
        b, c = np.sum(offset * direction, axis=-1), np.sum(offset**2, axis=-1) - PEARL[1] ** 2
        root = np.sqrt(np.maximum(b * b - c, 0))
        return np.where(b * b > c, -b - root, 0), np.where(b * b > c, -b + root, 0)
    with np.errstate(divide="ignore"):
        low_sides, high_sides = ((BRICK[0] + sign * BRICK[1] - origin) / direction for sign in (-1, 1))
    low, high = np.minimum(low_sides, high_sides).max(axis=-1), np.maximum(low_sides, high_sides).min(axis=-1)
    return np.where(high > low, low, 0), np.where(high > low, high, 0)


def midpoint_airlight(truth, number: int, pixel: int, *, steps=200_000, lit=None):
    """Return the airlight that a directional light sends along a pixel's ray, by the midpoint rule in each medium.

    `lit` tells of points whether the light reaches them; all by default.
    """
    light, direction = truth.directional[number], truth.direction[pixel]
    total = np.zeros(3)
    for medium in truth.media:
        near, far = (float(end) for end in chord(medium.name, truth.origin, direction))
        near = max(near, 0.0)
        if far <= near:
            continue
        x = near + (far - near) * (np.arange(steps) + 0.5) / steps
        point = truth.origin + x[:, None] * direction
        tau = np.zeros((steps, 3))
        for other in truth.media:
            low, high = (float(end) for end in chord(other.name, truth.origin, direction))
            tau += np.maximum(np.minimum(x, high) - max(low, 0.0), 0)[:, None] * other.sigma_t
            low, high = chord(other.name, point, np.broadcast_to(-light.direction, point.shape))
            tau += np.maximum(high - np.maximum(low, 0), 0)[:, None] * other.sigma_t
        f = np.exp(-tau) if lit is None else np.exp(-tau) * lit(point)[:, None]
        p = medium.phase(np.array(-light.direction @ direction))
        total += f.sum(axis=0) * (far - near) / steps * medium.sigma_t * medium.albedo * p
    return total * light.irradiance / (4 * np.pi)
