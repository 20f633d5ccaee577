# SPDX-License-Identifier: BSD-3-Clause
"""The airlight of one point or spot light along every ray, by the steps of `reference.quadrature.ray_values`."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from reference.quadrature.bounded import sum_media
from reference.quadrature.segments import Segments, camera_segments, scattering_range
from reference.quadrature.unbounded import Rays, sum_intervals
from reference.scene.read import TruthLight, TruthScene
from reference.visibility.intervals import LitIntervals
from reference.visibility.lit_intervals import lit_intervals
from reference.visibility.spot_cone import cone_interval, perpendicular

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LightAirlight:
    """What one light sends into the rays."""

    radiance: Array  #: in-scattered, (rays, 3) [W/(m^2 sr)]
    bound: Array  #: of its error, (rays, 3) [W/(m^2 sr)]
    angle: Array  #: between the ray and the direction to the light, pi where that is not before the surface [rad]
    lit: LitIntervals  #: the intervals that were integrated
    reached: NDArray[np.bool_] | None  #: whether the light reaches the end of the ray; None if that was not looked at


@dataclass(frozen=True)
class LitRays:
    """The rays in their planes with one light, and which parts of them it reaches."""

    rays: Rays
    lit: LitIntervals  #: up to the surface, in the cone of a spot, and where a medium scatters
    segments: Segments | None  #: the media along the rays, where these have bounds
    end: Array  #: angle at the light of the visible surface, (rays,) [rad]


def light_airlight(
    truth: TruthScene,
    light: TruthLight,
    distance: Array,
    *,
    shadow_scale: float,
    how: dict[str, Any],
    **tolerance: float,
) -> LightAirlight:
    """Compute the airlight of one point or spot light along every ray.

    Parameters
    ----------
    truth, light
        The scene and one of its lights, or a point of a light with extent.
    distance
        To the visible surface, (rays,), infinite where there is none [m].
    shadow_scale
        See `reference.quadrature.image.quadrature_image`.
    how
        What `reference.visibility.lit_intervals.lit_intervals` takes to find the lit intervals.
    tolerance
        `rtol` of the integrals; by default, what `sum_intervals` and `sum_media` take.
    """
    reaches = lit_rays(truth, light, distance, how)
    rays, lit, segments = reaches.rays, reaches.lit, reaches.segments
    if segments is None:
        radiance, bound = sum_intervals(truth.medium, light, rays, lit, shadow_scale, **tolerance)
    else:
        radiance, bound = sum_media(truth, light, rays, lit, segments, shadow_scale=shadow_scale, **tolerance)
    in_front = (rays.foot > 0) & (rays.foot < distance)
    angle = np.where(in_front, np.arctan2(rays.height, rays.foot), np.pi)
    bound += _worth_of_doubt(light, rays, lit, truth)
    # Intervals end at a bound of the media, not at the surface, where there are any.
    reached = None if segments is not None else _reach(lit, reaches.end)
    return LightAirlight(radiance, bound, angle, lit, reached)


def lit_rays(truth: TruthScene, light: TruthLight, distance: Array, how: dict[str, Any]) -> LitRays:
    """Return which parts of the rays a point or spot light reaches.

    Parameters
    ----------
    truth, light, distance, how
        See `light_airlight`.
    """
    direction = truth.direction
    foot, height = foot_and_height(np.broadcast_to(truth.origin, direction.shape), direction, light.position)
    normal = perpendicular(truth.origin, direction, light)
    theta0 = np.arctan2(-foot, height)
    ended = np.isfinite(distance)
    theta1 = np.where(ended, np.arctan2(np.where(ended, distance, 0) - foot, height), np.pi / 2)
    cone = cone_interval(direction, normal, light, light.cutoff)
    ends = np.maximum(theta0, cone[0]), np.minimum(theta1, cone[1])
    segments = camera_segments(truth, distance) if truth.media else None
    if segments is not None:
        first, last = (np.arctan2(x - foot, height) for x in scattering_range(segments))
        ends = np.maximum(ends[0], first), np.minimum(ends[1], last)
    lit = lit_intervals(truth, light, (direction, normal, height), ends=ends, **how)
    return LitRays(Rays(direction, normal, foot, height), lit, segments, theta1)


def _reach(lit: LitIntervals, end: Array) -> NDArray[np.bool_]:
    """Return by ray whether its last lit interval goes on to an angle."""
    last = np.full(len(end), -np.inf)
    np.maximum.at(last, lit.ray, lit.high)
    return last >= end - 1e-12


def _worth_of_doubt(light: TruthLight, rays: Rays, lit: LitIntervals, truth: TruthScene) -> Array:
    """Return the most that the angles which the shadow rays left in doubt can be worth, (rays, 3).

    In theta the integrand of J is exp(-sigma_t (x + r)) p / height; the exponential is at most one, and the phase
    function at most its largest value.
    """
    worth = np.zeros((len(rays.foot), 3))
    if lit.doubt is None:
        return worth
    ray, _, width = lit.doubt
    for medium in (truth.medium, *truth.media):
        strongest = medium.phase(np.linspace(-1, 1, 1001)).max()
        factor = medium.albedo * medium.sigma_t * light.intensity / (4 * np.pi) * strongest
        np.add.at(worth, ray, (width / rays.height[ray])[:, None] * factor)
    return worth
