# SPDX-License-Identifier: BSD-3-Clause
r"""Density grids: exact optical depths by cells, nodes between the faces of cells.

A cell lies between eight centres of voxels. With the place in it (u, v, w), each linear in the
distance x, the extinction

    sum over corners c of  sigma_c  u_c v_c w_c,      u_c = u or 1 - u, ...

is a cubic in x, and Gauss's two nodes integrate it exactly:

    int_a^b sigma_t dx = (b - a)/2 (sigma_t(m - d) + sigma_t(m + d)),      m = (a + b)/2, d = (b - a)/(2 sqrt 3).

A walk goes from cell to cell in kernels of float64. It keeps the number of the next plane of each
axis and goes to the nearest, so that rounding cannot hold it up.

Along a camera ray the extinction has kinks at the faces of cells, so stretches are cut there. The
depth of the path to the light is smooth in the distance, except where that path sweeps over an edge
of the grid: its second derivative jumps there. A pixel therefore has an estimate of its error, the
difference of the two rules, and no bound.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.integrate import (
    TERMS,
    ErrorKind,
    Terms,
    strongest,
    sum_stretches,
)
from airlight.reference.quadrature.intervals import Kinks, Pieces, Stretches, cut, whole
from airlight.reference.scene.device import on_device, vectors
from airlight.reference.scene.varying import GridMedium
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]


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


@dataclass(frozen=True)
class GridField:
    """A density grid in its box; a field (`reference.quadrature.fields`)."""

    medium: GridMedium

    @cached_property
    def walk(self) -> CellWalk:
        """The grid on the device."""
        return cell_walk(self.medium)

    @property
    def error_kind(self) -> ErrorKind:
        """The kind of the errors: second derivatives jump within pieces, where two
        rules may both be wrong.
        """
        return "estimated"

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, (3,) [1/m]."""
        return strongest(self.medium)

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1]."""
        origin = np.broadcast_to(origin, direction.shape)
        near, far = self.medium.crossed(origin, direction)
        ends = np.maximum(low, near), np.minimum(high, far)
        rows = np.flatnonzero(ends[1] > ends[0])
        depth = np.zeros(len(direction))
        if len(rows):
            # The walk counts in voxels: places and directions are scaled, distances stay in metres.
            start, way = (
                self.medium.voxels(origin[rows]),
                direction[rows] * self.medium.voxels_per_metre,
            )
            x0, x1 = (on_device(mi.Float64, end[rows]) for end in ends)
            depth[rows] = np.array(
                self.walk.depth(vectors(mi.Vector3d, start), vectors(mi.Vector3d, way), x0, x1)
            )
        # Density grids have one extinction for all channels.
        return np.repeat(depth[:, None], 3, axis=1)

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance at which rays leave the box, (n,) [m]: 0 where they miss it."""
        return self.medium.crossed(np.broadcast_to(origin, direction.shape), direction)[1]

    def sums(
        self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS
    ) -> tuple[Array, Array]:
        """Return the airlight of each ray from its lit stretches, and an estimate of
        its error, (rays, 3) each.
        """
        near, far = self.medium.crossed(
            np.broadcast_to(rays.origin, rays.direction.shape), rays.direction
        )
        # Nothing scatters outside of the box of the grid.
        ray, low, high = stretches
        inside = ray, np.maximum(low, near[ray]), np.minimum(high, far[ray])

        def source(lit: Stretches) -> "_Integrand | None":
            pieces = cut(whole(lit), self._faces(rays, lit[0], near, far))
            pieces = pieces[self._filled(rays, pieces)]
            return self._integrand(rays, pieces, terms) if len(pieces.ray) else None

        return sum_stretches(rays, inside, source, terms, rtol=1e-6, step=2048)

    def _faces(self, rays: Rays, ray: Index, near: Array, far: Array) -> Kinks:
        """Return where rays cross the faces of cells."""
        # Along each axis cells end at whole numbers of voxels: a ray crosses the planes between its
        # places at both ends of the box, `first` the lowest of them and `many` their number.
        ray = np.unique(ray)
        origin = np.broadcast_to(self.medium.voxels(rays.origin), rays.direction.shape)[ray]
        crossings = []
        for axis, count in enumerate(self.medium.values.shape[::-1]):
            rate = rays.direction[ray, axis] * self.medium.voxels_per_metre[axis]
            ends = np.sort(origin[:, axis] + np.stack([near[ray], far[ray]]) * rate, axis=0)
            first = np.clip(np.ceil(ends[0]), 0, count).astype(np.int64)
            many = np.maximum(
                np.clip(np.floor(ends[1]), -1, count - 1).astype(np.int64) - first + 1, 0
            )
            many[rate == 0] = 0
            # One row for each crossing: the ray, and which of its planes it is, counted from
            # `first`.
            owner = np.repeat(np.arange(len(ray)), many)
            plane = first[owner] + np.arange(len(owner)) - np.repeat(np.cumsum(many) - many, many)
            crossings.append((ray[owner], (plane - origin[owner, axis]) / rate[owner]))
        rays_of, places = (np.concatenate(column) for column in zip(*crossings, strict=True))
        return rays_of, places

    @cached_property
    def _cells(self) -> NDArray[np.bool_]:
        """Whether a voxel at a corner of a cell has extinction, by cell (z, y, x); the cells before
        the first centres and behind the last ones, too.
        """
        filled = np.pad(self.medium.values > 0, 1, mode="edge")
        for axis in range(3):
            ends = np.moveaxis(filled, axis, 0)
            filled = np.moveaxis(ends[1:] | ends[:-1], 0, axis)
        return filled

    def _filled(self, rays: Rays, pieces: Pieces) -> NDArray[np.bool_]:
        """Return which pieces lie in cells that are not empty; a lamp in an empty one may lie on a
        ray.
        """
        origin = np.broadcast_to(rays.origin, rays.direction.shape)[pieces.ray]
        middle = (0.5 * (pieces.x0 + pieces.x1))[:, None] * rays.direction[pieces.ray]
        cell = np.floor(self.medium.voxels(origin + middle)).astype(np.int64) + 1
        x, y, z = np.clip(cell, 0, self.medium.values.shape[::-1]).T
        return self._cells[z, y, x]

    def _integrand(self, rays: Rays, pieces: Pieces, terms: Terms) -> "_Integrand":
        count = len(pieces.ray)
        before = self.optical_depth(
            rays.origin, rays.direction[pieces.ray], np.zeros(count), pieces.x0
        )[:, 0]
        factor, extinction = (
            np.ones((count, 3)) * self.medium.albedo,
            np.full(count, self.medium.largest[0]),
        )
        return _Integrand(self, rays, pieces, terms, before, factor, extinction)


@dataclass(frozen=True)
class _Integrand:
    """sigma_t exp(-tau) p along pieces, each in one cell; an `Integrand` of `integrate`."""

    grid: GridField
    rays: Rays
    pieces: Pieces
    terms: Terms
    before: Array  #: optical depth between the camera and each piece
    factor: Array
    extinction: Array
    same: Index = field(default_factory=lambda: np.zeros(3, np.int64))
    densest: float = 0.0  #: such fog holds no bodies

    def __call__(
        self, rows: Index, x: Array, inside: Array, r: Array, scatter: Array
    ) -> tuple[Array, Array]:
        rays, medium, walk, ray = self.rays, self.grid.medium, self.grid.walk, self.pieces.ray[rows]
        # One lane for each node; `row` is the piece of the lane. The number of nodes is opaque, so
        # that all rules share one kernel.
        row = dr.arange(mi.UInt32, x.size) // dr.opaque(mi.UInt32, x.shape[1])

        def by_row(numbers: Array) -> Any:
            return dr.gather(mi.Float64, on_device(mi.Float64, numbers), row)

        origin = np.broadcast_to(medium.voxels(rays.origin), rays.direction.shape)[ray]
        target = medium.voxels(rays.position) if rays.w else rays.position * medium.voxels_per_metre
        start, way, target = (
            mi.Vector3d(*(by_row(column) for column in part.T))
            for part in (origin, rays.direction[ray] * medium.voxels_per_metre, target[ray])
        )
        at, begin = on_device(mi.Float64, x.ravel()), by_row(self.pieces.x0[rows])
        place = dr.fma(way, at, start)
        # tau_camera: up to the piece, and from its beginning on within its one cell.
        depth = by_row(self.before[rows]) + walk.within(start, way, begin, at)
        paths, density = self.terms.paths, walk.density(place)
        if isinstance(paths.camera, np.ndarray) or paths.camera != 1:
            depth *= by_row(paths.of_camera(ray))
        # tau_shadow, of which a model may take a fraction; the path to the light of a place is in
        # parts of its length.
        if paths.light:
            if rays.w:
                path, scale = target - place, dr.opaque(mi.Float64, self.terms.shadow_scale)
                end = dr.minimum(walk.leave(place, path), scale)
                out = walk.depth(place, path, mi.Float64(0), end)
                out *= on_device(mi.Float64, r.ravel())
            else:
                out = walk.depth(place, target, mi.Float64(0), walk.leave(place, target))
            depth += out if paths.light == 1 else out * dr.opaque(mi.Float64, paths.light)
        if paths.length:
            depth += dr.opaque(mi.Float64, paths.length) * density
        value = density * dr.exp(-depth)
        dr.eval(value, depth)
        values, depths = (np.array(part).reshape(x.shape) for part in (value, depth))
        return (values * medium.phase(scatter))[:, :, None], depths[:, :, None]
