# SPDX-License-Identifier: BSD-3-Clause
"""The pinhole camera: pixel to ray.

Mitsuba's perspective sensor looks along +z of its own frame, with +x to the left of the image and +y up. A pixel (i, j)
of a W x H image has the centre u = (i + 1/2)/W, v = (j + 1/2)/H from the upper left corner, and

    direction ~ forward + (1 - 2u) tan(fov_x/2) left + (1 - 2v) tan(fov_x/2) (H/W) up.

`Camera` keeps the three vectors with the tangents multiplied in. Rays start at the pinhole; the near clip plane does
not cut the medium away (DESIGN section 6.3).
"""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; the arrays are opaque, so a camera that moves recompiles nothing."""

    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Any  #: the pinhole [m]
    forward: Any  #: unit vector to the centre of the image
    left: Any  #: half the width of the image plane at distance 1
    up: Any  #: half the height of the image plane at distance 1


def tiled_pixels(width: int, height: int, tile: int = 4):
    """Return the pixel numbers (row width + column) in square tiles, as uint32.

    A packet of 16 lanes then covers 4 x 4 pixels, which Embree's coherent traversal rewards.
    """
    import numpy as np

    row, column = np.divmod(np.arange(width * height, dtype=np.uint32), width)
    return np.lexsort((column, row, column // tile, row // tile)).astype(np.uint32)


def ray_directions(camera: Camera, pixel):
    """Return the unit direction through the centre of each pixel.

    Parameters
    ----------
    camera
        The camera; its arrays fix the precision of the result.
    pixel
        Pixel numbers, row times width plus column, an unsigned Dr.Jit array.
    """
    import drjit as dr

    Float = type(camera.origin.x)
    row = pixel // camera.width
    column = pixel - row * camera.width
    across = dr.fma(Float(column), -2.0 / camera.width, 1.0 - 1.0 / camera.width)
    upward = dr.fma(Float(row), -2.0 / camera.height, 1.0 - 1.0 / camera.height)
    return dr.normalize(camera.forward + camera.left * across + camera.up * upward)
