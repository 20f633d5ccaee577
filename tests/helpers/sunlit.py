# SPDX-License-Identifier: BSD-3-Clause
"""Bounded media under a directional light, and their airlight summed over equal steps in NumPy."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from tests.helpers.scenes import bounded_medium, clear_scene, tiny_scene
from validation.scenes.parts import medium_boundary, placed, rotation
from validation.scenes.solids import box

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


def fog_sphere(**medium: Any) -> dict[str, Any]:
    shape = {"type": "sphere", "center": list(SPHERE_AT), "radius": SPHERE_RADIUS}
    return bounded_medium(shape, (0.9, 0.5, 0.7), (0.9, 0.4, 0.3), **medium)


def shaded(*, size=(16, 12), **changes: Any) -> dict[str, Any]:
    """Return the box of fog over the floor with a solid sphere between it and the sun."""
    solid = {"type": "sphere", "center": [0.33, 0.27, 1.35], "radius": 0.29}
    things = {"lamp": sun(), "cube": cube(), "solid": solid, "floor": tiny_scene()["floor"]}
    return clear_scene(size=size, **(things | changes))


def read(scene: dict[str, Any], precision: str = "double"):
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene

    return read_scene(mi.load_dict(scene), precision)


def render(scene, method="unshadowed", *, precision="double", **parameters):
    """Render a dictionary, or what `read` made of one."""
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS

    chosen = METHODS[method]
    kernel = KERNELS["exact"].function
    scene = read(scene, precision) if isinstance(scene, dict) else scene
    return render_frame(frame_renderer(scene, chosen, kernel=kernel, **parameters))


def relative_rmse(image, reference) -> float:
    return float(np.sqrt(np.mean((np.asarray(image, dtype=np.float64) - reference) ** 2)) / np.mean(reference))


def rays(scene) -> tuple[Array, Array]:
    """Return the camera's place and the directions of all pixels in the order of the image."""
    import drjit as dr
    import mitsuba as mi

    from realtime.scene.camera import ray_directions

    camera = scene.camera
    direction, _ = ray_directions(camera, dr.arange(mi.UInt32, camera.width * camera.height))
    return np.array(camera.origin, dtype=float).ravel(), np.array(direction, dtype=float).T


@dataclass(frozen=True)
class Part:
    """A bounded medium as the sum over steps knows it."""

    chord: Any  #: (start, direction) -> distances at which lines are in it, the first not below 0
    sigma_t: Array
    albedo: Array
    g: float


def box_part(centre=CUBE_AT, sides=SIDES, sigma_t=1.1, g=0.4, turn=TURN) -> Part:
    """Return a box by slabs in its own frame."""

    def chord(start, direction):
        p, d = (start - np.asarray(centre)) @ turn, np.broadcast_to(direction, start.shape) @ turn
        with np.errstate(divide="ignore", invalid="ignore"):
            low_sides, high_sides = (-0.5 * np.asarray(sides) - p) / d, (0.5 * np.asarray(sides) - p) / d
        low = np.maximum(np.fmin(low_sides, high_sides).max(axis=-1), 0)
        return low, np.maximum(np.fmax(low_sides, high_sides).min(axis=-1), low)

    return Part(chord, np.full(3, sigma_t), np.array([0.2, 0.5, 0.9]), g)


def plank_part() -> Part:
    return box_part(PLANK_AT, PLANK_SIDES, 1.7, 0.0)


def sphere_part() -> Part:
    """Return the sphere by the quadratic formula."""

    def chord(start, direction):
        w = start - np.asarray(SPHERE_AT)
        b, c = np.sum(w * direction, axis=-1), np.sum(w * w, axis=-1) - SPHERE_RADIUS**2
        root = np.sqrt(np.maximum(b * b - c, 0))
        low = np.maximum(-b - root, 0)
        return low, np.where(b * b > c, np.maximum(-b + root, low), low)

    return Part(chord, np.array([0.9, 0.5, 0.7]), np.array([0.9, 0.4, 0.3]), 0.0)


def summed(scene, parts, *, along=ALONG, steps=10_000, distance=None, lit=lambda point: True) -> Array:
    """Sum the airlight of a directional light over equal steps of every chord; `scene` is for its camera."""
    axis = unit(along)
    origin, directions = rays(scene)
    image = np.zeros((len(directions), 3))
    for pixel, direction in enumerate(directions):
        for part in parts:
            low, high = part.chord(origin[None, :], direction)
            high = np.minimum(high, np.inf if distance is None else distance.ravel()[pixel])
            if not high[0] > low[0]:
                continue
            width = (high[0] - low[0]) / steps
            x = low[0] + (np.arange(steps) + 0.5) * width
            point = origin + x[:, None] * direction
            tau = np.zeros((steps, 3))
            for other in parts:
                begin, end = other.chord(origin[None, :], direction)
                tau += other.sigma_t * np.clip(x - begin[0], 0, end[0] - begin[0])[:, None]
                near, far = other.chord(point, -axis)
                tau += other.sigma_t * (far - near)[:, None]
            g, cosine = part.g, -direction @ axis
            p = (1 - g * g) / (1 + g * g - 2 * g * cosine) ** 1.5
            reached = np.broadcast_to(lit(point), steps)[:, None]
            image[pixel] += part.albedo * part.sigma_t * p * width * np.sum(np.exp(-tau) * reached, axis=0)
    camera = scene.camera
    return (image * np.array([3.0, 2.0, 1.0]) / (4 * np.pi)).reshape(camera.height, camera.width, 3)
