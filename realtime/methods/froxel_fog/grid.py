# SPDX-License-Identifier: BSD-3-Clause
"""The grid of a view: columns of froxels behind equal rectangles of the image, cut by planes across its axis.

A place is (u, v, s), all from 0 to 1: u and v across the image from its upper left corner, s in depth. With the camera
of `realtime.scene.camera`, W x H pixels, it is the point

    origin + z(s) (forward + W (1/2 - u) left + H (1/2 - v) up),

z the distance along the axis. Slices are equal steps of s. Their distribution is exponential,

    z(s) = near ((1 + far/near)^s - 1),        s(z) = log(1 + z/near) / log(1 + far/near),        near = far/8,

which begins at the camera: up to the depth `near` slices are about equally thick, beyond it in proportion to their
depth. Media beyond `far` scatter nothing.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.interface.method import View
from realtime.numerics.array_types import Metres, PerRay, four_numbers
from realtime.scene.camera import Camera
from realtime.scene.media.medium import Medium, Rays

_RATIO = 8  # far/near
_OPTICAL_REACH = 3.0  # optical depth behind a light that deserves slices: e^-6 = 0.25 % of the light comes back from it
_REACH = 32.0  # the same in distances of the light: the airlight beyond x falls like 1/x


@dataclass(frozen=True)
class Grid:
    """The froxels of one view."""

    width: int  #: froxels across
    height: int  #: froxels down
    slices: int  #: froxels in depth
    camera: Camera
    far: Metres  #: depth where the last slice ends [m]

    @property
    def columns(self) -> int:
        """How many columns of froxels there are."""
        return self.width * self.height

    def depth(self, s: PerRay) -> Metres:
        """Return z(s) [m]."""
        return self.far / _RATIO * (dr.exp(s * math.log(1 + _RATIO)) - 1)

    def fraction(self, depth: Metres) -> PerRay:
        """Return s(z); `depth` is z [m]."""
        return dr.log(1 + depth / self.far * _RATIO) / math.log(1 + _RATIO)

    def column_ray(self, column: PerRay, shift: tuple[Any, Any] = (0, 0)) -> PerRay:
        """Return the vector from the camera to depth 1 in columns, `shift` parts of a froxel beside their middle."""
        Float = type(self.far)
        row = column // self.width
        u = (Float(column - row * self.width) + (0.5 + shift[0])) / self.width
        v = (Float(row) + (0.5 + shift[1])) / self.height
        camera = self.camera
        return camera.forward + camera.left * (camera.width * (0.5 - u)) + camera.up * (camera.height * (0.5 - v))

    def place(self, point: Any) -> tuple[Any, Any, Any]:
        """Return u, v and the depth [m] of points [m]; u and v mean nothing where that is not above 0."""
        camera = self.camera
        across, upward, depth = camera.project(point - camera.origin)
        return 0.5 - across / camera.width, 0.5 - upward / camera.height, depth


def view_grid(view: View, samples: Sequence[Any], *, size: tuple[int, int, int], far: float) -> Grid:
    """Return the grid of a view: froxels across, down and in depth, up to a depth [m]; 0: chosen for the frame.

    `samples`: the places of the samples of area lights [m], a lane each.
    """
    return Grid(*size, view.camera, dr.opaque(type(view.distance), far) if far else _frame_depth(view, samples))


def column_rays(view: View, grid: Grid) -> Rays:
    """Return the middle rays of columns; what the medium finds of them is evaluated once."""
    middle = grid.column_ray(dr.arange(mi.UInt32, grid.columns))
    rays = view.medium.rays(view.origin, middle / dr.norm(middle))
    dr.eval(rays.crossed)
    return rays


def _frame_depth(view: View, samples: Sequence[Any]) -> Metres:
    """Return the depth of the farthest surface, or where rays meet none, where too little light comes from to matter.

    Grids, and media in vacuum, end by themselves.
    """
    Float, medium, forward = type(view.distance), view.medium, view.camera.forward
    met = dr.isfinite(view.distance)
    depth = view.distance * dr.dot(view.direction, forward)
    surfaces = dr.max(dr.select(met, depth, 0))
    last = medium.last_depth(view.camera.origin, forward)
    if last is not None:
        return dr.maximum(dr.select(dr.all(met), dr.minimum(surfaces, last), last), 1e-3)
    beyond = Float(0)
    for light in view.lights:
        if light.source is None:
            beyond = dr.maximum(beyond, _reach(view, light.position, medium))
    for positions in samples:
        beyond = dr.maximum(beyond, dr.max(_reach(view, positions, medium)))
    return dr.maximum(dr.select(dr.all(met), surfaces, dr.maximum(surfaces, beyond)), 1e-3)


def _reach(view: View, position: Any, medium: Medium) -> Metres:
    away = position - view.camera.origin
    reach = dr.minimum(medium.length_of(_OPTICAL_REACH), _REACH * dr.norm(away))
    return dr.maximum(dr.dot(away, view.camera.forward), 0) + reach


def trilinear(volume: Any, size: tuple[int, int, int], place: tuple[Any, Any, Any]) -> Any:
    """Return values between the eight neighbours of a place, a colour.

    `volume`: four numbers a value, across first, then down, then in depth; `size`: how many values there are across,
    down and in depth; `place`: where, in steps of the grid from the first value on; beside the grid it is the value at
    its border.
    """
    Float = type(volume)
    corners, weights = [], []
    for steps, last in zip(place, (count - 1 for count in size), strict=True):
        inside = dr.minimum(dr.maximum(steps, 0), last)
        # A NaN must not become an index out of bounds: whole numbers are bounded again.
        low = dr.minimum(mi.UInt32(inside), last)
        corners.append((low, dr.minimum(low + 1, last)))
        weights.append(inside - Float(low))
    x, y, z = corners
    value = four_numbers(Float)(0)
    for k, layer in enumerate(z):
        for j, row in enumerate(y):
            for i, column in enumerate(x):
                fraction = Float(1)
                for side, weight in zip((i, j, k), weights):
                    fraction = fraction * (weight if side else 1 - weight)
                index = (layer * size[1] + row) * size[0] + column
                value = dr.fma(dr.gather(four_numbers(Float), volume, index), fraction, value)
    return value.xyz
