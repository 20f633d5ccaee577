# SPDX-License-Identifier: BSD-3-Clause
"""The lit surface of the truth: Mitsuba's own materials and lights, attenuated in float64.

    L = f(w_i, w_o) cos I / r^2 exp(-sigma_t (distance + s r)),

with f cos by `BSDF.eval` and I / r^2 by `Emitter.sample_direction`; s scales the shadow leg (see
`reference.quadrature.ray_values`). Through bounded media the optical depth is that of both legs piece by piece. A
directional light has its irradiance in the place of I / r^2. Its leg is endless, and only bodies dim it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.quadrature.segments import optical_depth
from reference.scene.area_light import is_area
from reference.scene.directional_light import DirectionalLight, is_directional
from reference.scene.read import TruthScene

Array = NDArray[np.float64]


@dataclass(frozen=True)
class SurfaceHits:
    """What the pixel-centre rays hit."""

    distance: Array  #: (pixels,), infinite where nothing is hit [m]
    interaction: Any  #: Mitsuba's surface interactions


def surface_hits(truth: TruthScene) -> SurfaceHits:
    """Cast the pixel-centre rays from the pinhole."""
    ray = mi.Ray3f(mi.Point3f(*(float(c) for c in truth.origin)), dr.normalize(mi.Vector3f(truth.direction.T)))
    dr.make_opaque(ray)  # one kernel for all cameras
    interaction = truth.occluders.ray_intersect(ray, mi.RayFlags.All, coherent=True)
    dr.eval(interaction)  # whatever is read of it
    valid = np.array(interaction.is_valid(), dtype=bool)
    return SurfaceHits(np.where(valid, np.array(interaction.t, dtype=np.float64), np.inf), interaction)


def lit_surface(
    truth: TruthScene,
    hits: SurfaceHits,
    *,
    reached: Sequence[NDArray[np.bool_] | None],
    shadow_scale: float,
) -> Array:
    """Return the radiance of the lit surface at each pixel centre, (pixels, 3) [W/(m^2 sr)].

    Parameters
    ----------
    truth, hits
        The scene and what its rays hit.
    reached
        By light whether it reaches the surface at the end of each ray, as its lit intervals say. Where that is not
        known, None, in bounded media and under directional lights, a shadow ray is cast in single precision. Mitsuba
        starts it d = 1e-4 (1 + the largest coordinate) off the surface, so that the edges of shadows are off by at most
        d tan(angle between normal and light) there: a point that is nearer to an edge may be lit or dark wrongly.
    shadow_scale
        See `reference.quadrature.ray_values`.
    """
    interaction = hits.interaction
    total = np.zeros((len(hits.distance), 3))
    if not truth.occluders.shapes():
        return total
    if truth.media:
        seen = np.where(np.isfinite(hits.distance), hits.distance, 0.0)
        point = truth.origin + seen[:, None] * truth.direction
        to_camera = optical_depth(truth, truth.origin, truth.direction, np.zeros(len(seen)), seen)
    emitters = truth.scene.emitters()
    near = [emitter for emitter in emitters if not is_directional(emitter) and not is_area(emitter)]
    for emitter, light, reaches in zip(near, truth.lights, reached, strict=True):
        towards, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
        facing = interaction.is_valid()
        if reaches is None:
            reaches = ~np.array(truth.occluders.ray_test(interaction.spawn_ray_to(towards.p), facing), dtype=bool)
        reflected = interaction.bsdf().eval(mi.BSDFContext(), interaction, interaction.to_local(towards.d), facing)
        radiance = np.array(reflected * arriving, dtype=np.float64).T
        lit = np.array(facing, dtype=bool) & reaches
        if truth.media:
            depth = to_camera + _leg_depth(truth, point, light.position, shadow_scale)
        else:
            path = np.where(lit, hits.distance, 0) + shadow_scale * np.array(towards.dist, dtype=np.float64)
            depth = np.where(lit, path, 0)[:, None] * truth.medium.sigma_t
        total += np.where(lit[:, None], radiance * np.exp(-depth), 0.0)
    for far in truth.directional:
        lit, radiance = _lit_from_infinity(truth, interaction, far)
        if truth.media:
            towards = np.broadcast_to(-far.direction, point.shape)
            endless = np.full(len(point), np.finfo(float).max)
            radiance = radiance * np.exp(-to_camera - optical_depth(truth, point, towards, 0 * endless, endless))
        total += np.where(lit[:, None], radiance, 0.0)
    return total


def _lit_from_infinity(truth: TruthScene, interaction: Any, light: DirectionalLight) -> tuple[NDArray[np.bool_], Array]:
    """Return which surfaces a directional light reaches, by shadow rays, and what they reflect in clear air."""
    towards, arriving = light.emitter.sample_direction(interaction, mi.Point2f(0.5))
    facing = interaction.is_valid()
    hidden = truth.occluders.ray_test(interaction.spawn_ray(towards.d), facing)
    reflected = interaction.bsdf().eval(mi.BSDFContext(), interaction, interaction.to_local(towards.d), facing)
    lit = np.array(facing, dtype=bool) & ~np.array(hidden, dtype=bool)
    return lit, np.array(arriving * reflected, dtype=np.float64).T


def _leg_depth(truth: TruthScene, point: Array, light: Array, shadow_scale: float) -> Array:
    """Return the optical depth between points and a light through bounded media, (pixels, 3)."""
    leg = point - light
    length = np.linalg.norm(leg, axis=1)
    leg /= np.maximum(length, np.finfo(float).tiny)[:, None]
    return optical_depth(truth, light, leg, (1 - shadow_scale) * length, length)
