# SPDX-License-Identifier: BSD-3-Clause
"""Paths from lights to visible surfaces, by Mitsuba's materials and shadow rays, without what dims them.

L = f(w_i, w_o) cos I profile / r^2         (I / r^2: the irradiance of a directional light)
"""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.quadrature.surface import SurfaceHits
from reference.scene.directional_light import DirectionalLight
from reference.scene.read import TruthLight, TruthScene
from reference.visibility.spot_cone import falloff
from validation.fog_model.lengths import lengths
from validation.fog_model.paths import SurfacePoints

Array = NDArray[np.float64]


def surface_points(
    truth: TruthScene, light: TruthLight | DirectionalLight, hits: SurfaceHits, *, shadows: bool = True
) -> SurfacePoints:
    """Return the visible surface points that a light reaches; its intensity counts as 1.

    Parameters
    ----------
    truth, light
        The scene and one of its lights, or a point of a light with extent.
    shadows
        False where other surfaces hide nothing.
    """
    interaction: Any = hits.interaction
    if not truth.occluders.shapes():
        return _none(len(truth.media) + 1)
    visible = np.isfinite(hits.distance)
    point = truth.origin + np.where(visible, hits.distance, 0.0)[:, None] * truth.direction
    if isinstance(light, DirectionalLight):
        towards, r = np.broadcast_to(-light.direction, point.shape), np.ones(len(point))
        shadow_ray = interaction.spawn_ray(mi.Vector3f(towards.T))
        arriving = np.ones(len(point))
    else:
        way = light.position - point
        r = np.linalg.norm(way, axis=1)
        towards = way / np.maximum(r, np.finfo(float).tiny)[:, None]
        shadow_ray = interaction.spawn_ray_to(mi.Point3f(*(float(c) for c in light.position)))
        arriving = _profile(light, -towards) / np.maximum(r, np.finfo(float).tiny) ** 2
    facing = interaction.is_valid()
    local = interaction.to_local(mi.Vector3f(towards.T))
    reflected = interaction.bsdf().eval(mi.BSDFContext(), interaction, local, facing)
    radiance = np.array(reflected, dtype=np.float64).reshape(3, -1).T * arriving[:, None]
    lit = visible & np.any(radiance > 0, axis=1)
    if shadows:
        lit &= ~np.array(truth.occluders.ray_test(shadow_ray, facing), dtype=bool)
    ray = np.flatnonzero(lit)
    nothing = np.zeros(len(ray))
    if isinstance(light, DirectionalLight):
        leg = lengths(truth, point[ray], -light.direction, nothing, np.full(len(ray), np.inf))
    else:
        leg = lengths(truth, light.position, -towards[ray], nothing, r[ray])
    return SurfacePoints(
        ray,
        radiance[ray],
        r[ray],
        lengths(truth, truth.origin, truth.direction[ray], nothing, hits.distance[ray]),
        leg,
        0 * towards[ray] if isinstance(light, DirectionalLight) else -towards[ray],
    )


def _profile(light: TruthLight, direction: Array) -> Array:
    """Return the profile of a light in directions away from it, (n,): on a ray along each, straight ahead."""
    if light.axis is None:
        return np.ones(len(direction))
    inside = np.arccos(np.clip(direction @ light.axis, -1.0, 1.0)) <= light.cutoff
    straight = np.full((len(direction), 1), 0.5 * np.pi)
    return inside * falloff(straight, direction, np.zeros_like(direction), light)[:, 0]


def _none(media: int) -> SurfacePoints:
    empty = np.empty(0)
    return SurfacePoints(
        np.empty(0, np.int64), np.empty((0, 3)), empty, np.empty((0, media)), np.empty((0, media)), np.empty((0, 3))
    )
