# SPDX-License-Identifier: BSD-3-Clause
"""What the camera sees of a scene: depths along a grid of rays, and which points on them the lights reach."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.scene.camera import read_camera, resized_camera
from realtime.scene.read_scene import Scene

Array = NDArray[np.float64]

GRID = (32, 24)  #: rays across and down the image
STEPS = 8  #: points on each ray
_BEFORE = 1e-3  # of its way a shadow ray leaves out at either end


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


@dataclass(frozen=True)
class SeenView:
    """A grid of camera rays in a scene."""

    scene: Scene
    lights: tuple[LightPlace, ...]
    origin: Array  #: (3,) [m]
    directions: Array  #: unit vectors, (rows, columns, 3)
    depth: Array  #: distance of the surface, infinite where there is none, (rows, columns) [m]
    reach: float  #: how far rays without a surface are followed [m]

    @property
    def lengths(self) -> Array:
        """Lengths of the rays, (rows, columns) [m]."""
        return np.minimum(self.depth, self.reach)

    @property
    def ends(self) -> Array:
        """Where rays end, (rows, columns, 3) [m]."""
        return self.origin + self.lengths[..., None] * self.directions

    @property
    def points(self) -> Array:
        """Points in the middle of equal steps, (rows, columns, STEPS, 3) [m]."""
        share = (np.arange(STEPS) + 0.5) / STEPS
        return self.origin + (self.lengths[..., None] * share)[..., None] * self.directions[:, :, None]

    @cached_property
    def lit(self) -> NDArray[np.bool_]:
        """Which of the points each light reaches, (lights, rows, columns, STEPS)."""
        return np.array([lit_points(self.scene.geometry, light, self.points) for light in self.lights])

    @property
    def median(self) -> float:
        """The median length of the rays [m]."""
        return float(np.median(self.lengths))

    @property
    def middle(self) -> Array:
        """A point half of the median length ahead, (3,) [m]."""
        rows, columns = self.depth.shape
        return np.asarray(self.origin + 0.5 * self.median * self.directions[rows // 2, columns // 2])


def light_places(scene: Scene) -> tuple[LightPlace, ...]:
    """Return the lights of a scene, area lights last."""
    places: list[LightPlace] = []
    for light in scene.lights:
        if light.extent is not None:
            places.append(LightPlace("directional", -_host(light.axis)))
        elif light.cone is not None:
            places.append(
                LightPlace("spot", _host(light.position), axis=_host(light.axis), cos_cutoff=float(light.cone.cos[0]))
            )
        else:
            places.append(LightPlace("point", _host(light.position)))
    for wide in scene.area_lights:
        flat = wide.normal if wide.kind in ("rectangle", "disk") else None
        radius = float(np.linalg.norm(wide.across + wide.up)) if wide.kind == "rectangle" else wide.radius
        places.append(LightPlace("area", wide.middle, radius, flat))
    return tuple(places)


def _host(vector: Any) -> Array:
    return np.array(vector, dtype=np.float64).ravel()


def see(scene: Scene) -> SeenView:
    """Cast a grid of camera rays; those that meet nothing are followed as far as all lights and bounds lie."""
    grid = min(GRID[0], scene.camera.width), min(GRID[1], scene.camera.height)
    camera = read_camera(resized_camera(scene.camera, *grid))
    across = (0.5 * (camera.width - 1) - np.arange(camera.width))[None, :, None] * camera.left
    upwards = (0.5 * (camera.height - 1) - np.arange(camera.height))[:, None, None] * camera.up
    directions = camera.forward + across + upwards
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = distance(scene.geometry, np.broadcast_to(camera.origin, directions.shape), directions)
    lights = light_places(scene)
    far = [float(np.linalg.norm(light.place - camera.origin)) for light in lights if light.kind != "directional"]
    for bounded in scene.medium.bounded_media:
        far.append(float(np.linalg.norm(_host(bounded.centre) - camera.origin)) + float(bounded.radius[0]))
    far += [float(value) for value in depth[np.isfinite(depth)]]
    return SeenView(scene, lights, camera.origin, directions, depth, 1.5 * max(far, default=1.0))


def _rays(origin: Array, direction: Array, longest: Array | None = None) -> Any:
    o, d = (mi.Point3f(*origin.reshape(-1, 3).T), mi.Vector3f(*direction.reshape(-1, 3).T))
    limit = mi.Float(dr.largest(mi.Float)) if longest is None else mi.Float(longest.ravel())
    return mi.Ray3f(o, d, limit, mi.Float(0), mi.Color0f())


def distance(geometry: Any, origin: Array, direction: Array) -> Array:
    """Return the distance of the nearest surface, infinity where there is none [m]."""
    if not geometry.shapes():
        return np.full(direction.shape[:-1], np.inf)
    hit = geometry.ray_intersect_preliminary(_rays(origin, direction), coherent=True)
    found = np.array(dr.select(hit.is_valid(), hit.t, dr.inf), dtype=np.float64)
    return found.reshape(direction.shape[:-1])


def lit_points(geometry: Any, light: LightPlace, points: Array) -> NDArray[np.bool_]:
    """Return which points a light reaches, the middle of one with extent; points (..., 3) [m]."""
    unit, distance = light.toward(points)
    lit = np.ones(points.shape[:-1], dtype=bool)
    if light.axis is not None:
        lit &= -(unit @ light.axis) > light.cos_cutoff
    if geometry.shapes():
        longest = np.where(np.isfinite(distance), distance * (1 - _BEFORE) - light.radius, np.finfo(np.float32).max)
        start = points + unit * np.where(np.isfinite(distance), distance * _BEFORE, 0.0)[..., None]
        blocked = geometry.ray_test(_rays(start, unit, np.maximum(longest, 0)))
        lit &= ~np.array(blocked, dtype=bool).reshape(lit.shape)
    return lit


def _mean_extinction(medium: Any) -> float:
    """Return the mean extinction of the channels [1/m]."""
    return float(np.mean([float(sigma_t[0]) for sigma_t in medium.sigma_t]))


def optical_depth(scene: Scene, start: Array, end: Array) -> Array:
    """Return the optical depth of segments, the mean of the channels; start and end (..., 3) [m]."""
    way = end - start
    length = np.linalg.norm(way, axis=-1)
    outside, depth = length.copy(), np.zeros(length.shape)
    for bounded in scene.medium.bounded_media:
        inside = chord(_host(bounded.centre), float(bounded.radius[0]), start, way, length)
        outside = outside - inside
        depth += inside * _mean_extinction(bounded.medium)
    return depth + np.maximum(outside, 0) * _mean_extinction(scene.medium)


def chord(centre: Array, radius: float, start: Array, way: Array, length: Array) -> Array:
    """Return how much of segments lies in a ball, (...,) [m]: from `start` along `way`, (..., 3), of a length."""
    square = np.maximum(length**2, 1e-30)
    from_centre = start - centre
    middle = -np.sum(from_centre * way, axis=-1) / square
    closest = np.sum((from_centre + middle[..., None] * way) ** 2, axis=-1)
    reach = np.sqrt(np.maximum(radius**2 - closest, 0) / square)
    return length * np.maximum(np.minimum(middle + reach, 1) - np.maximum(middle - reach, 0), 0)
