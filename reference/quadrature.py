# SPDX-License-Identifier: BSD-3-Clause
"""The truth of an image: certified airlight integrals summed over the lit intervals of every camera ray.

For each light and each pixel centre, in float64:

1. the visible surface ends the ray (cast in float32, as by every method, so that all share the same surface);
2. the cone of a spot and the visible surface bound the angle theta at the light (`reference.cone`);
3. ray-traced visibility cuts that range into lit intervals (`reference.visibility`);
4. each lit interval, cut once more where a spot's profile has its kinks, is integrated by `analytic.panels` to a
relative
   tolerance of 1e-10, with an error estimate.

The bound of a pixel adds the estimates and, for each edge between light and shadow, what a float32 rounding of the
edge's position is worth.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.geometry import foot_and_height
from analytic.panels import airlight_segments
from reference.cone import cone_interval, falloff, perpendicular
from reference.scene import TruthLight, TruthMedium, TruthScene
from reference.surface import lit_surface, surface_hits
from reference.visibility import LitIntervals, lit_intervals

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]

_EDGE = 2e-6  # relative uncertainty of the distance at which a float32 shadow ray changes its mind


@dataclass(frozen=True)
class TruthImage:
    """Radiance of every pixel centre; arrays of shape (height, width[, 3])."""

    airlight: Array  #: in-scattered radiance [W/(m^2 sr)]
    airlight_bound: Array  #: bound of its error [W/(m^2 sr)]
    surface: Array  #: radiance of the lit surface through the medium [W/(m^2 sr)]
    distance: Array  #: to the visible surface, infinite where there is none [m]
    light_angle: Array  #: smallest angle between the ray and the direction to a light in front of the surface [rad]
    transitions: int  #: edges between light and shadow that were bisected
    missed: float  #: share of random visibility samples that the intervals got wrong before these were added


def quadrature_image(
    truth: TruthScene, *, samples: int = 256, shadow_scale: float = 1.0, progress: Progress | None = None
) -> TruthImage:
    """Compute the truth of an image.

    Parameters
    ----------
    truth
        The scene.
    samples
        Visibility samples of each ray and light before bisection.
    shadow_scale
        Attenuate the leg from the light over this share of its length: 1 is the truth, 1 - epsilon what a renderer with
        a shadow-ray epsilon converges to (DESIGN section 6.1).
    progress
        Called with (done, total, what) after every light.

    Notes
    -----
    Valid for homogeneous unbounded media, point and spot lights, opaque surfaces. A pixel whose centre ray meets a
    light has an infinite airlight.
    """
    hits = surface_hits(truth)
    pixels = truth.width * truth.height
    airlight, bound = np.zeros((pixels, 3)), np.zeros((pixels, 3))
    light_angle = np.full(pixels, np.pi)
    transitions, missed = 0, 0.0
    for number, light in enumerate(truth.lights):
        light_value = _light_airlight(truth, light, hits.distance, samples=samples, shadow_scale=shadow_scale)
        airlight += light_value.radiance
        bound += light_value.bound
        light_angle = np.minimum(light_angle, light_value.angle)
        transitions += light_value.transitions
        missed = max(missed, light_value.missed)
        if progress is not None:
            progress(number + 1, len(truth.lights), "quadrature")
    shape = (truth.height, truth.width)
    return TruthImage(
        airlight.reshape(*shape, 3),
        bound.reshape(*shape, 3),
        lit_surface(truth, hits, shadow_scale=shadow_scale).reshape(*shape, 3),
        hits.distance.reshape(shape),
        light_angle.reshape(shape),
        transitions,
        missed,
    )


@dataclass(frozen=True)
class _LightAirlight:
    radiance: Array
    bound: Array
    angle: Array
    transitions: int
    missed: float


def _light_airlight(
    truth: TruthScene, light: TruthLight, distance: Array, *, samples: int, shadow_scale: float
) -> _LightAirlight:
    direction = truth.direction
    foot, height = foot_and_height(np.broadcast_to(truth.origin, direction.shape), direction, light.position)
    normal = perpendicular(truth.origin, direction, light)
    theta0 = np.arctan2(-foot, height)
    ended = np.isfinite(distance)
    theta1 = np.where(ended, np.arctan2(np.where(ended, distance, 0) - foot, height), np.pi / 2)
    cone = cone_interval(direction, normal, light, light.cutoff)
    ends = np.maximum(theta0, cone[0]), np.minimum(theta1, cone[1])
    lit = lit_intervals(truth, light, (direction, normal, height), ends=ends, samples=samples)
    rays = _Rays(direction, normal, foot, height)
    radiance, bound = _sum_intervals(truth.medium, light, rays, lit, shadow_scale)
    in_front = (foot > 0) & (foot < distance)
    angle = np.where(in_front, np.arctan2(height, foot), np.pi)
    return _LightAirlight(radiance, bound, angle, lit.transitions, lit.missed)


@dataclass(frozen=True)
class _Rays:
    direction: Array
    normal: Array
    foot: Array
    height: Array


def _sum_intervals(
    medium: TruthMedium, light: TruthLight, rays: _Rays, lit: LitIntervals, shadow_scale: float
) -> tuple[Array, Array]:
    """Integrate every lit interval and add up the intervals of each ray."""
    ray, low, high = _cut_at_beam(light, rays, lit)
    foot, height = rays.foot[ray], rays.height[ray]
    x0 = np.maximum(foot + height * np.tan(low), 0.0)
    x1 = np.where(high >= np.pi / 2, np.inf, foot + height * np.tan(np.minimum(high, np.pi / 2)))
    soft = light.axis is not None and light.beam < light.cutoff

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
            foot,
            height,
            x0,
            np.maximum(x1, x0),
            float(sigma_t),
            medium.phase,
            shadow_scale=shadow_scale,
            weight=profile if soft else None,
        )
        errors[channel] += _edge_error(rays, ray, (x0, x1), float(sigma_t), medium)
    factor = medium.albedo * medium.sigma_t * light.intensity / (4 * np.pi)
    pixels = len(rays.foot)
    total = np.stack([np.bincount(ray, values[c], pixels) for c in range(3)], axis=1) * factor
    error = np.stack([np.bincount(ray, errors[c], pixels) for c in range(3)], axis=1) * factor
    return total, error


def _edge_error(
    rays: _Rays, ray: NDArray[np.int64], ends: tuple[Array, Array], sigma_t: float, medium: TruthMedium
) -> Array:
    """Return what the float32 rounding of the ends of each interval is worth: integrand times rounding."""
    total = np.zeros(len(ray))
    for x in ends:
        s = np.where(np.isfinite(x), x, 0) - rays.foot[ray]
        r = np.hypot(rays.height[ray], s)
        with np.errstate(divide="ignore", invalid="ignore"):
            strip = np.exp(-sigma_t * (rays.foot[ray] + s + r)) * medium.phase(-s / r) / r
        total += _EDGE * np.where(np.isfinite(x) & (r > 0), strip, 0)
    return total


def _cut_at_beam(light: TruthLight, rays: _Rays, lit: LitIntervals) -> tuple[NDArray[np.int64], Array, Array]:
    """Cut the intervals at the cone of full intensity, where the profile of a soft spot has its kinks."""
    if light.axis is None or light.beam >= light.cutoff:
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
