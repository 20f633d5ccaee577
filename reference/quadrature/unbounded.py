# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit intervals in one unbounded medium, added up for every ray, with an error bound."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.panels import airlight_segments
from reference.scene.read import TruthLight, TruthMedium
from reference.visibility.intervals import LitIntervals
from reference.visibility.spot_cone import cone_interval, falloff

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Rays:
    """Camera rays in the plane of the ray and a light."""

    direction: Array  #: unit, (n, 3)
    normal: Array  #: unit vector from the light to the foot point, (n, 3)
    foot: Array  #: distance from the camera to the foot point, (n,) [m]
    height: Array  #: distance from the light to the foot point, (n,) [m]


def sum_intervals(
    medium: TruthMedium,
    light: TruthLight,
    rays: Rays,
    lit: LitIntervals,
    shadow_scale: float,
    rtol: float = 1e-10,
) -> tuple[Array, Array]:
    """Integrate every lit interval and add up the intervals of each ray.

    Parameters
    ----------
    medium
        The medium without bounds.
    light
        A point or spot light.
    rays
        The camera rays as the light sees them.
    lit
        Their lit intervals, in angles at the light [rad].
    shadow_scale
        The share of the leg from the light that is attenuated over.
    rtol
        Relative tolerance of each integral [1].

    Returns
    -------
    radiance, bound
        And the bound of its error, (rays, 3) each [W/(m^2 sr)].
    """
    ray, x0, x1 = lit_stretches(light, rays, lit)

    def profile(x: Array, index: NDArray[np.int64]) -> Array:
        rows = ray[index]
        theta = np.arctan2(x - rays.foot[rows, None], rays.height[rows, None])
        return falloff(theta, rays.direction[rows], rays.normal[rows], light)

    values, errors = np.empty((3, len(ray))), np.empty((3, len(ray)))
    for channel, sigma_t in enumerate(medium.sigma_t):
        if channel and sigma_t == medium.sigma_t[0]:
            values[channel], errors[channel] = values[0], errors[0]
            continue
        values[channel], errors[channel] = airlight_segments(
            rays.foot[ray],
            rays.height[ray],
            x0,
            np.maximum(x1, x0),
            float(sigma_t),
            medium.phase,
            shadow_scale=shadow_scale,
            weight=profile if light.is_soft else None,
            rtol=rtol,
        )
        errors[channel] += lit.edge * edge_worth(rays, ray, (x0, x1), float(sigma_t), medium)
    factor = medium.albedo * medium.sigma_t * light.intensity / (4 * np.pi)
    pixels = len(rays.foot)
    return sums_of(ray, values.T, pixels) * factor, sums_of(ray, errors.T, pixels) * factor


def edge_worth(
    rays: Rays, ray: NDArray[np.int64], ends: tuple[Array, Array], sigma_t: float, medium: TruthMedium
) -> Array:
    """Return what a relative uncertainty of one of the distances of the ends of each interval is worth.

    Parameters
    ----------
    rays, ray
        The rays, and the number of that of each interval, (intervals,).
    ends
        Distances at which they begin and end, (intervals,) each [m].
    sigma_t, medium
        One of the extinction coefficients [1/m], and the medium.

    Returns
    -------
    numpy.ndarray
        (intervals,) [1/m].
    """
    total = np.zeros(len(ray))
    for x in ends:
        s = np.where(np.isfinite(x), x, 0) - rays.foot[ray]
        r = np.hypot(rays.height[ray], s)
        with np.errstate(divide="ignore", invalid="ignore"):
            strip = np.exp(-sigma_t * (rays.foot[ray] + s + r)) * medium.phase(-s / r) / r
        total += np.where(np.isfinite(x) & (r > 0), strip, 0)
    return total


def sums_of(owner: NDArray[np.int64], values: Array, count: int) -> Array:
    """Add up the rows that belong to each owner.

    Parameters
    ----------
    owner
        Of each row, from 0 on, (n,).
    values
        (n, columns), in any unit, such as [1/m].
    count
        Number of owners.

    Returns
    -------
    numpy.ndarray
        (count, columns), in the unit of the values.
    """
    return np.stack([np.bincount(owner, column, count) for column in values.T], axis=1)


def lit_stretches(light: TruthLight, rays: Rays, lit: LitIntervals) -> tuple[NDArray[np.int64], Array, Array]:
    """Return lit intervals by distance, cut where a soft spot has kinks.

    Parameters
    ----------
    light
        A point or spot light.
    rays
        The camera rays as the light sees them.
    lit
        Their lit intervals, in angles at the light [rad].

    Returns
    -------
    ray, x0, x1
        Number of the ray and distances of both ends [m], x1 may be infinite, (parts,) each.
    """
    ray, low, high = _cut_at_beam(light, rays, lit)
    foot, height = rays.foot[ray], rays.height[ray]
    x0 = np.maximum(foot + height * np.tan(low), 0.0)
    x1 = np.where(high >= np.pi / 2, np.inf, foot + height * np.tan(np.minimum(high, np.pi / 2)))
    return ray, x0, x1


def _cut_at_beam(light: TruthLight, rays: Rays, lit: LitIntervals) -> tuple[NDArray[np.int64], Array, Array]:
    """Cut the intervals at the cone of full intensity, where the profile of a soft spot has its kinks."""
    if not light.is_soft or light.cosine:
        return lit.ray, lit.low, lit.high
    inner0, inner1 = cone_interval(rays.direction[lit.ray], rays.normal[lit.ray], light, light.beam)
    # Where the ray misses the beam the profile is smooth but for the middle of the cone, where it peaks: cut there.
    middle = 0.5 * (inner0 + inner1)
    misses = inner1 < inner0
    inner0, inner1 = np.where(misses, middle, inner0), np.where(misses, middle, inner1)
    cuts = np.clip(np.stack([inner0, inner1]), lit.low, lit.high)
    low = np.concatenate([lit.low, cuts[0], cuts[1]])
    high = np.concatenate([cuts[0], cuts[1], lit.high])
    ray = np.tile(lit.ray, 3)
    keep = high > low
    return ray[keep], low[keep], high[keep]
