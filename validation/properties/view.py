# SPDX-License-Identifier: BSD-3-Clause
"""What the camera sees of a scene: depths along a grid of rays, and which points on them the lights reach."""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.scene.camera import Camera, read_camera, resized_camera
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
    radius: float = 0.0  #: of the ball around a light with extent [m]
    axis: Array | None = None  #: of a spot, or the normal of a flat light with extent
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
    """A grid of camera rays."""

    origin: Array  #: (3,) [m]
    directions: Array  #: unit vectors, (rows, columns, 3)
    depth: Array  #: distance of the surface, infinite where there is none, (rows, columns) [m]
    reach: float  #: how far rays without a surface are followed [m]

    @property
    def ends(self) -> Array:
        """Where rays end, (rows, columns) [m]."""
        return np.minimum(self.depth, self.reach)

    @property
    def points(self) -> Array:
        """Points in the middle of equal steps, (rows, columns, STEPS, 3) [m]."""
        share = (np.arange(STEPS) + 0.5) / STEPS
        return self.origin + (self.ends[..., None] * share)[..., None] * self.directions[:, :, None]


def light_places(scene: Scene) -> list[LightPlace]:
    """Return the lights of a scene, those with extent last."""
    places = []
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
        flat = None if wide.kind == "sphere" else wide.normal
        radius = float(np.linalg.norm(wide.across + wide.up)) if wide.kind == "rectangle" else wide.radius
        places.append(LightPlace("area", wide.middle, radius, flat))
    return places


def _host(vector: Any) -> Array:
    return np.array(vector, dtype=np.float64).ravel()


def grid_camera(scene: Scene, grid: tuple[int, int] = GRID) -> Camera:
    """Return the camera of a scene with a pixel for each ray of a grid, or its own where these are fewer."""
    return resized_camera(scene.camera, min(grid[0], scene.camera.width), min(grid[1], scene.camera.height))


def see(scene: Scene, lights: list[LightPlace]) -> SeenView:
    """Cast a grid of camera rays; those that meet nothing are followed as far as all lights and bounds lie."""
    camera = read_camera(grid_camera(scene))
    across = (0.5 * (camera.width - 1) - np.arange(camera.width))[None, :, None] * camera.left
    upwards = (0.5 * (camera.height - 1) - np.arange(camera.height))[:, None, None] * camera.up
    directions = camera.forward + across + upwards
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = distance(scene.geometry, np.broadcast_to(camera.origin, directions.shape), directions)
    far = [float(np.linalg.norm(light.place - camera.origin)) for light in lights if light.kind != "directional"]
    for bounded in scene.medium.bounded_media:
        far.append(float(np.linalg.norm(_host(bounded.centre) - camera.origin)) + float(bounded.radius[0]))
    far += [float(value) for value in depth[np.isfinite(depth)]]
    return SeenView(camera.origin, directions, depth, 1.5 * max(far, default=1.0))


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
