# SPDX-License-Identifier: BSD-3-Clause
"""A homogeneous medium without bounds: its airlight is the business of `realtime.kernels`.

The extinction is the same everywhere, so integrals leave out albedo sigma_t, and those of a grey medium are one number.
A kernel is a function ``kernel(geometry, x0, x1, medium, light) -> J [1/m]`` (`realtime.kernels.registry`), which
attenuates by exp(-sigma_t (x + r)).
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr

from realtime.scene.media.medium import LitRays, Medium
from realtime.scene.phase import Phase


@dataclass(frozen=True)
class Homogeneous(Medium):
    """A homogeneous medium. One extinction for a grey medium, three for a coloured one: code runs once for each."""

    sigma_t: tuple[Any, ...]  #: extinction [1/m], one or three values
    albedo: Any
    phase: Phase

    @property
    def channels(self):
        """One, or three."""
        return len(self.sigma_t)

    @property
    def vacuum(self):
        """Whether an extinction is 0."""
        return any(float(own[0]) == 0 for own in self.sigma_t)

    def extinction(self, rays, x):
        """Return sigma_t [1/m]."""
        return self.sigma_t

    def optical_depth(self, rays, x0, x1):
        """Return sigma_t (x1 - x0) [1]."""
        return tuple(sigma_t * (x1 - x0) for sigma_t in self.sigma_t)

    def length_of(self, depth):
        """Return `depth` over the smallest extinction [m]."""
        return depth / self.least_extinction()

    def depth_to_light(self, light, point, r, active=True):
        """Return sigma_t r [1]."""
        return tuple(sigma_t * r for sigma_t in self.sigma_t)

    def source(self, rays, x, angle):
        """Return the phase function [1]: the rest is the same everywhere."""
        return angle(self.phase)

    @property
    def unit(self):
        """Albedo sigma_t [1/m]."""
        return self.albedo * self.colour(self.sigma_t)

    def lit(self, rays, light, geometry, *, kernel=None, form="kernel"):
        """Return rays with one light; `form` is for bounded media."""
        return HomogeneousRays(self, light, rays, geometry, kernel)

    def thicker(self, factor):
        """Return it with the extinction times a factor."""
        return replace(self, sigma_t=tuple(dr.opaque(type(own), factor * float(own[0])) for own in self.sigma_t))

    def per_extinction(self, function: Callable[[Any], Any]):
        """Return `function(sigma_t)` for a grey medium, and its three values as a colour for a coloured one."""
        return self.colour([function(sigma_t) for sigma_t in self.sigma_t])

    def least_extinction(self):
        """Return the smallest extinction of the channels [1/m]."""
        least = self.sigma_t[0]
        for sigma_t in self.sigma_t[1:]:
            least = dr.minimum(least, sigma_t)
        return least


@dataclass(frozen=True)
class HomogeneousRays(LitRays):
    """Rays in a homogeneous medium with one light: integrals are J [1/m], by the kernel."""

    def nothing(self, width):
        """Return 0 for a grey medium and otherwise black, for some rays."""
        grey = self.medium.channels == 1
        return dr.zeros(type(self.medium.sigma_t[0]) if grey else type(self.medium.albedo), width)

    def airlight(self, x0, x1):
        """Return J over the part of [x0, x1] [m] that the light's cone reaches [1/m]; valid where the kernel is."""
        return self.kernel(self.geometry, *self.geometry.lit_segment(x0, x1), self.medium, self.light)
