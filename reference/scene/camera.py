# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays in float64: directions through positions on the film of a perspective camera.

Mitsuba's own `sample_ray` gives them in float32, and from the near clip plane on; near a light that rounding is worth
1e-5 of the airlight. Here they are derived in units of a pixel on the plane where pixels are squares of size 1; a test
holds them against `sample_ray`.
"""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def film_directions(sensor, positions: Array, size: tuple[int, int]) -> Array:
    """Return the unit directions through positions on the film, (n, 3) [1].

    `sensor`: a perspective sensor of Mitsuba; `positions`: columns and rows from the upper left corner, (n, 2)
    [pixels]: pixel centres end in one half; `size`: width and height of the film [pixels].

    Valid for positions outside of the film too.
    """
    width, height = size
    half_width = np.tan(0.5 * np.deg2rad(float(mi.traverse(sensor)["x_fov"][0])))
    pixel = 2 * half_width / width
    # In the camera's own frame x points left and y up.
    focal = np.full(len(positions), 1 / pixel)
    plane = np.stack([0.5 * width - positions[:, 0], 0.5 * height - positions[:, 1], focal], axis=1)
    direction = plane @ camera_matrix(sensor)[:3, :3].T
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def pixel_centres(size: tuple[int, int]) -> Array:
    """Return the centres of the pixels of a film of this width and height, row by row, (pixels, 2) [pixels]."""
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    return np.stack([column + 0.5, row + 0.5], axis=1)


def camera_matrix(sensor) -> Array:
    """Return the transform from the camera's own frame to the world, (4, 4), both in [m]."""
    return np.array(sensor.world_transform().matrix, dtype=np.float64).reshape(4, 4)
