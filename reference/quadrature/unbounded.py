# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit intervals in one unbounded medium, added up for every ray, with an error bound."""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.panels import airlight_segments
from reference.quadrature.height_fog import height_stretch_sums
from reference.scene.height_fog import HeightMedium
from reference.scene.read import TruthLight, TruthMedium
from reference.visibility.certificate import LitIntervals
from reference.visibility.planes import Rays, cone_interval, falloff

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Stretches = tuple[Index, Array, Array]  # rays, and distances of both ends [m]
Profile = Callable[[Array, Index], Array]  # distances, (m, k) [m], and rays, (m,) -> intensity over that on the axis


def sum_intervals(
    medium: TruthMedium | HeightMedium,
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
        The medium without bounds, or height fog.
    light
        A point or spot light.
    rays, lit
        The camera rays in their planes with the light, and their lit intervals.
    shadow_scale
        The share of the shadow segment that is attenuated over.
    rtol
        Relative tolerance of each integral [1].

    Returns
    -------
    radiance, bound
        And the bound of its error, (rays, 3) each [W/(m^2 sr)].
    """
    stretches = lit_stretches(light, rays, lit)
    how: dict[str, Any] = {
        "profile": profile_of(light, rays),
        "shadow_scale": shadow_scale,
        "rtol": rtol,
        "edge": lit.edge,
    }
    values, errors = stretch_sums(medium, rays, stretches, **how)
    count = len(rays.foot)
    return sums_of(stretches[0], values, count) * light.intensity, sums_of(
        stretches[0], errors, count
    ) * light.intensity


def stretch_sums(
    medium: TruthMedium | HeightMedium,
    rays: Rays,
    stretches: Stretches,
    *,
    profile: Profile | None,
    shadow_scale: float,
    rtol: float,
    edge: float = 0.0,
) -> tuple[Array, Array]:
    """Return the airlight of each lit stretch for a light of intensity 1, and the bound of its error, (stretches, 3).

    In 1/(m^2 sr).

    Parameters
    ----------
    medium, rays
        The medium without bounds, and the rays in their planes with lights at places.
    stretches
        Of the rays.
    profile
        Of the lights; None: they are isotropic.
    shadow_scale, rtol
        See `sum_intervals`.
    edge
        Relative uncertainty of the distance of both ends from the light.
    """
    if isinstance(medium, HeightMedium):
        how: dict[str, Any] = {"profile": profile, "shadow_scale": shadow_scale, "rtol": rtol, "edge": edge}
        return height_stretch_sums(medium, rays, stretches, **how)
    ray, x0, x1 = stretches
    foot, height = rays.foot[ray], rays.height[ray]
    weight = None if profile is None else lambda x, row: profile(x, ray[row])
    values, errors = np.zeros((len(ray), 3)), np.zeros((len(ray), 3))
    known: dict[float, tuple[Array, Array]] = {}
    for channel, sigma_t in enumerate(medium.sigma_t.tolist()):
        if sigma_t not in known:
            how = {"shadow_scale": shadow_scale, "weight": weight, "rtol": rtol}
            value, error = airlight_segments(foot, height, x0, np.maximum(x0, x1), sigma_t, medium.phase, **how)
            known[sigma_t] = value, error + edge * _edge_worth((foot, height), (x0, x1), sigma_t, medium)
        factor = medium.albedo[channel] * sigma_t / (4 * np.pi)
        values[:, channel], errors[:, channel] = (factor * column for column in known[sigma_t])
    return values, errors


def _edge_worth(plane: tuple[Array, Array], ends: tuple[Array, Array], sigma_t: float, medium: TruthMedium) -> Array:
    """Return what a relative uncertainty of one of the distances of the ends of each interval is worth [1/m]."""
    foot, height = plane
    total = np.zeros(len(foot))
    for x in ends:
        s = np.where(np.isfinite(x), x, 0) - foot
        r = np.hypot(height, s)
        with np.errstate(divide="ignore", invalid="ignore"):
            strip = np.exp(-sigma_t * (foot + s + r)) * medium.phase(-s / r) / r
        total += np.where(np.isfinite(x) & (r > 0), strip, 0)
    return total


def sums_of(owner: Index, values: Array, count: int) -> Array:
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


def profile_of(light: TruthLight, rays: Rays) -> Profile | None:
    """Return the profile of a light along rays; None for one that is isotropic in its cone."""
    if not light.is_soft:
        return None
    return lambda x, ray: falloff(np.arctan2(x - rays.foot[ray, None], rays.height[ray, None]), rays[ray], light)


def cosine_profile(rays: Rays, normal: Array) -> Profile:
    """Return the cosine at samples of a light with unit normals, (rays, 3), along rays in their planes with these."""
    start = np.sum(normal * (rays.origin - rays.position), axis=1)
    rise = np.sum(normal * rays.direction, axis=1)

    def cosine(x: Array, ray: Index) -> Array:
        r = np.hypot(rays.height[ray, None], x - rays.foot[ray, None])
        return np.maximum(start[ray, None] + rise[ray, None] * x, 0.0) / np.maximum(r, np.finfo(float).tiny)

    return cosine


def lit_stretches(light: TruthLight, rays: Rays, lit: LitIntervals) -> Stretches:
    """Return lit intervals, cut at the cone of full intensity, where the profile of a soft spot has its kinks.

    Parameters
    ----------
    light, rays, lit
        See `sum_intervals`.
    """
    ray, low, high = lit.ray, np.maximum(lit.low, 0.0), lit.high
    if not light.is_soft or light.cosine:
        return ray, low, high
    inner0, inner1 = cone_interval(rays[ray], light, light.beam)
    # Where the ray misses the beam the profile is smooth but for the middle of the cone, where it peaks: cut there.
    middle = 0.5 * (inner0 + inner1)
    misses = inner1 < inner0
    ends = np.where(misses, middle, inner0), np.where(misses, middle, inner1)
    cuts = np.clip(np.stack([rays.distance(end, ray) for end in ends]), low, high)
    low, high = np.concatenate([low, *cuts]), np.concatenate([*cuts, high])
    keep = high > low
    return np.tile(ray, 3)[keep], low[keep], high[keep]
