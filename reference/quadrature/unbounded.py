# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of lit intervals in one unbounded medium, added up for every ray, with an error bound."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.panels import airlight_segments
from reference.scene.read import ReferenceLight, ReferenceMedium
from reference.scene.varying import VaryingMedium
from reference.visibility.certificate import LitIntervals
from reference.visibility.planes import Rays, cone_interval, falloff

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Stretches = tuple[Index, Array, Array]  # rays, and distances of both ends [m]
Profile = Callable[[Array, Index], Array]  # distances, (m, k) [m], and rays, (m,) -> intensity over that on the axis


RTOL = 1e-10  #: of the integral of each stretch


@dataclass(frozen=True)
class Terms:
    """How lights of strength 1 shine on the lit stretches that are summed, and how well these are known."""

    profile: Profile | None = None  #: of lights at places; None: they are isotropic
    shadow_scale: float = 1.0  #: fraction of the way to a place that attenuates, from the scattering point on
    edge: float | Array = 0.0  #: uncertainty of ends: relative to their distance from a place, or by ray a length [m]
    rounding: Array | None = None  #: uncertainty of the places of kinks, by ray [m]
    rtol: float | None = None  #: relative tolerance of a sum; the field's own by default


TERMS = Terms()


@dataclass(frozen=True)
class Unbounded:
    """One homogeneous medium everywhere, or a vacuum; a field (`reference.quadrature.fields`)."""

    medium: ReferenceMedium

    @property
    def strongest(self) -> Array:
        """The most that a metre of a ray scatters, (3,) [1/m]."""
        return strongest(self.medium)

    def optical_depth(self, origin: Array, direction: Array, low: Array, high: Array) -> Array:
        """Return the optical depth of parts of straight lines, (n, 3) [1]."""
        return np.maximum(high - low, 0.0)[:, None] * self.medium.sigma_t

    def leave(self, origin: Array, direction: Array) -> Array:
        """Return the distance behind which rays meet nothing that scatters, (n,) [m]."""
        return np.full(len(direction), np.inf if self.strongest.any() else 0.0)

    def sums(self, rays: Rays, stretches: Stretches, distance: Array, terms: Terms = TERMS) -> tuple[Array, Array]:
        """Return the airlight of each ray and its bound; of a direction nothing: it reaches no fog without end."""
        ray, x0, x1 = stretches
        values, errors = np.zeros((len(ray), 3)), np.zeros((len(ray), 3))
        foot, height, medium = rays.foot[ray], rays.height[ray], self.medium
        weight = weight_of(terms.profile, ray)
        known: dict[float, tuple[Array, Array]] = {}
        for channel, sigma_t in enumerate(medium.sigma_t.tolist() if rays.w else []):
            if sigma_t not in known:
                how: dict[str, Any] = {
                    "shadow_scale": terms.shadow_scale,
                    "weight": weight,
                    "rtol": terms.rtol or RTOL,
                }
                value, error = airlight_segments(foot, height, x0, np.maximum(x0, x1), sigma_t, medium.phase, **how)
                known[sigma_t] = value, error + terms.edge * _edge_worth((foot, height), (x0, x1), sigma_t, medium)
            factor = medium.albedo[channel] * sigma_t / (4 * np.pi)
            values[:, channel], errors[:, channel] = (factor * column for column in known[sigma_t])
        return sums_of(ray, values, len(rays.foot)), sums_of(ray, errors, len(rays.foot))


def weight_of(profile: Profile | None, ray: Index) -> Callable[[Array, Index], Array] | None:
    """Return a profile by the numbers of the stretches of these rays."""
    return None if profile is None else lambda x, row: profile(x, ray[row])


def strongest(medium: ReferenceMedium | VaryingMedium) -> Array:
    """Return the most that a metre of a ray scatters in a medium, albedo sigma_t p, (3,) [1/m]."""
    return medium.albedo * medium.largest * float(medium.phase(np.linspace(-1, 1, 1001)).max())


def _edge_worth(
    plane: tuple[Array, Array], ends: tuple[Array, Array], sigma_t: float, medium: ReferenceMedium
) -> Array:
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

    `owner`: of each row, from 0 on, (n,); `values`: (n, columns), in any unit, such as [1/m]; `count`: number of
    owners. Returns (count, columns), in the unit of the values.
    """
    return np.stack([np.bincount(owner, column, count) for column in values.T], axis=1)


def profile_of(light: ReferenceLight, rays: Rays) -> Profile | None:
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


def lit_stretches(light: ReferenceLight, rays: Rays, lit: LitIntervals) -> Stretches:
    """Return lit intervals, cut at the cone of full intensity, where the profile of a soft spot has its kinks.

    `light`, `rays`, `lit`: a point or spot light, the rays in their planes with it, and their lit intervals.
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
