# SPDX-License-Identifier: BSD-3-Clause
"""A density grid around the camera: an extinction that is trilinear between the
centres of voxels, in a box.

Methods that sample points march it: `extinction` is a look-up, and depths are walks from cell to
cell. In a cell the extinction along a line is a cubic, so the two-node rule of Gauss is exact and
costs two look-ups a cell, where engines take one a step. Nothing integrates a lit segment:
`realtime.methods.interface.media_checks` refuses methods that ask for one.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.scene.density import Density
from airlight.realtime.scene.media.medium import VaryingMedium
from airlight.realtime.scene.phase import Phase


@dataclass(frozen=True)
class GridMedium(VaryingMedium):
    """An extinction on a grid; grey."""

    density: Density  #: of one cloud: the grid over its largest value
    largest: Any  #: extinction where the density is 1 [1/m]
    low: Any  #: corner of the box [m]
    high: Any  #: the opposite corner [m]
    albedo: Any
    phase: Phase
    sums_depth = True
    summary = "a density grid: marched, depths from cell to cell"

    def rays(self, origin, direction, aim=None):
        """Return rays with the distances at which they enter and leave the box [m]."""
        # Distances to both faces of the box across each axis. The ray is in the box from the last
        # entry on to the first exit.
        ends = [
            [(corner - start) / slope for corner in corners]
            for start, slope, *corners in zip(origin, direction, self.low, self.high, strict=True)
        ]
        Float = type(direction.x)
        near, far = Float(0), Float(dr.inf)
        for (one, other), start, slope, low, high in zip(
            ends, origin, direction, self.low, self.high, strict=True
        ):
            # A ray parallel to two faces meets neither: it runs between them, or misses the box.
            beside = (slope == 0) & ((start < low) | (start > high))
            near = dr.maximum(near, dr.select(slope == 0, 0, dr.minimum(one, other)))
            far = dr.minimum(
                far, dr.select(beside, 0, dr.select(slope == 0, dr.inf, dr.maximum(one, other)))
            )
        meets = far > near
        crossed = dr.select(meets, near, 0), dr.select(meets, far, 0)
        return replace(super().rays(origin, direction, aim), crossed=crossed)

    def extinction(self, rays, x):
        """Return the extinction [1/m]."""
        enter, leave = rays.crossed
        inside = (x >= enter) & (x < leave)
        return (
            dr.select(inside, self.largest * self.density.at(rays.at(x), mi.UInt32(0), inside), 0),
        )

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [m], exact by cells [1]."""
        enter, leave = rays.crossed
        x0, x1 = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        start, length = rays.at(x0), dr.maximum(x1 - x0, 0)
        # A place moves by `rates` voxels a metre along each axis of the grid: the rows of the
        # transform without its shift. A difference of two places would be all rounding where voxels
        # are large. A step has a thousandth of a voxel at least: it goes over a face that rounding
        # has left just ahead.
        at, way = self.density.rows_at(start, mi.UInt32(0), True), rays.direction
        rates = [
            dr.fma(x, way.x, dr.fma(y, way.y, z * way.z))
            for x, y, z in (self.density.rows[n : n + 3] for n in (0, 4, 8))
        ]
        least = 1e-3 / dr.maximum(dr.maximum(dr.abs(rates[0]), dr.abs(rates[1])), dr.abs(rates[2]))

        def walk(x, total):
            # The next face of the cell on any axis ends the step; parallel faces are never met.
            ahead = dr.inf
            for first, rate in zip(at, rates, strict=True):
                place = dr.fma(rate, x, first)
                face = dr.select(rate > 0, dr.floor(place) + 1, dr.ceil(place) - 1)
                ahead = dr.minimum(ahead, dr.select(rate == 0, dr.inf, (face - place) / rate))
            width = dr.minimum(dr.maximum(ahead, least), length - x)
            # Gauss' rule of two nodes, 12^(-1/2) of the step before and behind its middle.
            offset = 12**-0.5
            nodes = (x + (0.5 + side) * width for side in (-offset, offset))
            densities = [
                self.density.at(dr.fma(rays.direction, node, start), mi.UInt32(0), x < length)
                for node in nodes
            ]
            return x + width, dr.fma(0.5 * width, densities[0] + densities[1], total)

        zero = dr.zeros(type(length), dr.width(length))
        _, total = dr.while_loop((zero, zero), lambda x, _: x < length, walk, labels=("x", "total"))
        return (self.largest * total,)

    def longest(self, rays, light, x, change):
        """Return the width of a voxel: the extinction has a kink at each [m]."""
        return self.density.voxel

    def part(self, rays, x0, x1, *, uniform):
        """Return the part of a segment in the box [m]."""
        begin, end = (dr.clip(x, *rays.crossed) for x in (x0, x1))
        # A ray beside the box has an empty part at the camera.
        meets = end > begin
        return dr.select(meets, begin, 0), dr.select(meets, end, 0)

    def last_depth(self, origin, forward):
        """Return the depth of the farthest corner of the box [m]."""
        # The depth is linear in the corner: on each axis the farther of two sides counts.
        nearer, farther = self.low - origin, self.high - origin
        return dr.maximum(
            sum(dr.maximum(a * f, b * f) for a, b, f in zip(nearer, farther, forward, strict=True)),
            0,
        )

    def thicker(self, factor):
        """Return it with the extinction times a factor."""
        thicker = replace(self, largest=self.largest * factor)
        dr.make_opaque(thicker.largest)
        return thicker
