# SPDX-License-Identifier: BSD-3-Clause
"""The airlight from the camera to the end of each slice, and from there to any depth.

Along a ray the airlight is L(x) = int_0^x S(y) exp(-tau(y)) dy, with S the scattered light and tau the optical depth
from the camera, tau' = sigma. Let S and sigma be constant in a slice [x_k, x_k + D]. There tau(y) = tau_k + sigma (y -
x_k), and

    int_{x_k}^{x_k + D} S exp(-tau(y)) dy = S exp(-tau_k) (1 - exp(-sigma D)) / sigma,

which goes to S exp(-tau_k) D with sigma. Front to back, with T_k = exp(-tau_k):

    L_{k+1} = L_k + T_k S_k D_k (1 - exp(-z))/z,    T_{k+1} = T_k exp(-z),    z = sigma_k D_k;    L_0 = 0, T_0 = 1.

The slices of a constant medium in constant light therefore add up to S (1 - exp(-sigma x)) / sigma for any number and
depths of slices. Multiplying S D by T_k instead is too bright by a factor of 1 + z/2, and by T_{k+1} too dark by as
much (Hillaire 2015). Where z is small, 1 - exp(-z) cancels, and its series takes over.

Between the ends of slices, and between columns, a pixel interpolates linearly in (u, v, s).

References
----------
Hillaire 2015, *Physically-based and unified volumetric rendering in Frostbite* (the integral within a slice). Wronski
2014 (the grid, and its sum front to back).
"""

import math
from typing import Any

import drjit as dr
import mitsuba as mi

from realtime.methods.froxel_fog.grid import Grid, trilinear
from realtime.methods.interface.method import View
from realtime.numerics.array_types import PerRay, four_numbers
from realtime.scene.camera import row_and_column
from realtime.scene.media.medium import Rays

_THIN = 0.1  # optical depth of a slice up to which the series serves
_TERMS = 8  # of it: 0.1^8/9! = 3e-14 is left out


def accumulated(view: View, grid: Grid, rays: Rays, scattered: PerRay) -> Any:
    """Return the airlight up to the begin and the end of each slice, (slices + 1) values a column, four numbers each.

    `view`, `grid`, `rays`: the frame, its froxels, and the middle rays of columns; `scattered`: by froxel, a colour
    [W/(m^3 sr)], evaluated.
    """
    Float, Color, medium = type(view.distance), type(scattered), view.medium
    column = dr.arange(mi.UInt32, grid.columns)
    stretch = dr.norm(grid.column_ray(column))
    volume = dr.zeros(Float, 4 * (grid.slices + 1) * grid.columns)

    def step(number, x, kept, total):
        end = grid.depth((Float(number) + 1) / grid.slices) * stretch
        thickness = end - x
        depths = medium.optical_depth(rays, x, end)
        source = dr.gather(Color, scattered, number * grid.columns + column)
        passed = [dr.exp(-depth) for depth in depths]
        weights = [
            fraction * thickness * _mean_transmittance(depth, end) for fraction, depth, end in zip(kept, depths, passed)
        ]
        total = total + source * (weights[0] if len(weights) == 1 else Color(*weights))
        kept = [fraction * end for fraction, end in zip(kept, passed)]
        value = four_numbers(Float)(total.x, total.y, total.z, 0)
        dr.scatter(volume, value, (number + 1) * grid.columns + column)
        return number + 1, end, kept, total

    dr.while_loop(
        state=(
            mi.UInt32(0),
            dr.zeros(Float, grid.columns),
            [dr.full(Float, 1, grid.columns) for _ in range(medium.channels)],
            dr.zeros(Color, grid.columns),
        ),
        cond=lambda number, x, kept, total: number < grid.slices,
        body=step,
        labels=("number", "x", "kept", "total"),
    )
    return volume


def _mean_transmittance(depth: Any, passed: Any) -> Any:
    """Return (1 - exp(-z))/z, the mean of exp(-t) for t from 0 to z; `passed` is exp(-z)."""
    series = type(depth)(1 / math.factorial(_TERMS))
    for order in range(_TERMS - 1, 0, -1):
        series = dr.fma(-depth, series, 1 / math.factorial(order))
    return dr.select(depth > _THIN, (1 - passed) / depth, series)


def airlight_at_pixels(view: View, grid: Grid, volume: Any) -> PerRay:
    """Return the airlight of every ray of a view from what `accumulated` returned, a colour [W/(m^2 sr)]."""
    Float, camera = type(view.distance), view.camera
    row, column = row_and_column(camera, view.pixel)
    u = (Float(column) + 0.5) * (grid.width / camera.width) - 0.5
    v = (Float(row) + 0.5) * (grid.height / camera.height) - 0.5
    depth = dr.minimum(view.distance * dr.dot(view.direction, camera.forward), grid.far)
    s = grid.fraction(depth) * grid.slices
    return type(view.medium.albedo)(trilinear(volume, (grid.width, grid.height, grid.slices + 1), (u, v, s)))
