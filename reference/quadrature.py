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
from reference.cone import cone_interval, perpendicular
from reference.interval_sums import Rays, sum_intervals
from reference.scene import TruthLight, TruthScene
from reference.surface import lit_surface, surface_hits
from reference.visibility import lit_intervals

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]


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
    rays = Rays(direction, normal, foot, height)
    radiance, bound = sum_intervals(truth.medium, light, rays, lit, shadow_scale)
    in_front = (foot > 0) & (foot < distance)
    angle = np.where(in_front, np.arctan2(height, foot), np.pi)
    return _LightAirlight(radiance, bound, angle, lit.transitions, lit.missed)
