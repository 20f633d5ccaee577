# SPDX-License-Identifier: BSD-3-Clause
"""Camera rays in float64: directions through positions on the film of a perspective camera.

Mitsuba's own `sample_ray` gives them in float32, and from the near clip plane on; near a light this
rounding changes the airlight by 1e-5. Here directions are derived in units of a pixel on the plane
where pixels are squares of size 1; a test compares them with `sample_ray`.
"""

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.transforms import matrix_of

Array = NDArray[np.float64]


def perspective_sensor(scene: "mi.Scene") -> "mi.Sensor":
    """Return the camera of a scene, its first sensor.

    Raises InputError for a scene without a sensor, or for a sensor of another type.
    """
    if not scene.sensors():
        raise InputError("the scene has no camera; expected a sensor of type 'perspective'")
    sensor = scene.sensors()[0]
    if sensor.class_name() != "PerspectiveCamera":
        raise InputError(
            f"the camera is a {sensor.class_name()}; expected a sensor of type 'perspective'"
        )
    return sensor


def film_directions(sensor: "mi.Sensor", positions: Array, size: tuple[int, int]) -> Array:
    """Return the unit directions through positions on the film, (n, 3) [1].

    `sensor`: a perspective sensor; `positions`: columns and rows from the upper left corner, (n, 2)
    [pixels]: pixel centres end in one half; `size`: width and height of the film [pixels].

    Valid for positions outside of the film too.
    """
    focal, principal = _pinhole(sensor, size)
    # In the camera's own frame x points left and y up.
    plane = np.concatenate([principal - positions, np.full((len(positions), 1), focal)], axis=1)
    direction = plane @ camera_matrix(sensor)[:3, :3].T
    return direction / np.linalg.norm(direction, axis=1, keepdims=True)


def film_positions(sensor: "mi.Sensor", directions: Array, size: tuple[int, int]) -> Array:
    """Return the positions on the film through which directions of any length go, (n, 2) [pixels];
    NaN for directions that point behind the camera.
    """
    local = np.linalg.solve(camera_matrix(sensor)[:3, :3], directions.T).T
    focal, principal = _pinhole(sensor, size)
    depth = np.where(local[:, 2] > 0, local[:, 2], np.nan)
    return principal - local[:, :2] * (focal / depth)[:, None]


def _pinhole(sensor: "mi.Sensor", size: tuple[int, int]) -> tuple[float, Array]:
    """Return the distance of the film and the position on the film through which the camera's axis
    goes, (2,) [pixels].

    Mitsuba adds the offsets of the principal point, fractions of the film, to each position.
    """
    parameters = mi.traverse(sensor)
    # The width of a pixel at a distance of 1: the field of view is across the width of the film.
    pixel = 2 * np.tan(0.5 * np.deg2rad(float(parameters["x_fov"][0]))) / size[0]
    offset = [float(parameters[f"principal_point_offset_{axis}"][0]) for axis in "xy"]
    return float(1 / pixel), (0.5 - np.array(offset)) * size


def pixel_centres(size: tuple[int, int]) -> Array:
    """Return the centres of the pixels of a film of this width and height, row by
    row, (pixels, 2) [pixels].
    """
    row, column = np.divmod(np.arange(size[0] * size[1]), size[0])
    return np.stack([column + 0.5, row + 0.5], axis=1)


def camera_matrix(sensor: "mi.Sensor") -> Array:
    """Return the transform from the camera's own frame to the world, (4, 4), both in [m]."""
    return matrix_of(sensor.world_transform())
