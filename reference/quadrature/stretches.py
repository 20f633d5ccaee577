# SPDX-License-Identifier: BSD-3-Clause
"""Lit stretches of rays, and how lights shine on them: what every medium is asked about."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.read import ReferenceLight, ReferenceMedium
from airlight.reference.scene.varying import VaryingMedium
from airlight.reference.visibility.certificate import LitIntervals
from airlight.reference.visibility.planes import Rays, cone_interval, falloff

Array = NDArray[np.float64]
Index = NDArray[np.int64]
Stretches = tuple[Index, Array, Array]  # rays, and distances of both ends [m]
# distances, (m, k) [m], and rays, (m,) -> intensity over that on the axis
Profile = Callable[[Array, Index], Array]
#: An error that is a derived upper bound, or an estimate from two values of the same
#: quantity: by two rules, or two steps.
BoundKind = Literal["proven", "estimated"]


@dataclass(frozen=True)
class Terms:
    """How lights of strength 1 shine on the lit stretches that are summed, and
    how well these are known.
    """

    profile: Profile | None = None  #: of lights at places; None: they are isotropic
    #: fraction of the way to a place that attenuates, from the scattering point on
    shadow_scale: float = 1.0
    #: uncertainty of ends: relative to their distance from a place, or by ray a length [m]
    edge: float | Array = 0.0
    rounding: Array | None = None  #: uncertainty of the places of kinks, by ray [m]
    rtol: float | None = None  #: relative tolerance of a sum; the field's own by default


TERMS = Terms()


def strongest(medium: ReferenceMedium | VaryingMedium) -> Array:
    """Return the most that a metre of a ray scatters in a medium, albedo sigma_t p, (3,) [1/m]."""
    return medium.albedo * medium.largest * float(medium.phase(np.linspace(-1, 1, 1001)).max())


def sums_of(owner: Index, values: Array, count: int) -> Array:
    """Add up the rows that belong to each owner.

    `owner`: of each row, from 0 on, (n,); `values`: (n, columns), in any unit, such as [1/m];
    `count`: number of owners. Returns (count, columns), in the unit of the values.
    """
    return np.stack([np.bincount(owner, column, count) for column in values.T], axis=1)


def profile_of(light: ReferenceLight, rays: Rays) -> Profile | None:
    """Return the profile of a light along rays; None for one that is isotropic in its cone."""
    if not light.is_soft:
        return None
    return lambda x, ray: falloff(
        np.arctan2(x - rays.foot[ray, None], rays.height[ray, None]), rays[ray], light
    )


def cosine_profile(rays: Rays, normal: Array) -> Profile:
    """Return the cosine at samples of a light with unit normals, (rays, 3), along rays in
    their planes with these.
    """
    # n . (o + x w - y) of the derivation is linear in x.
    start = np.sum(normal * (rays.origin - rays.position), axis=1)
    rise = np.sum(normal * rays.direction, axis=1)

    def cosine(x: Array, ray: Index) -> Array:
        r = np.hypot(rays.height[ray, None], x - rays.foot[ray, None])
        return np.maximum(start[ray, None] + rise[ray, None] * x, 0.0) / np.maximum(
            r, np.finfo(float).tiny
        )

    return cosine


def lit_stretches(light: ReferenceLight, rays: Rays, lit: LitIntervals) -> Stretches:
    """Return lit intervals, cut at the cone of full intensity, where the profile of a
    soft spot has its kinks.

    `light`, `rays`, `lit`: a point or spot light, the rays in their planes with it,
    and their lit intervals.
    """
    ray, low, high = lit.ray, np.maximum(lit.low, 0.0), lit.high
    if not light.is_soft or light.cosine:
        return ray, low, high
    inner0, inner1 = cone_interval(rays[ray], light, light.beam)
    # Where the ray misses the beam the profile is smooth except for the middle of the cone,
    # where it peaks: cut there.
    middle = 0.5 * (inner0 + inner1)
    misses = inner1 < inner0
    ends = np.where(misses, middle, inner0), np.where(misses, middle, inner1)
    cuts = np.clip(np.stack([rays.distance(end, ray) for end in ends]), low, high)
    low, high = np.concatenate([low, *cuts]), np.concatenate([*cuts, high])
    # Each interval falls into three parts: before, in and behind the beam; most have one.
    keep = high > low
    return np.tile(ray, 3)[keep], low[keep], high[keep]
