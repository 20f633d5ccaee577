# SPDX-License-Identifier: BSD-3-Clause
"""Optical depths of a scene, by balls in place of bounds, and what its phase functions are like."""

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.scene.medium import BoundedMedium, Medium
from realtime.scene.phase import Phase
from realtime.scene.read_scene import Scene

Array = NDArray[np.float64]

_COSINES = 4096


def mean_extinction(medium: Medium) -> float:
    """Return the mean extinction of the channels [1/m]."""
    return float(np.mean([float(sigma_t[0]) for sigma_t in medium.sigma_t]))


def optical_depth(scene: Scene, start: Array, end: Array) -> Array:
    """Return the optical depth of segments, the mean of the channels; start and end (..., 3) [m]."""
    way = end - start
    length = np.linalg.norm(way, axis=-1)
    outside, depth = length.copy(), np.zeros(length.shape)
    for bounded in scene.medium.bounded_media:
        chord = _chord(bounded, start, way, length)
        outside = outside - chord
        depth += chord * mean_extinction(bounded.medium)
    return depth + np.maximum(outside, 0) * mean_extinction(scene.medium)


def _chord(bounded: BoundedMedium, start: Array, way: Array, length: Array) -> Array:
    centre, radius = np.array(bounded.centre, dtype=np.float64).ravel(), float(bounded.radius[0])
    square = np.maximum(length**2, 1e-30)
    from_centre = start - centre
    middle = -np.sum(from_centre * way, axis=-1) / square
    closest = np.sum((from_centre + middle[..., None] * way) ** 2, axis=-1)
    reach = np.sqrt(np.maximum(radius**2 - closest, 0) / square)
    return length * np.maximum(np.minimum(middle + reach, 1) - np.maximum(middle - reach, 0), 0)


def phase_properties(scene: Scene) -> dict[str, float]:
    """Return `mean_cosine` and `forward`, the largest value, of the phase function that is farthest from isotropic."""
    media = [bounded.medium for bounded in scene.medium.bounded_media]
    phases = [medium.phase for medium in ([] if scene.medium.clear else [scene.medium]) + media]
    found = [_phase(phase) for phase in phases] or [(0.0, 1.0)]
    mean_cosine, forward = max(found, key=lambda each: each[1])
    return {"mean_cosine": mean_cosine, "forward": forward}


def _phase(phase: Phase) -> tuple[float, float]:
    """Return the mean cosine and the largest value of a phase function."""
    if phase.constant:
        return 0.0, 1.0
    # Denser forward, where lobes are: cos = 1 - 2 s^3.
    s = (np.arange(_COSINES) + 0.5) / _COSINES
    cosine, weight = 1 - 2 * s**3, 6 * s**2 / _COSINES
    values = np.array(phase.evaluate(mi.Float(cosine)), dtype=np.float64)
    dr.sync_thread()
    total = float(np.sum(weight * values))
    return float(np.sum(weight * values * cosine)) / total, float(values.max())
