# SPDX-License-Identifier: BSD-3-Clause
"""Bounded media: homogeneous, convex and disjoint, in vacuum or in a
homogeneous medium around them.

A ray enters and leaves each medium once. The lengths of its segments in the media follow from these
two distances, found once a ray (`crossed`), and those of light paths from
`realtime.scene.media.light_paths`; an optical depth is

    tau = sigma_0 length + sum_k (sigma_k - sigma_0) l_k,        sigma_0 = 0 in vacuum.
"""

from dataclasses import dataclass, replace
from functools import reduce
from typing import Any

import drjit as dr
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.functions import opacity
from airlight.realtime.scene.density import Density
from airlight.realtime.scene.media.bounded_rays import BoundedRays, camera_pieces
from airlight.realtime.scene.media.facet_paths import BoundedMedium
from airlight.realtime.scene.media.light_paths import chord, paths_from
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import Phase


@dataclass(frozen=True)
class Clouds:
    """Media within closed bounds of any shape, disjoint, in vacuum:
    tables with an entry for each.
    """

    sigma_t: tuple[Any, ...]  #: extinction [1/m], by channel; the largest of a cloud with a density
    albedo: Any  #: single-scattering albedos, RGB [1]
    phases: tuple[Phase, ...]  #: the different phase functions
    phase: Any  #: the number of each cloud's phase function
    density: Density | None = None  #: from place to place; None where all clouds are homogeneous

    @property
    def grids(self) -> int:
        """How many clouds have a grid of densities."""
        return (
            0
            if self.density is None
            else int(np.count_nonzero(np.isfinite(np.array(self.density.voxel))))
        )


@dataclass(frozen=True)
class BoundedMedia(Homogeneous):
    """A homogeneous medium or vacuum with bounded media in it. They have as
    many extinctions as it has.
    """

    bounded_media: tuple[BoundedMedium, ...] = ()
    clear: bool = False
    clouds: Clouds | None = None

    def check_beam(self, axis, name):
        """Refuse light through a medium around the bounded ones."""
        if not (self.clear and self.clouds):
            super().check_beam(axis, name)

    @property
    def summary(self):
        """Clouds where not all bounds are convex or not all media homogeneous."""
        if self.clouds is None or self.bounded_media:
            around = "vacuum" if self.clear else "another medium"
            return f"bounded, in {around}: rays clipped, no kernel"
        grids = self.clouds.grids
        words = (
            f"{dr.width(self.clouds.phase)} clouds in vacuum, bounded by meshes: rays cast at them"
        )
        return words + (f", {grids} with a grid of densities: marched" if grids else "")

    @property
    def phases(self):
        """The phase functions of the bounded media, and of the medium around them."""
        bounded = (
            self.clouds.phases
            if self.clouds
            else [each.medium.phase for each in self.bounded_media]
        )
        return (*bounded, *(() if self.clear else (self.phase,)))

    def rays(self, origin, direction, aim=None):
        """Return rays with the distances at which they enter and leave each medium [m]."""
        crossed = tuple(chord(bounded, origin, direction) for bounded in self.bounded_media)
        return replace(super().rays(origin, direction, aim), crossed=crossed)

    def extinction(self, rays, x):
        """Return the extinction of the medium in which a point lies [1/m]."""
        # The bounded media are disjoint: a point lies in one of them at most.
        extinctions = list(self.sigma_t)
        for bounded, (enter, leave) in zip(self.bounded_media, rays.crossed, strict=True):
            inside = (x >= enter) & (x < leave)
            extinctions = [
                dr.select(inside, sigma, around)
                for sigma, around in zip(bounded.medium.sigma_t, extinctions)
            ]
        return tuple(extinctions)

    def optical_depth(self, rays, x0, x1):
        """Return the optical depth of segments [m], by channel [1]."""
        # sigma_0 times the whole length; in vacuum 0, as 0 times an infinite length is NaN.
        depths = [type(x1)(0) if self.clear else sigma * (x1 - x0) for sigma in self.sigma_t]
        for bounded, (enter, leave) in zip(self.bounded_media, rays.crossed, strict=True):
            begin, end = dr.maximum(enter, x0), dr.minimum(leave, x1)
            # A ray that misses the medium has both of its ends at infinity, and no length in it.
            depths = self._with_length(depths, bounded, dr.select(end > begin, end - begin, 0))
        return tuple(depths)

    def length_of(self, depth):
        """Return a length that has the depth wherever it lies, in thinner media too [m]."""
        if self.clear:
            return super().length_of(depth)
        lengths = []
        for channel, around in enumerate(self.sigma_t):
            # A ray through a thinner medium lacks so much of the depth at most: along 2 R of it.
            lacking = (
                2 * bounded.radius * dr.maximum(around - bounded.medium.sigma_t[channel], 0)
                for bounded in self.bounded_media
            )
            lengths.append(sum(lacking, type(around)(depth)) / around)
        return reduce(dr.maximum, lengths)

    def last_depth(self, origin, forward):
        """Return the depth at which the last medium in vacuum ends [m]."""
        if not self.clear:
            return None
        depths = [
            dr.dot(bounded.centre - origin, forward) + bounded.radius
            for bounded in self.bounded_media
        ]
        return reduce(dr.maximum, depths, type(origin.x)(0))

    def depth_to_light(self, light, point, r, active=True):
        """Return the optical depth from points [m] to a light, by channel [1]."""
        # The path to a light at infinity has no end: only its parts in bounded media have a length,
        # with |D| = 1. Points are rays without a direction.
        zero, r = type(point.x)(0), r if light.w else type(point.x)(1)
        depths = [sigma * r if light.w and not self.clear else zero for sigma in self.sigma_t]
        for path in paths_from(self, light, point, dr.zeros(type(point)), active=active):
            # Paths beside the sphere of the medium need no walk over its facets.
            length = replace(path, active=active & path.near_points()).length_at(zero, r)
            depths = self._with_length(depths, path.bounded, length)
        return tuple(depths)

    def _with_length(self, depths, bounded: BoundedMedium, length):
        """Return depths by channel with (sigma_k - sigma_0) l_k of one medium."""
        sigma_t = bounded.medium.sigma_t
        return [
            dr.fma(sigma - around, length, depth)
            for depth, sigma, around in zip(depths, sigma_t, self.sigma_t, strict=True)
        ]

    def source(self, rays, x, angle):
        """Return albedo sigma_t p of the medium in which a point lies, RGB [1/m]."""
        return self._scattered(
            rays, angle, lambda enter, leave: dr.select((x >= enter) & (x < leave), 1, type(x)(0))
        )

    def mean_source(self, rays, x0, x1, angle):
        """Return the mean of `source` over segments: each medium by the part that lies in it."""

        def part(enter, leave):
            return dr.maximum(dr.minimum(leave, x1) - dr.maximum(enter, x0), 0) / (x1 - x0)

        return self._scattered(rays, angle, part)

    def _scattered(self, rays, angle, part):
        # By medium its part, from 0 to 1; the rest is the part of the medium around.
        total, around = type(self.albedo)(0), 1
        for bounded, ends in zip(self.bounded_media, rays.crossed, strict=True):
            inside, medium = part(*ends), bounded.medium
            total += medium.unit * (inside * angle(medium.phase))
            around = around - inside
        return total if self.clear else total + super().unit * (around * angle(self.phase))

    @property
    def unit(self):
        """1: each medium has its own albedo and extinction, which its integral holds."""
        return 1

    def part(self, rays, x0, x1, *, uniform):
        """Return the part of a segment [m] from the first to the last bounded medium, in vacuum."""
        if not self.clear:
            return super().part(rays, x0, x1, uniform=uniform)
        # An unbounded ray that meets none would begin at infinity, where a map has no
        # place and a step no length.
        first, last = x1, x0
        for enter, leave in rays.crossed:
            first = dr.minimum(first, enter)
            last = dr.maximum(last, dr.select(dr.isfinite(enter), leave, x0))
        begin, end = dr.maximum(first, x0), dr.minimum(last, x1)
        meets = end > begin
        return dr.select(meets, begin, 0), dr.select(meets, end, 0)

    def ambient(self, rays, distance):
        """Return the light of a constant field of radiance 1: albedo (exp(-tau_0) -
        exp(-tau_1)) a piece, RGB.
        """
        total = type(self.albedo)(0)
        for piece in camera_pieces(self, rays):
            # A piece without end stops at 1e30 m, where nothing is left: infinite ends have NaN for
            # a length. A field of radiance 1 is scattered by the albedo times what it loses.
            length = dr.maximum(dr.minimum(dr.minimum(piece.end, distance), 1e30) - piece.begin, 0)
            ends = zip(piece.medium.sigma_t, piece.before)
            channels = [
                dr.select(length > 0, dr.exp(-tau) * opacity(s * length), 0) for s, tau in ends
            ]
            total += piece.medium.albedo * type(total)(*channels)
        return total

    def thicker(self, factor):
        """Return it, the bounded media and the clouds with the extinction times a factor."""
        bounded_media = tuple(
            replace(bounded, medium=bounded.medium.thicker(factor))
            for bounded in self.bounded_media
        )
        clouds = self.clouds
        if clouds is not None:
            sigma_t = tuple(sigma * factor for sigma in clouds.sigma_t)
            dr.make_opaque(sigma_t)
            clouds = replace(clouds, sigma_t=sigma_t)
        return replace(super().thicker(factor), bounded_media=bounded_media, clouds=clouds)

    def lit(self, rays, light, geometry, kernel=None):
        """Return rays with one light, by the panels of this room.

        Raises
        ------
        InputError
            For other kernels than `exact` and a light that has a place: they are of
            one medium without bounds.
        """
        if not self.bounded_media:  # what clouds fill is for their methods
            return super().lit(rays, light, geometry, kernel)
        if light.w and not (kernel is None or kernel.exact):
            raise InputError(
                f"kernel: got {kernel.name}, which is of one medium without bounds; expected exact "
                "in bounded media"
            )
        return BoundedRays(self, light, rays, geometry, kernel, camera_pieces(self, rays))
