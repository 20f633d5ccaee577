# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit stretches in a density grid: exact optical depths by cells, nodes
between the faces of cells.

Along a camera ray the extinction has kinks at the faces of cells, so stretches are cut there. The
depth of the path to the light is smooth in the distance, except where that path sweeps over an edge
of the grid: its second derivative jumps there. A pixel therefore has an estimate of its error, the
difference of the two rules, and no bound.
"""

from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.adaptive_panels import sum_pieces
from airlight.reference.quadrature.cell_walk import CellWalk, cell_walk
from airlight.reference.quadrature.pieces import Kinks, Pieces, cut, whole
from airlight.reference.quadrature.stretches import TERMS, BoundKind, Stretches, Terms, strongest
from airlight.reference.scene.device import on_device, vectors
from airlight.reference.scene.varying import GridMedium
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class GridField:
    """A density grid in its box; a field (`reference.quadrature.fields`)."""

    medium: GridMedium

    @cached_property
    def walk(self) -> CellWalk:
        """The grid on the device."""
        return cell_walk(self.medium)

    @property
    def bound_kind(self) -> BoundKind:
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
        low, high = np.maximum(low, near[ray]), np.minimum(high, far[ray])
        # The relative tolerance of the sum of a ray and a light, and the rays summed at once.
        terms = replace(terms, rtol=terms.rtol or 1e-6)
        step = 2048
        value, error = np.zeros((2, len(rays.foot), 3))
        for first in range(0, len(rays.foot), step):
            block = slice(first, min(first + step, len(rays.foot)))
            chosen = (ray >= block.start) & (ray < block.stop) & (high > low)
            if chosen.any():
                pieces = cut(
                    whole((ray[chosen], low[chosen], high[chosen])),
                    self._faces(rays, ray[chosen], near, far),
                )
                value[block], error[block] = sum_pieces(
                    rays, pieces, self._integrand(rays, pieces, terms), block, terms
                )
        return value / (4 * np.pi), error / (4 * np.pi)

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

    def _integrand(self, rays: Rays, pieces: Pieces, terms: Terms) -> "_Integrand":
        count = len(pieces.ray)
        before = self.optical_depth(
            rays.origin, rays.direction[pieces.ray], np.zeros(count), pieces.x0
        )[:, 0]
        factor, extinction = (
            np.ones((count, 3)) * self.medium.albedo,
            np.full(count, self.medium.largest[0]),
        )
        return _Integrand(self, rays, pieces, terms.shadow_scale, before, factor, extinction)


@dataclass(frozen=True)
class _Integrand:
    """sigma_t exp(-tau) p along pieces, each in one cell; an `Integrand` of `adaptive_panels`."""

    grid: GridField
    rays: Rays
    pieces: Pieces
    shadow_scale: float
    before: Array  #: optical depth between the camera and each piece
    factor: Array
    extinction: Array
    same: Index = field(default_factory=lambda: np.zeros(3, np.int64))

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
        if rays.w:  # the path to the light in parts of its length
            path = target - place
            end = dr.minimum(walk.leave(place, path), dr.opaque(mi.Float64, self.shadow_scale))
            depth += on_device(mi.Float64, r.ravel()) * walk.depth(place, path, mi.Float64(0), end)
        else:
            depth += walk.depth(place, target, mi.Float64(0), walk.leave(place, target))
        value = walk.density(place) * dr.exp(-depth)
        dr.eval(value, depth)
        values, depths = (np.array(part).reshape(x.shape) for part in (value, depth))
        return (values * medium.phase(scatter))[:, :, None], depths[:, :, None]
