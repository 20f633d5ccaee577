# SPDX-License-Identifier: BSD-3-Clause
r"""Optical depths through a grid by a walk from cell to cell, in kernels of float64.

A cell lies between eight centres of voxels. With the place in it (u, v, w), each linear in the
distance x, the extinction

    sum over corners c of  sigma_c  u_c v_c w_c,      u_c = u or 1 - u, ...

is a cubic in x, and Gauss's two nodes integrate it exactly:

    int_a^b sigma_t dx = (b - a)/2 (sigma_t(m - d) + sigma_t(m + d)),      m = (a + b)/2, d = (b - a)/(2 sqrt 3).

The walk keeps the number of the next plane of each axis and goes to the nearest, so that
rounding cannot hold it up.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.reference.scene.device import on_device
from airlight.reference.scene.varying import GridMedium


@dataclass(frozen=True)
class CellWalk:
    """A grid on the device. Places are in voxels; distances are what directions, in
    voxels, are multiplied by.
    """

    table: Any  #: by voxel, extinction there, at its neighbour in x, in y, and in both [1/m]
    counts: tuple[int, int, int]  #: voxels along x, y, z

    def density(self, place) -> Any:
        """Return the extinction at places in the box [1/m]."""
        return self._in_cell(place)(place)

    def leave(self, place, direction) -> Any:
        """Return the distances at which lines from places in the box leave it."""
        ends = [
            dr.select(part == 0, dr.inf, (dr.select(part > 0, count - 0.5, -0.5) - at) / part)
            for at, part, count in zip(place, direction, self.counts, strict=True)
        ]
        return dr.maximum(dr.minimum(dr.minimum(ends[0], ends[1]), ends[2]), 0)

    def within(self, origin, direction, x0, x1) -> Any:
        """Return the integral of the extinction between two distances in one cell."""
        # d = (b - a)/(2 sqrt 3): both nodes are this far from the middle. The cell is found by the
        # middle alone: rounding at a face must not take a node to the next cell.
        middle, half = (
            dr.fma(direction, 0.5 * (x0 + x1), origin),
            direction * (12.0**-0.5 * (x1 - x0)),
        )
        cell = self._in_cell(middle)
        return 0.5 * (x1 - x0) * (cell(middle - half) + cell(middle + half))

    def depth(self, origin, direction, x0, x1) -> Any:
        """Return the integral of the extinction between two distances in the box."""
        # The next plane of each axis in the direction of the walk. A start on a plane goes to the
        # plane after it.
        start, inverse = origin + direction * x0, dr.rcp(direction)
        signs = [dr.select(part > 0, mi.Float64(1), -1) for part in direction]
        planes = [dr.floor(at * sign) * sign + sign for at, sign in zip(start, signs, strict=True)]

        def walk(x, px, py, pz, total):
            planes = px, py, pz
            ends = [
                dr.select(
                    direction[axis] == 0, dr.inf, (planes[axis] - origin[axis]) * inverse[axis]
                )
                for axis in range(3)
            ]
            # The nearest plane ends the step; all axes whose plane is there go on to their next
            # one. A line parallel to an axis never meets a plane of it.
            end = dr.minimum(dr.minimum(ends[0], ends[1]), dr.minimum(ends[2], x1))
            moved = [
                dr.select(ends[axis] <= end, planes[axis] + signs[axis], planes[axis])
                for axis in range(3)
            ]
            # Rounding may put a plane before the place that is already reached: the step then has
            # no length.
            end = dr.maximum(x, end)
            return end, *moved, total + self.within(origin, direction, x, end)

        zero = dr.zeros(mi.Float64, dr.width(direction, x0, x1))
        *_, total = dr.while_loop(
            (zero + x0, *planes, zero), lambda x, *_: x < x1, walk, label="cells"
        )
        return total

    def _in_cell(self, place) -> Callable[[Any], Any]:
        """Return the extinction as a function of places in voxels, trilinear as
        it is around one of them.
        """
        nx, ny, nz = self.counts
        # Beyond the centres of the outermost voxels the extinction is constant: u, v, w are clipped
        # there.
        cell = [
            dr.clip(dr.floor(at), 0, max(count - 2, 0))
            for at, count in zip(place, self.counts, strict=True)
        ]
        i, j, k = (mi.Int32(each) for each in cell)
        voxel = mi.UInt32((k * ny + j) * nx + i)
        near = dr.gather(mi.Vector4d, self.table, voxel)
        # The table has the neighbours in x and y beside each voxel: two gathers are all eight
        # corners. A grid of one layer has no next one in z.
        rise = dr.gather(mi.Vector4d, self.table, voxel + (nx * ny if nz > 1 else 0)) - near

        def extinction(place):
            u, v, w = (dr.clip(at - first, 0, 1) for at, first in zip(place, cell, strict=True))
            four = dr.fma(rise, w, near)
            return dr.lerp(dr.lerp(four.x, four.y, u), dr.lerp(four.z, four.w, u), v)

        return extinction


def cell_walk(medium: GridMedium) -> CellWalk:
    """Put a grid on the device."""
    values = medium.values
    # The last voxel of a row is its own neighbour, which only a grid of one voxel in a row reads.
    beside = np.concatenate([values[:, :, 1:], values[:, :, -1:]], axis=2)
    behind, both = (
        np.concatenate([each[:, 1:], each[:, -1:]], axis=1) for each in (values, beside)
    )
    table = np.stack([values, beside, behind, both], axis=-1)
    nz, ny, nx = values.shape
    return CellWalk(on_device(mi.Float64, table.ravel()), (nx, ny, nz))
