# SPDX-License-Identifier: BSD-3-Clause
"""The camera: it looks at the stage, the unit ball about the origin, from outside."""

import math

import numpy as np
from numpy.typing import NDArray

from validation.random_scenes.design import Draws
from validation.random_scenes.ranges import Ranges

Array = NDArray[np.float64]


def draw_camera(draws: Draws, ranges: Ranges) -> tuple[Array, Array, float]:
    """Return origin and target of the camera, in radii of the stage, and its field of view [degrees]."""
    stream = draws.of("camera")
    distance = draws.logarithmic(*ranges.camera_distance, "camera_distance")
    elevation = math.radians(draws.between(*ranges.camera_elevation, "camera_elevation"))
    azimuth = stream.between(0, 2 * math.pi)
    across = math.cos(elevation)
    origin = distance * np.array([across * math.cos(azimuth), across * math.sin(azimuth), math.sin(elevation)])
    return origin, 0.37 * stream.in_ball(), draws.between(*ranges.fov, "fov")
