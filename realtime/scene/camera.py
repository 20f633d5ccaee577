# SPDX-License-Identifier: BSD-3-Clause
"""The pinhole camera: pixel to ray.

Mitsuba's perspective sensor looks along +z of its own frame, with +x to the left of the image and
+y up. With the pixel (i, j) counted from the upper left corner of a W x H image, and a plane before
the pinhole on which pixels are squares of size 1,

    direction ~ forward + ((W - 1)/2 - i) left + ((H - 1)/2 - j) up,
    |left| = |up| = 2 tan(fov_x/2) / W,     |forward| = 1.

Rays start at the pinhole; the near clip plane does not cut the medium away (DESIGN section 6.3).

A direction that is rounded to float32 misses its aim by 6e-8 of the distance: 3e-7 m at a light 5 m
away, which is 1e-4 of the height of a ray that passes it at half a pixel, and of the airlight
there. The camera's vectors and the aim of a ray therefore have float64, in which `realtime.rays`
computes once where the ray passes a light; all else has the scene's precision.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import ArrayTypes, host_numbers
from airlight.realtime.transforms import host_matrix

TILE = 16  #: rays in a tile of neighbouring pixels


@dataclass(frozen=True)
class PixelGrid:
    """The size of an image for kernels; opaque, so that one kernel serves images of all sizes."""

    columns: Any  #: width of the image [pixels]
    inverse: Any  #: of that width, in float64 [1/pixels]
    half_width: Any  #: (W - 1)/2 [pixels]
    half_height: Any  #: (H - 1)/2 [pixels]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera; the arrays are opaque, so a camera that moves recompiles nothing."""

    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Any  #: the pinhole [m]
    axes: tuple[Any, Any, Any]  #: `forward`, `left` and `up` in float64
    grid: PixelGrid

    @property
    def forward(self) -> Any:
        """The unit vector to the centre of the image."""
        return type(self.origin)(self.axes[0])

    @property
    def left(self) -> Any:
        """One pixel to the left, at distance 1."""
        return type(self.origin)(self.axes[1])

    @property
    def up(self) -> Any:
        """One pixel up, at distance 1."""
        return type(self.origin)(self.axes[2])

    def project(self, away) -> tuple[Any, Any, Any]:
        """Return the pixels, left of and above the middle of the image, to which vectors `away`
        from the pinhole point, and their depths.

        The depth is the component along `forward`, in the unit of `away`; where it is not above 0
        the pixels mean nothing.
        """
        forward, left, up = (type(away)(axis) for axis in self.axes)
        depth = dr.dot(away, forward)
        # `left` and `up` are as long as a pixel at distance 1, so products with them have their
        # square.
        i, j = (dr.dot(away, side) / (depth * dr.squared_norm(side)) for side in (left, up))
        return i, j, depth


@dataclass(frozen=True)
class HostCamera:
    """A camera on the host, in float64."""

    width: int  #: [pixels]
    height: int  #: [pixels]
    origin: Any  #: [m]
    forward: Any
    left: Any
    up: Any

    @property
    def basis(self) -> Any:
        """`forward`, `left` and `up` as columns."""
        return np.stack([self.forward, self.left, self.up], axis=1)


def pixel_grid(width: int, height: int) -> PixelGrid:
    """Return the pixels of an image for a `Camera`."""
    # (W - 1)/2 and (H - 1)/2: the pixel numbers of the middle of the image.
    halves = (mi.Float64(0.5 * (side - 1)) for side in (width, height))
    grid = PixelGrid(mi.UInt32(width), mi.Float64(1 / width), *halves)
    dr.make_opaque(grid)
    return grid


def sensor_camera(scene, types: ArrayTypes) -> tuple[Camera, Any]:
    """Return the camera of a Mitsuba scene, and the sensor from which it was read.

    Raises InputError for one that is no pinhole camera in the middle of its film.
    """
    sensors = scene.sensors()
    if not sensors:
        raise InputError("the scene has no camera; expected a sensor of type 'perspective'")
    sensor = sensors[0]
    if sensor.class_name() != "PerspectiveCamera":
        raise InputError(
            f"the scene's sensor is a {sensor.class_name()}; expected a sensor of type "
            "'perspective'"
        )
    # The whole film, with the pinhole before its middle.
    parameters = mi.traverse(sensor)
    width, height = (int(n) for n in parameters["film.size"])
    if list(parameters["film.crop_size"]) != [width, height]:
        raise InputError(
            "the camera's film is cropped; remove crop_width, crop_height and crop_offset from the "
            "film"
        )
    if any(float(parameters[f"principal_point_offset_{axis}"][0]) for axis in "xy"):
        raise InputError(
            "the camera has a principal point offset; remove principal_point_offset_x and _y"
        )
    # Columns of the camera's to_world: +x is left in the image, +y up, +z into the scene. Pixels
    # are squares, 2 tan(fov_x/2)/W wide at distance 1.
    matrix = host_matrix(sensor.world_transform())
    tangent = math.tan(0.5 * math.radians(float(parameters["x_fov"][0])))
    pixel = 2 * tangent / width
    basis = matrix[:3, 2], matrix[:3, 0] * pixel, matrix[:3, 1] * pixel
    forward, left, up = (mi.Vector3d(*(float(c) for c in column)) for column in basis)
    origin = types.vector(*(float(c) for c in matrix[:3, 3]))
    # Opaque: a kernel for one camera serves for all of its places.
    dr.make_opaque(origin, forward, left, up)
    return Camera(width, height, origin, (forward, left, up), pixel_grid(width, height)), sensor


def row_and_column(camera: Camera, pixel):
    """Return the rows and columns of pixels, given their numbers, row times width
    plus column, below 2^31.

    A division of whole numbers by one that the compiler does not know takes as long as ten
    products. They are therefore multiplied in float64: the rounding of (p + 1/2)/W is below the
    distance 1/(2 W) to the next whole number.
    """
    row = mi.UInt32((mi.Float64(pixel) + 0.5) * camera.grid.inverse)
    return row, pixel - row * camera.grid.columns


def read_camera(camera: Camera) -> HostCamera:
    """Bring a camera to the host, which waits for the device."""
    return HostCamera(camera.width, camera.height, *host_numbers(camera.origin, *camera.axes))


def shifted_camera(camera: Camera, right: float, down: float) -> Camera:
    """Return a camera whose rays pass beside the centres of the pixels.

    Only `forward` changes, by (W - 1)/2 - (i + right) and likewise for rows, so it is of unit
    length and upright on the image to first order in the size of a pixel only: for pictures.

    `camera`: the camera; `right`, `down`: how far beside [pixels].
    """
    host = read_camera(camera)
    # The place (i + right, j + down) of the image: `forward` moves to the right and down.
    forward = mi.Vector3d(*(float(c) for c in host.forward - right * host.left - down * host.up))
    dr.make_opaque(forward)
    return replace(camera, axes=(forward, *camera.axes[1:]))


def resized_camera(camera: Camera, width: int, height: int) -> Camera:
    """Return the camera of the same picture with other pixels, which need not be squares.

    `camera`: the camera; `width`, `height`: of its image [pixels].
    """
    forward, left, up = camera.axes
    # The same picture in other pixels: left W and up H stay.
    left, up = left * (camera.width / width), up * (camera.height / height)
    dr.make_opaque(left, up)
    return replace(
        camera, width=width, height=height, axes=(forward, left, up), grid=pixel_grid(width, height)
    )


def tiled_pixels(width: int, height: int):
    """Return the pixel numbers (row times width + column) in square tiles,
    (width times height,), uint32.

    A packet of 16 lanes then covers 4 x 4 pixels, which Embree's coherent traversal rewards; 16
    packets cover 16 x 16 pixels, and 16 of those 64 x 64.
    """
    row, column = np.divmod(np.arange(width * height, dtype=np.uint32), width)
    keys: list[np.ndarray] = [column, row]
    # `lexsort` sorts by its last key first: by squares of 64 x 64 pixels, in each by 16 x 16, by
    # tiles of 4 x 4, and in a tile by row and column.
    for side in (4, 16, 64):
        keys += [column // side, row // side]
    return np.lexsort(keys).astype(np.uint32)


def ray_directions(camera: Camera, pixel):
    """Return the unit directions through the centres of pixels, and the same of
    about unit length in float64.

    `pixel` are numbers, row times width plus column, an unsigned Dr.Jit array.
    """
    row, column = row_and_column(camera, pixel)
    i, j = camera.grid.half_width - mi.Float64(column), camera.grid.half_height - mi.Float64(row)
    forward, left, up = camera.axes
    # The aim keeps float64 for what lies near a light; the unit direction has the precision of the
    # scene.
    aim = dr.fma(left, i, dr.fma(up, j, forward))
    return type(camera.origin)(aim * dr.rcp(dr.norm(aim))), aim
