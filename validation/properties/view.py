# SPDX-License-Identifier: BSD-3-Clause
"""The lengths of rays, the points that lights reach, and optical depths, for properties and
random scenes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.realtime.scene.read_scene import Scene
from airlight.validation.arrays import Array, Bools


@dataclass(frozen=True)
class LightPlace:
    """Where a light is, on the host."""

    kind: str  #: 'point', 'spot', 'directional' or 'area'
    place: Array  #: (3,) [m]; of a directional light where it comes from, a unit vector
    radius: float = 0.0  #: of the ball around an area light [m]
    axis: Array | None = None  #: of a spot, or the normal of a flat area light
    cos_cutoff: float = 0.0  #: of a spot's cone; 0 for a flat light, which shines on one side

    def toward(self, points: Array) -> tuple[Array, Array]:
        """Return unit vectors from points to the light, (..., 3), and how far it is, (...,) [m]."""
        if self.kind == "directional":
            return np.broadcast_to(self.place, points.shape), np.full(points.shape[:-1], np.inf)
        way = self.place - points
        distance = np.linalg.norm(way, axis=-1)
        return way / np.maximum(distance, 1e-30)[..., None], distance


def light_places(scene: Scene) -> tuple[LightPlace, ...]:
    """Return the lights of a scene, area lights last."""
    places: list[LightPlace] = []
    for light in scene.lights:
        # A directional light has an extent: it is known by the direction that its light comes from.
        if light.extent is not None:
            places.append(LightPlace("directional", -_host(light.axis)))
        elif light.cone is not None:
            places.append(
                LightPlace(
                    "spot",
                    _host(light.position),
                    axis=_host(light.axis),
                    cos_cutoff=float(light.cone.cos[0]),
                )
            )
        else:
            places.append(LightPlace("point", _host(light.position)))
    for wide in scene.area_lights:
        # Flat lights shine on the side of their normal; spheres and meshes in all directions.
        flat = wide.normal if wide.kind in ("rectangle", "disk") else None
        radius = (
            float(np.linalg.norm(wide.across + wide.up))
            if wide.kind == "rectangle"
            else wide.radius
        )
        places.append(LightPlace("area", wide.middle, radius, flat))
    return tuple(places)


def _host(vector: mi.Vector3f) -> Array:
    return np.array(vector, dtype=np.float64).ravel()


def _rays(origin: Array, direction: Array, longest: Array | None = None) -> mi.Ray3f:
    """Return rays from points along unit vectors, (..., 3) each; `longest`: (...,) [m]."""
    o, d = (mi.Point3f(*origin.reshape(-1, 3).T), mi.Vector3f(*direction.reshape(-1, 3).T))
    limit = mi.Float(dr.largest(mi.Float)) if longest is None else mi.Float(longest.ravel())
    return mi.Ray3f(o, d, limit, mi.Float(0), mi.Color0f())


def distance(geometry: mi.Scene, origin: Array, direction: Array) -> Array:
    """Return the distance of the nearest surface along rays, (...,) [m]; infinity for none.

    `origin`, `direction`: of the rays, (..., 3) each.
    """
    # Without shapes there is no surface to meet.
    if not geometry.shapes():
        return np.full(direction.shape[:-1], np.inf)
    hit = geometry.ray_intersect_preliminary(_rays(origin, direction), coherent=True)
    lengths = np.array(dr.select(hit.is_valid(), hit.t, dr.inf), dtype=np.float64)
    return lengths.reshape(direction.shape[:-1])


def lit_points(geometry: mi.Scene, light: LightPlace, points: Array) -> Bools:
    """Return which points, (..., 3) [m], a light reaches, (...,); of an area light its middle."""
    unit, distance = light.toward(points)
    lit = np.ones(points.shape[:-1], dtype=bool)
    # Within a spot's cone, or before a flat light, where the cosine is above 0.
    if light.axis is not None:
        lit &= -(unit @ light.axis) > light.cos_cutoff
    if geometry.shapes():
        margin = 1e-3  # fraction of its way that a shadow ray leaves out at either end
        # A shadow ray ends before the ball around an area light, whose own shape would block it.
        longest = np.where(
            np.isfinite(distance), distance * (1 - margin) - light.radius, np.finfo(np.float32).max
        )
        start = points + unit * np.where(np.isfinite(distance), distance * margin, 0.0)[..., None]
        blocked = geometry.ray_test(_rays(start, unit, np.maximum(longest, 0)))
        lit &= ~np.array(blocked, dtype=bool).reshape(lit.shape)
    return lit


def optical_depths(
    balls: Sequence[tuple[Array, float, Array]], around: Array | float, start: Array, end: Array
) -> Array:
    """Return the optical depths of segments by channel, (..., 3); start and end (..., 3) [m].

    `balls`: centre, radius [m] and extinction, RGB [1/m], of media with bounds; `around`: the
    extinction between them.
    """
    way = end - start
    outside = length = np.linalg.norm(way, axis=-1)
    depth = np.zeros((*length.shape, 3))
    for centre, radius, sigma_t in balls:
        inside = _chord(centre, radius, start, way, length)
        # The balls are disjoint: the rest of the segment lies in the medium between them. By
        # rounding the rest may be a little below 0.
        outside = outside - inside
        depth += inside[..., None] * sigma_t
    return np.asarray(depth + np.maximum(outside, 0)[..., None] * around)


def _chord(centre: Array, radius: float, start: Array, way: Array, length: Array) -> Array:
    """Return how much of segments lies in a ball, (...,) [m]: from `start` along
    `way`, (..., 3), of a length.
    """
    # As fractions of the segment: `middle` is the foot of the perpendicular from the centre,
    # `reach` half of the chord. The chord is cut at both ends of the segment.
    square = np.maximum(length**2, 1e-30)
    from_centre = start - centre
    middle = -np.sum(from_centre * way, axis=-1) / square
    closest = np.sum((from_centre + middle[..., None] * way) ** 2, axis=-1)
    reach = np.sqrt(np.maximum(radius**2 - closest, 0) / square)
    return length * np.maximum(np.minimum(middle + reach, 1) - np.maximum(middle - reach, 0), 0)
