# SPDX-License-Identifier: BSD-3-Clause
"""The pinhole camera: pixel to ray.

Mitsuba's perspective sensor looks along +z of its own frame, with +x to the left of the image and +y up. With the pixel
(i, j) counted from the upper left corner of a W x H image, and a plane before the pinhole on which pixels are squares
of size 1,

    direction ~ forward + ((W - 1)/2 - i) left + ((H - 1)/2 - j) up,   |left| = |up| = 2 tan(fov_x/2) / W,  |forward| =
    1.

Rays start at the pinhole; the near clip plane does not cut the medium away (DESIGN section 6.3).

A direction that is rounded to float32 misses its aim by 6e-8 of the distance: 3e-7 m at a light 5 m away, which is 1e-4
of the height of a ray that passes it at half a pixel, and of the airlight there. So a direction is a sum of two
numbers, `direction + low`, and likewise the camera's vectors. Sums and products keep their rounding errors by the
error-free transformations of `realtime.numerics.error_free`. Only the *aim* needs this: a relative error of the length
scales nothing but rounding.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.numerics.error_free import two_product, two_sum
from realtime.numerics.host_numbers import host_numbers

TILE = 16  #: rays in a tile of neighbouring pixels
SIDE = 4  #: of a tile [pixels]


@dataclass(frozen=True)
class PixelGrid:
    """What kernels read of the size of an image; opaque, so that one kernel serves images of all sizes."""

    columns: Any  #: width of the image [pixels]
    reciprocal: Any  #: 2^(31 + shift) / width, rounded up
    shift: Any  #: bits of width - 1
    half_width: Any  #: (W - 1)/2 [pixels]
    half_height: Any  #: (H - 1)/2 [pixels]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; the arrays are opaque, so a camera that moves recompiles nothing."""

    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Any  #: the pinhole [m]
    forward: Any  #: unit vector to the centre of the image
    left: Any  #: one pixel to the left, at distance 1
    up: Any  #: one pixel up, at distance 1
    forward_low: Any  #: what rounding took from `forward`
    left_low: Any
    up_low: Any
    grid: PixelGrid


@dataclass(frozen=True)
class HostCamera:
    """A camera on the host, vectors as in `Camera` with what rounding took from them, in float64."""

    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Any  #: [m]
    forward: Any
    left: Any
    up: Any


def pixel_grid(width: int, height: int, Float: Any) -> PixelGrid:
    """Return the pixels of an image for a `Camera` whose numbers have the type `Float`."""
    shift = (width - 1).bit_length()
    columns, reciprocal, bits = map(mi.UInt32, (width, -(-(1 << (31 + shift)) // width), shift))
    grid = PixelGrid(columns, reciprocal, bits, Float(0.5 * (width - 1)), Float(0.5 * (height - 1)))
    dr.make_opaque(grid)
    return grid


def row_and_column(camera: Camera, pixel):
    """Return the rows and columns of pixels, given their numbers, row times width plus column, below 2^31.

    A division by a number that the compiler does not know takes as long as ten others. With R = 2^(31 + s)/W + d, 0 <=
    d < 1, is p R = 2^(31 + s) p/W + p d, and the last term too small to lead to the next whole number as long as p W <
    2^(31 + s): W <= 2^s, so for p < 2^31 (Granlund and Montgomery 1994, Theorem 4.2).
    """
    row = dr.mul_hi(2 * pixel, camera.grid.reciprocal) >> camera.grid.shift
    return row, pixel - row * camera.grid.columns


def read_camera(camera: Camera) -> HostCamera:
    """Bring a camera to the host, which waits for the device."""
    high, low = (camera.forward, camera.left, camera.up), (camera.forward_low, camera.left_low, camera.up_low)
    origin, *axes = host_numbers(camera.origin, *high, *low)
    return HostCamera(camera.width, camera.height, origin, *(axes[i] + axes[i + 3] for i in range(3)))


def shifted_camera(camera: Camera, right: float, down: float) -> Camera:
    """Return a camera whose rays pass beside the centres of the pixels.

    Only `forward` changes, by (W - 1)/2 - (i + right) and likewise for rows, so it is of unit length and upright on the
    image to first order in the size of a pixel only: for pictures.

    Parameters
    ----------
    camera
        The camera.
    right, down
        How far beside [pixels].
    """
    host = read_camera(camera)
    forward = host.forward - right * host.left - down * host.up
    Vector = type(camera.forward)
    real = np.float32 if dr.itemsize_v(camera.forward) == 4 else np.float64
    high = forward.astype(real)
    vectors = [Vector(*(float(c) for c in part)) for part in (high, forward - high)]
    dr.make_opaque(*vectors)
    return replace(camera, forward=vectors[0], forward_low=vectors[1])


def resized_camera(camera: Camera, width: int, height: int) -> Camera:
    """Return the camera of the same picture with other pixels, which need not be squares.

    Parameters
    ----------
    camera
        The camera.
    width, height
        Of its image [pixels].
    """
    across, upwards = camera.width / width, camera.height / height
    vectors = [camera.left * across, camera.up * upwards, camera.left_low * across, camera.up_low * upwards]
    dr.make_opaque(*vectors)
    left, up, left_low, up_low = vectors
    grid = pixel_grid(width, height, type(camera.origin.x))
    return replace(camera, width=width, height=height, left=left, up=up, left_low=left_low, up_low=up_low, grid=grid)


def tiled_pixels(width: int, height: int, tile: int = SIDE):
    """Return the pixel numbers (row times width + column) in square tiles, (width times height,), uint32.

    A packet of 16 lanes then covers 4 x 4 pixels, which Embree's coherent traversal rewards; 16 packets cover 16 x 16
    pixels, and 16 of those 64 x 64.
    """
    row, column = np.divmod(np.arange(width * height, dtype=np.uint32), width)
    keys: list[np.ndarray] = [column, row]
    for side in (tile, 4 * tile, 16 * tile):
        keys += [column // side, row // side]
    return np.lexsort(keys).astype(np.uint32)


def ray_directions(camera: Camera, pixel):
    """Return the unit directions through the centres of pixels.

    Parameters
    ----------
    camera
        The camera; its arrays fix the precision of the result.
    pixel
        Pixel numbers, row times width plus column, an unsigned Dr.Jit array.

    Returns
    -------
    direction
        Unit vectors.
    low
        What rounding took from their aim: `direction + low` is right to twice the digits, but for a common factor.
    """
    Float = type(camera.origin.x)
    row, column = row_and_column(camera, pixel)
    # Whole and half numbers: exact.
    i, j = camera.grid.half_width - Float(column), camera.grid.half_height - Float(row)
    across, across_error = two_product(camera.left, i)
    upward, upward_error = two_product(camera.up, j)
    plane, plane_error = two_sum(across, upward)
    aim, aim_error = two_sum(plane, camera.forward)
    low = aim_error + plane_error + across_error + upward_error
    low += camera.forward_low + camera.left_low * i + camera.up_low * j
    scale = dr.rsqrt(dr.squared_norm(aim))
    direction = aim * scale
    return direction, dr.fma(aim, scale, -direction) + low * scale
