# SPDX-License-Identifier: BSD-3-Clause
"""How bright a light makes the media in the middle of the image, without shadows and cones, roughly.

A light is as bright as drawn whatever the optical depth and its distance: its intensity follows from what a unit of it
does. Shadows and bounds are approximations here; nothing but the exposure of the image depends on them.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from analytic.phase import phase_from_words
from validation.random_scenes.media import PlacedMedium, optical_depths

Array = NDArray[np.float64]

_STEPS = 96
_NEAR = 0.07  # light spreads from a ball of this radius at least, in radii of the stage


@dataclass(frozen=True)
class Ways:
    """Points along some rays of the camera, in radii of the stage, and what light scattered there comes through."""

    points: Array  #: (rays, steps, 3)
    directions: Array  #: (rays, 3)
    weights: Array  #: length of the steps times the transmittance to the camera, (rays, steps, 3)


def ways(media: list[PlacedMedium], camera: Array, target: Array, reach: float) -> Ways:
    """Return five rays about the middle of the image, each up to `reach` radii of the stage."""
    forward = (target - camera) / np.linalg.norm(target - camera)
    left = np.cross(forward, [0.0, 0.0, 1.0])
    left /= np.linalg.norm(left)
    up = np.cross(left, forward)
    directions = np.stack([forward, *(forward + 0.13 * side for side in (left, -left, up, -up))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    edges = reach * (np.arange(_STEPS + 1) / _STEPS) ** 2
    middle, lengths = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    points = camera + middle[:, None] * directions[:, None]
    depth = optical_depths(media, np.broadcast_to(camera, points.shape), points)
    return Ways(points, directions, lengths[:, None] * np.exp(-depth))


def unit_airlight(media: list[PlacedMedium], seen: Ways, light: Array, *, directional: bool) -> float:
    """Return the largest airlight of a light of unit intensity, or of unit irradiance, over rays and channels.

    Parameters
    ----------
    light
        Where it is, or with `directional` a point very far away from which it comes, (3,).
    directional
        Whether its light does not spread.
    """
    toward = light - seen.points
    distance = np.linalg.norm(toward, axis=-1)
    depth = optical_depths(media, seen.points, np.broadcast_to(light, seen.points.shape))
    spread = np.ones_like(distance) if directional else 1 / np.maximum(distance, _NEAR) ** 2
    cosine = -np.sum(toward * seen.directions[:, None], axis=-1) / np.maximum(distance, 1e-12)
    total = np.zeros(seen.points.shape)
    taken = np.zeros(distance.shape, dtype=bool)
    for medium in sorted(media, key=lambda each: each.bounds == "endless"):
        inside = (
            np.linalg.norm(seen.points - medium.centre, axis=-1) < medium.ball if medium.bounds != "endless" else ~taken
        )
        inside &= ~taken
        taken |= inside
        phase = phase_from_words(medium.phase)(np.clip(cosine, -1, 1)) / (4 * np.pi)
        total += (inside * phase * spread)[..., None] * (medium.sigma_t * medium.albedo)
    return float((total * np.exp(-depth) * seen.weights).sum(axis=1).max())
