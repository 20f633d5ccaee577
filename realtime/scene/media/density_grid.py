# SPDX-License-Identifier: BSD-3-Clause
"""A density grid around the camera: an extinction that is trilinear between the
centres of voxels, in a box.

Methods that sample points march it: `extinction` is a look-up, and depths are walks from cell to
cell. In a cell the extinction along a line is a cubic, so two nodes of Gauss are exact; that is two
look-ups a cell, where engines take one a step. Nothing integrates a lit segment:
`realtime.methods.interface.media_checks` refuses methods that ask for one.
"""

from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi

from airlight.realtime.scene.density import Density
from airlight.realtime.scene.media.medium import VaryingMedium
from airlight.realtime.scene.phase import Phase

_GAUSS = 12**-0.5  # half of the distance of the two nodes over the length
_LEAST = 1e-3  # of a voxel: a walk goes at least so far, over the next face


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
        ends = [
            [(corner - at) / way for corner in corners]
            for at, way, *corners in zip(origin, direction, self.low, self.high, strict=True)
        ]
        Float = type(direction.x)
        near, far = Float(0), Float(dr.inf)
        for (one, other), at, way, low, high in zip(
            ends, origin, direction, self.low, self.high, strict=True
        ):
            beside = (way == 0) & ((at < low) | (at > high))
            near = dr.maximum(near, dr.select(way == 0, 0, dr.minimum(one, other)))
            far = dr.minimum(
                far, dr.select(beside, 0, dr.select(way == 0, dr.inf, dr.maximum(one, other)))
            )
        meets = far > near
        crossed = dr.select(meets, near, 0), dr.select(meets, far, 0)
        return replace(super().rays(origin, direction, aim), crossed=crossed)

    def extinction(self, rays, x):
        """Return the extinction [1/m]."""
        enter, leave = rays.crossed
        inside = (x >= enter) & (x <= leave)
        return (
            dr.select(inside, self.largest * self.density.at(rays.at(x), mi.UInt32(0), inside), 0),
        )

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [m], exact by cells [1]."""
        enter, leave = rays.crossed
        x0, x1 = dr.clip(x0, enter, leave), dr.clip(x1, enter, leave)
        start, length = rays.at(x0), dr.maximum(x1 - x0, 0)
        at, beyond = (
            self.density.rows_at(point, mi.UInt32(0), True)
            for point in (start, start + rays.direction)
        )
        rates = [after - before for before, after in zip(at, beyond, strict=True)]
        least = _LEAST / dr.maximum(
            dr.maximum(dr.abs(rates[0]), dr.abs(rates[1])), dr.abs(rates[2])
        )

        def walk(x, total):
            ahead = dr.inf
            for first, rate in zip(at, rates, strict=True):
                place = dr.fma(rate, x, first)
                face = dr.select(rate > 0, dr.floor(place) + 1, dr.ceil(place) - 1)
                ahead = dr.minimum(ahead, dr.select(rate == 0, dr.inf, (face - place) / rate))
            width = dr.minimum(dr.maximum(ahead, least), length - x)
            nodes = (x + (0.5 + side) * width for side in (-_GAUSS, _GAUSS))
            found = [
                self.density.at(dr.fma(rays.direction, node, start), mi.UInt32(0), x < length)
                for node in nodes
            ]
            return x + width, dr.fma(0.5 * width, found[0] + found[1], total)

        zero = dr.zeros(type(length), dr.width(length))
        _, total = dr.while_loop((zero, zero), lambda x, _: x < length, walk, labels=("x", "total"))
        return (self.largest * total,)

    def longest(self, rays, light, x, change):
        """Return the width of a voxel: the extinction has a kink at each [m]."""
        return self.density.voxel

    def part(self, rays, x0, x1, *, uniform):
        """Return the part of a segment in the box [m]."""
        begin, end = (dr.clip(x, *rays.crossed) for x in (x0, x1))
        meets = end > begin
        return dr.select(meets, begin, 0), dr.select(meets, end, 0)

    def last_depth(self, origin, forward):
        """Return the depth of the farthest corner of the box [m]."""
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
