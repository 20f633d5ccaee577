# SPDX-License-Identifier: BSD-3-Clause
"""Height fog: its airlight is `analytic.height_fog` in the rays' planes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.height_fog import (
    HeightFog,
    HeightRays,
    Layer,
    height_fog_segments,
    height_fog_sun,
)
from airlight.reference.quadrature.integrate import (
    TERMS,
    ErrorKind,
    Terms,
    strongest,
    sums_of,
)
from airlight.reference.quadrature.intervals import Stretches
from airlight.reference.scene.varying import HeightMedium
from airlight.reference.visibility.planes import Rays

Array = NDArray[np.float64]


def fog_of(medium: HeightMedium) -> HeightFog:
    """Return the density of height fog."""
    layers = tuple(Layer(*layer) for layer in medium.layers)
    return HeightFog(layers, medium.constant, medium.clamped, medium.floor, medium.cap)


@dataclass(frozen=True)
class HeightField:
    """Height fog without sides; a field (`reference.quadrature.fields`)."""

    medium: HeightMedium

    @property
    def error_kind(self) -> ErrorKind:
        """The kind of the errors: the integrand is analytic on a piece, and the worse
        rule bounds the better one.
        """
        return "proven"

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, (3,) [1/m]."""
        return strongest(self.medium)

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1]."""
        start, rise = np.asarray(origin) @ self.medium.up, direction @ self.medium.up
        length = np.maximum(high - low, 0.0)
        depth = fog_of(self.medium).optical_depth(
            start + low * rise, start + low * rise + length * rise, length
        )
        return np.repeat(depth[:, None], 3, axis=1)

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance at which rays leave the fog for good, (n,) [m]:
        infinite on a level in it.
        """
        start, rise = origin @ self.medium.up, direction @ self.medium.up
        with np.errstate(divide="ignore", invalid="ignore"):
            ends = np.stack([(z - start) / rise for z in (self.medium.floor, self.medium.cap)])
        # A level ray stays in the fog for ever, or is never in it.
        level = np.where((start >= self.medium.floor) & (start <= self.medium.cap), np.inf, 0.0)
        return np.where(rise == 0, level, np.maximum(ends.max(axis=0), 0.0))

    def sums(
        self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS
    ) -> tuple[Array, Array]:
        """Return the airlight of each ray from its lit stretches, and a bound of
        its error, (rays, 3) each.
        """
        if rays.w:
            value, error = _of_places(self.medium, rays, stretches, terms)
        else:
            value, error = _of_suns(
                self.medium, rays, stretches, np.broadcast_to(terms.edge, len(rays.foot))
            )
        factor, ray = self.medium.albedo / (4 * np.pi), stretches[0]
        value, error = (
            sums_of(ray, part[:, None] * factor, len(rays.foot)) for part in (value, error)
        )
        return value, error


def _of_places(
    medium: HeightMedium, rays: Rays, stretches: Stretches, terms: Terms
) -> tuple[Array, Array]:
    """Return sigma_t J of lit stretches and its error, (stretches,) [1/m^2]."""
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    of_light = np.broadcast_to(rays.position, rays.direction.shape)[ray] @ medium.up
    # Fog depends on the height alone: the closed form needs the heights of origin and light, the
    # rise of the ray, and the place of the light about the ray.
    heights = HeightRays(
        np.broadcast_to(rays.origin @ medium.up, len(ray)),
        rays.direction[ray] @ medium.up,
        rays.foot[ray],
        rays.height[ray],
        of_light,
    )
    profile = terms.profile
    weight = None if profile is None else lambda x, row: profile(x, ray[row])
    # The relative tolerance of the integral of each stretch.
    value, error = height_fog_segments(
        fog,
        heights,
        x0,
        np.maximum(x0, x1),
        medium.phase,
        shadow_scale=terms.shadow_scale,
        weight=weight,
        rtol=terms.rtol or 1e-10,
    )
    # The uncertainty of an end is relative to its distance r from the light: the strip there is r
    # edge long, and r times the integrand, which has 1/r^2, gives 1/r.
    for x in (x0, x1):
        s = np.where(np.isfinite(x), x, rays.foot[ray]) - rays.foot[ray]
        r = np.maximum(np.hypot(rays.height[ray], s), np.finfo(np.float64).tiny)
        z = heights.origin + heights.rise * (heights.foot + s)
        depth = fog.optical_depth(heights.origin, z, heights.foot + s)
        depth = depth + fog.optical_depth(z, of_light, r)
        with np.errstate(over="ignore"):
            strip = np.exp(fog.log_density(z) - depth) * medium.phase(-s / r) / r
        error = error + terms.edge * np.where(np.isfinite(x), strip, 0.0)
    return value, error


def _of_suns(
    medium: HeightMedium, rays: Rays, stretches: Stretches, edge: Array
) -> tuple[Array, Array]:
    """Return the light of lit stretches under suns of irradiance 1, in closed form, and its
    error, (stretches,) [1].
    """
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    origin, rise = float(rays.origin @ medium.up), rays.direction[ray] @ medium.up
    # The rise of the way to the sun, one for all rays.
    mu = (
        float(np.broadcast_to(rays.position, rays.direction.shape)[0] @ medium.up)
        if len(rays.direction)
        else 1.0
    )
    phase = medium.phase(rays.foot[ray])
    value = height_fog_sun(fog, origin, rise, x0, x1, sun=mu, phase=phase)
    error = np.zeros_like(value)
    for x in (x0, x1):
        # The strip at an end that is uncertain by `edge` [m]; at infinity there is no light.
        at = np.where(np.isfinite(x), x, 0.0)
        z = origin + rise * at
        depth = fog.optical_depth(origin, z, at) + fog.unbounded(z, mu)
        with np.errstate(over="ignore"):
            f = np.exp(fog.log_density(z) - depth) * phase
        error += edge[ray] * np.where(np.isfinite(x), f, 0.0)
        # The exponent carries the rounding of its own size and of heights in scale heights: 64
        # roundings of a sum of optical depths, for a depth of 1. Beyond a depth of 745 the light
        # is zero in float64.
        rounding = 64 * np.finfo(np.float64).eps
        error += (
            rounding * value * (1 + np.where(np.isfinite(depth), np.minimum(depth, 745.0), 0.0))
        )
    return value, error
