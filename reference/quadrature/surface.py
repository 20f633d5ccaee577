# SPDX-License-Identifier: BSD-3-Clause
"""The lit surface of the reference: Mitsuba's own materials and lights, attenuated in float64.

    L = f(w_i, w_o) cos I / r^2 exp(-sigma_t (distance + s r)),

with f cos by `BSDF.eval` and I / r^2 by `Emitter.sample_direction`; s scales the shadow segment
(see `reference.quadrature.ray_values`). Through bounded media the optical depth is the sum over
both ways, piece by piece. A directional light has its irradiance in the place of I / r^2, and an
unbounded shadow segment: only bodies attenuate it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.quadrature.fields import optical_depth
from airlight.reference.scene.area_light import is_area
from airlight.reference.scene.device import as_rows, on_device, vectors
from airlight.reference.scene.directional_light import DirectionalLight, is_directional
from airlight.reference.scene.read import ReferenceLight, ReferenceScene

Array = NDArray[np.float64]
Index = NDArray[np.int64]

#: how far the shadow segment of a directional light goes [m]
UNBOUNDED = float(np.finfo(float).max)


@dataclass(frozen=True)
class SurfaceHits:
    """The hits of the pixel-centre rays."""

    distance: Array  #: (pixels,), infinite where nothing is hit [m]
    interaction: Any  #: Mitsuba's surface interactions


def surface_hits(reference: ReferenceScene) -> SurfaceHits:
    """Cast the pixel-centre rays from the pinhole."""
    ray = mi.Ray3f(
        mi.Point3f(*(float(c) for c in reference.origin)),
        dr.normalize(mi.Vector3f(reference.direction.T)),
    )
    dr.make_opaque(ray)  # one kernel for all cameras
    interaction = reference.occluders.ray_intersect(ray, mi.RayFlags.All, coherent=True)
    dr.eval(interaction)  # whatever is read of it
    valid = np.array(interaction.is_valid(), dtype=bool)
    return SurfaceHits(
        np.where(valid, np.array(interaction.t, dtype=np.float64), np.inf), interaction
    )


@dataclass(frozen=True)
class Reflection:
    """Mitsuba's materials where rays hit surfaces."""

    interaction: Any  #: Mitsuba's surface interactions

    def __call__(self, ray: Index, towards: Array) -> Array:
        """Return f cos_s, (n, 3) [1/sr], where rays of these numbers hit, for light from
        unit directions, (n, 3).
        """
        at = dr.gather(mi.SurfaceInteraction3f, self.interaction, on_device(mi.UInt32, ray))
        local = at.to_local(dr.normalize(vectors(mi.Vector3f, towards)))
        return as_rows(at.bsdf().eval(mi.BSDFContext(), at, local))


def lit_surface(
    reference: ReferenceScene,
    hits: SurfaceHits,
    *,
    reached: Sequence[NDArray[np.bool_]],
    shadow_scale: float = 1.0,
) -> Array:
    """Return the radiance of the surface at each pixel centre that point, spot and
    directional lights give it.

    In W/(m^2 sr), (pixels, 3).

    `reference`, `hits`: the scene and what its rays hit; `reached`: by light, the directional ones
    last, whether it reaches the surface at the end of each ray, as its lit intervals say;
    `shadow_scale`: see `reference.quadrature.ray_values`.
    """
    interaction = hits.interaction
    total = np.zeros((len(hits.distance), 3))
    if not reference.occluders.shapes():
        return total
    far = np.where(np.isfinite(hits.distance), hits.distance, 0.0)
    point = reference.origin + far[:, None] * reference.direction
    to_camera = optical_depth(
        reference, reference.origin, reference.direction, np.zeros(len(far)), far
    )
    # The emitters are sorted like `lights`: places first, then directions.
    emitters = [emitter for emitter in reference.scene.emitters() if not is_area(emitter)]
    emitters = sorted(emitters, key=is_directional)
    facing = interaction.is_valid()
    lights: list[ReferenceLight | DirectionalLight] = [*reference.lights, *reference.directional]
    for emitter, light, reaches in zip(emitters, lights, reached, strict=True):
        # I / r^2 of this emitter, or its irradiance, without visibility: the lit intervals say
        # that.
        towards, arriving = emitter.sample_direction(interaction, mi.Point2f(0.5))
        reflected = interaction.bsdf().eval(
            mi.BSDFContext(), interaction, interaction.to_local(towards.d), facing
        )
        radiance = as_rows(reflected * arriving)
        if isinstance(light, DirectionalLight):
            way, r = np.broadcast_to(-light.direction, point.shape), np.full(len(point), UNBOUNDED)
        else:
            way = light.position - point
            r = np.linalg.norm(way, axis=1)
            way, r = way / np.maximum(r, np.finfo(float).tiny)[:, None], shadow_scale * r
        # A directional light's segment goes to the end of all floats: only bounded media can be on
        # it.
        depth = to_camera + optical_depth(reference, point, way, np.zeros(len(point)), r)
        lit = np.array(facing, dtype=bool) & reaches
        total += np.where(lit[:, None], radiance * np.exp(-depth), 0.0)
    return total
