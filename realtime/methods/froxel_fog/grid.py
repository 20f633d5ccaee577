# SPDX-License-Identifier: BSD-3-Clause
"""The grid of a view: columns of froxels behind equal rectangles of the image, cut
by planes across its axis.

A place is (u, v, s), all from 0 to 1: u and v across the image from its upper left corner, s in
depth. With the camera of `realtime.scene.camera`, W x H pixels, it is the point

    origin + z(s) (forward + W (1/2 - u) left + H (1/2 - v) up),

z the distance along the axis. Slices are equal steps of s. Their distribution is exponential,

    z(s) = near ((1 + far/near)^s - 1),        s(z) = log(1 + z/near) / log(1 + far/near),        near = far/8,

which begins at the camera: up to the depth `near` slices are about equally thick, beyond it in
proportion to their depth. Media beyond `far` scatter nothing.

**The airlight from the camera to the end of each slice, and from there to any depth.**

Along a ray the airlight is L(x) = int_0^x S(y) exp(-tau(y)) dy, with S the scattered light and tau
the optical depth from the camera, tau' = sigma. Let S and sigma be constant in a slice [x_k, x_k +
D]. There tau(y) = tau_k + sigma (y - x_k), and

    int_{x_k}^{x_k + D} S exp(-tau(y)) dy = S exp(-tau_k) (1 - exp(-sigma D)) / sigma,

which goes to S exp(-tau_k) D with sigma. Front to back, with T_k = exp(-tau_k):

    L_{k+1} = L_k + T_k S_k D_k (1 - exp(-z))/z,    T_{k+1} = T_k exp(-z),    z = sigma_k D_k;    L_0 = 0, T_0 = 1.

The slices of a constant medium in constant light therefore add up to S (1 - exp(-sigma x)) / sigma
for any number and depths of slices. Multiplying S D by T_k instead is too bright by a factor of 1 +
z/2, and by T_{k+1} too dark by as much (Hillaire 2015).

Between the ends of slices, and between columns, a pixel interpolates linearly in (u, v, s).

References
----------
Hillaire 2015, *Physically-based and unified volumetric rendering in Frostbite* (the integral within
a slice). Wronski 2014 (the grid, and its sum front to back).
"""

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import drjit as dr
import mitsuba as mi

from airlight.realtime.methods.interface.method import View
from airlight.realtime.numerics.array_types import Metres, PerRay, four_numbers
from airlight.realtime.numerics.functions import between_entries, exp_expm1_bounded
from airlight.realtime.scene.camera import Camera, row_and_column
from airlight.realtime.scene.media.medium import Medium, Rays

#: Keeps a grid from having no depth at all [m]: far below any scene, and its square is a float32.
_LEAST_DEPTH = 1e-15


@dataclass(frozen=True)
class Grid:
    """The froxels of one view."""

    width: int  #: froxels across
    height: int  #: froxels down
    slices: int  #: froxels in depth
    camera: Camera
    far: Metres  #: depth where the last slice ends [m]
    ratio: ClassVar[int] = 8  #: far/near

    @property
    def columns(self) -> int:
        """How many columns of froxels there are."""
        return self.width * self.height

    def depth(self, s: PerRay) -> Metres:
        """Return z(s) [m]."""
        return self.far / self.ratio * (dr.exp(s * math.log(1 + self.ratio)) - 1)

    def fraction(self, depth: Metres) -> PerRay:
        """Return s(z); `depth` is z [m]."""
        return dr.log(1 + depth / self.far * self.ratio) / math.log(1 + self.ratio)

    def column_ray(self, column: PerRay, shift: tuple[Any, Any] = (0, 0)) -> PerRay:
        """Return the vector from the camera to depth 1 in columns, `shift` parts of a
        froxel beside their middle.
        """
        Float = type(self.far)
        row = column // self.width
        u = (Float(column - row * self.width) + (0.5 + shift[0])) / self.width
        v = (Float(row) + (0.5 + shift[1])) / self.height
        camera = self.camera
        return (
            camera.forward
            + camera.left * (camera.width * (0.5 - u))
            + camera.up * (camera.height * (0.5 - v))
        )


def view_grid(view: View, *, size: tuple[int, int, int], far: float) -> Grid:
    """Return the grid of a view: froxels across, down and in depth, up to a depth [m];
    0: chosen for the frame.
    """
    return Grid(
        *size, view.camera, dr.opaque(type(view.distance), far) if far else _frame_depth(view)
    )


def column_rays(view: View, grid: Grid) -> Rays:
    """Return the middle rays of columns; what the medium finds of them is evaluated once."""
    middle = grid.column_ray(dr.arange(mi.UInt32, grid.columns))
    rays = view.medium.rays(view.origin, middle / dr.norm(middle))
    dr.eval(rays.crossed)
    return rays


def _frame_depth(view: View) -> Metres:
    """Return the depth of the farthest surface; where rays meet none, the depth behind which too
    little light is scattered back to matter.

    Grids, and media in vacuum, end by themselves.
    """
    Float, medium, forward = type(view.distance), view.medium, view.camera.forward
    # If all rays meet surfaces, the farthest surface is the end. A ray that meets none needs the
    # grid up to where the medium ends, or where the light fades.
    met = dr.isfinite(view.distance)
    depth = view.distance * dr.dot(view.direction, forward)
    surfaces = dr.max(dr.select(met, depth, 0))
    medium_end = medium.last_depth(view.camera.origin, forward)
    if medium_end is not None:
        end = dr.select(dr.all(met), dr.minimum(surfaces, medium_end), medium_end)
        return dr.maximum(end, _LEAST_DEPTH)
    # In an unbounded medium the farthest reach of all lights counts.
    beyond = Float(0)
    for table in view.tables:
        reach = _reach(view, table[dr.arange(mi.UInt32, table.count)].position, medium)
        beyond = dr.maximum(beyond, reach if table.count == 1 else dr.max(reach))
    end = dr.select(dr.all(met), surfaces, dr.maximum(surfaces, beyond))
    return dr.maximum(end, _LEAST_DEPTH)


def _reach(view: View, position: Any, medium: Medium) -> Metres:
    # Behind the light, slices reach to the optical depth of 3, as e^-6 = 0.25 % of the light comes
    # back from there; and to 32 distances of the light, as the airlight beyond x falls like 1/x.
    away = position - view.camera.origin
    reach = dr.minimum(medium.length_of(3.0), 32.0 * dr.norm(away))
    return dr.maximum(dr.dot(away, view.camera.forward), 0) + reach


def accumulated(view: View, grid: Grid, rays: Rays, scattered: PerRay) -> Any:
    """Return the airlight up to the begin and the end of each slice, (slices + 1) values a
    column, four numbers each.

    `view`, `grid`, `rays`: the frame, its froxels, and the middle rays of columns; `scattered`: by
    froxel, a colour [W/(m^3 sr)], evaluated.
    """
    Float, Color, medium = type(view.distance), type(scattered), view.medium
    # One lane a column: `stretch` turns depths along the axis into distances along its middle ray.
    column = dr.arange(mi.UInt32, grid.columns)
    stretch = dr.norm(grid.column_ray(column))
    # Slice by slice from front to back; the first of the slices + 1 values is that at the camera,
    # 0.
    volume = dr.zeros(Float, 4 * (grid.slices + 1) * grid.columns)

    def step(number, x, transmittance, total):
        end = grid.depth((Float(number) + 1) / grid.slices) * stretch
        thickness = end - x
        # L_{k+1} = L_k + T_k S_k D_k (1 - exp(-z))/z, channel by channel, z the optical depth of
        # the slice.
        depths = medium.optical_depth(rays, x, end)
        source = dr.gather(Color, scattered, number * grid.columns + column)
        passed = [exp_expm1_bounded(-depth) for depth in depths]
        weights = [
            before * thickness * dr.select(depth > 0, -less / depth, 1)
            for before, depth, (_, less) in zip(transmittance, depths, passed)
        ]
        total = total + source * (weights[0] if len(weights) == 1 else Color(*weights))
        transmittance = [before * through for before, (through, _) in zip(transmittance, passed)]
        value = four_numbers(Float)(total.x, total.y, total.z, 0)
        dr.scatter(volume, value, (number + 1) * grid.columns + column)
        return number + 1, end, transmittance, total

    dr.while_loop(
        state=(
            mi.UInt32(0),
            dr.zeros(Float, grid.columns),
            [dr.full(Float, 1, grid.columns) for _ in range(medium.channels)],
            dr.zeros(Color, grid.columns),
        ),
        cond=lambda number, x, transmittance, total: number < grid.slices,
        body=step,
        labels=("number", "x", "transmittance", "total"),
    )
    return volume


def airlight_at_pixels(view: View, grid: Grid, volume: Any) -> PerRay:
    """Return the airlight of every ray of a view from what `accumulated`
    returned, a colour [W/(m^2 sr)].
    """
    Float, camera = type(view.distance), view.camera
    row, column = row_and_column(camera, view.pixel)
    # (u, v) counts columns from the middle of the first one; a pixel behind the last slice takes
    # the value at its end.
    u = (Float(column) + 0.5) * (grid.width / camera.width) - 0.5
    v = (Float(row) + 0.5) * (grid.height / camera.height) - 0.5
    depth = dr.minimum(view.distance * dr.dot(view.direction, camera.forward), grid.far)
    across = [(v / (grid.height - 1), grid.height), (u / (grid.width - 1), grid.width)]
    # Values stand at the ends of slices in depth and at the middles of columns across.
    red, green, blue, _ = between_entries(
        volume, [(grid.fraction(depth), grid.slices + 1), *across], 4
    )
    return type(view.medium.albedo)(red, green, blue)
