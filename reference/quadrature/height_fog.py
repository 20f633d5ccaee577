# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit stretches in height fog, with a bound of its error: `analytic.height_fog` in the rays' planes."""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from analytic.height_fog import HeightFog, HeightRays, Layer, height_fog_segments, height_fog_sun
from reference.scene.height_fog import HeightMedium
from reference.visibility.planes import Rays

Array = NDArray[np.float64]
Index = NDArray[np.int64]

_ROUNDING = 64 * np.finfo(np.float64).eps  # of a sum of optical depths, for one of 1


def fog_of(medium: HeightMedium) -> HeightFog:
    """Return the density of height fog."""
    layers = tuple(Layer(*layer) for layer in medium.layers)
    return HeightFog(layers, medium.constant, medium.clamped, medium.floor, medium.cap)


def height_fog_depth(medium: HeightMedium, origin: Array, direction: Array, low: Array, high: Array) -> Array:
    """Return the optical depth of parts of rays from distances `low` to `high`, (n,) [m]."""
    start, rise = origin @ medium.up, direction @ medium.up
    length = np.maximum(high - low, 0.0)
    return fog_of(medium).optical_depth(start + low * rise, start + low * rise + length * rise, length)


def height_fog_exit(medium: HeightMedium, origin: Array, direction: Array) -> Array:
    """Return the distance at which rays leave height fog for good, (n,) [m]: infinite on a level in it."""
    start, rise = origin @ medium.up, direction @ medium.up
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = np.stack([(z - start) / rise for z in (medium.floor, medium.cap)])
    level = np.where((start >= medium.floor) & (start <= medium.cap), np.inf, 0.0)
    return np.where(rise == 0, level, np.maximum(ends.max(axis=0), 0.0))


def height_stretch_sums(
    medium: HeightMedium,
    rays: Rays,
    stretches: tuple[Index, Array, Array],
    *,
    profile: Callable[[Array, Index], Array] | None,
    shadow_scale: float,
    rtol: float,
    edge: float,
) -> tuple[Array, Array]:
    """Return the airlight of lit stretches from lights at places, as `reference.quadrature.unbounded.stretch_sums`."""
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    of_light = np.broadcast_to(rays.position, rays.direction.shape)[ray] @ medium.up
    heights = HeightRays(
        np.broadcast_to(rays.origin @ medium.up, len(ray)),
        rays.direction[ray] @ medium.up,
        rays.foot[ray],
        rays.height[ray],
        of_light,
    )
    weight = None if profile is None else lambda x, row: profile(x, ray[row])
    value, error = height_fog_segments(
        fog, heights, x0, np.maximum(x0, x1), medium.phase, shadow_scale=shadow_scale, weight=weight, rtol=rtol
    )
    for x in (x0, x1):  # a relative uncertainty of the distance from the light is worth r times the integrand
        s = np.where(np.isfinite(x), x, rays.foot[ray]) - rays.foot[ray]
        r = np.maximum(np.hypot(rays.height[ray], s), np.finfo(np.float64).tiny)
        z = heights.origin + heights.rise * (heights.foot + s)
        depth = fog.optical_depth(heights.origin, z, heights.foot + s)
        depth = depth + fog.optical_depth(z, of_light, r)
        with np.errstate(over="ignore"):
            strip = np.exp(fog.log_density(z) - depth) * medium.phase(-s / r) / r
        error = error + edge * np.where(np.isfinite(x), strip, 0.0)
    factor = medium.albedo / (4 * np.pi)
    return value[:, None] * factor, error[:, None] * factor


def sun_stretch_sums(
    medium: HeightMedium, rays: Rays, stretches: tuple[Index, Array, Array], edge: Array
) -> tuple[Array, Array]:
    """Return the airlight of lit stretches for a sun of irradiance 1, in closed form, and its bound [1/sr].

    Parameters
    ----------
    medium, rays
        The fog, and the rays in their planes with the direction towards the sun.
    stretches
        Rays, and distances of both ends, of which the second may be infinite [m].
    edge
        Uncertainty of the ends of the stretches of each ray [m].
    """
    ray, x0, x1 = stretches
    fog = fog_of(medium)
    origin, rise = float(rays.origin @ medium.up), rays.direction[ray] @ medium.up
    mu = float(np.broadcast_to(rays.position, rays.direction.shape)[0] @ medium.up) if len(rays.direction) else 1.0
    phase = medium.phase(rays.foot[ray])
    value = height_fog_sun(fog, origin, rise, x0, x1, sun=mu, phase=phase)
    error = np.zeros_like(value)
    for x in (x0, x1):
        at = np.where(np.isfinite(x), x, 0.0)
        z = origin + rise * at
        depth = fog.optical_depth(origin, z, at) + fog.column(z) / mu
        with np.errstate(over="ignore"):
            f = np.exp(fog.log_density(z) - depth) * phase
        error += edge[ray] * np.where(np.isfinite(x), f, 0.0)
        # The exponent carries the rounding of its own size and of heights in scale heights.
        error += _ROUNDING * value * (1 + np.where(np.isfinite(depth), np.minimum(depth, 745.0), 0.0))
    factor = medium.albedo / (4 * np.pi)
    return value[:, None] * factor, error[:, None] * factor
