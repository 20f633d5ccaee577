# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene: numbers that say what it holds, and cost little. Sweeps keep them
beside errors and times.

None depends on the unit of length. A fraction of light is that of 6144 points
on a grid of camera rays.
"""

from collections.abc import Mapping

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.scene.camera import read_camera, resized_camera
from airlight.realtime.scene.media.facet_paths import BoundedMedium
from airlight.realtime.scene.media.medium import Homogeneous
from airlight.realtime.scene.phase import Phase
from airlight.realtime.scene.read_scene import Scene
from airlight.validation.arrays import Array
from airlight.validation.properties.view import distance, light_places, lit_points, optical_depths

#: Names of the properties for readers.
PROPERTIES: Mapping[str, str] = {
    "lights": "number of lights",
    "points": "number of point lights",
    "spots": "number of spot lights",
    "directionals": "number of directional lights",
    "areas": "number of area lights",
    "bounded": "number of bounded media",
    "optical_depth": "optical depth",
    "mean_cosine": "mean cosine of scattering",
    "surface_fraction": "fraction of pixels with surfaces",
    "lit_fraction": "fraction of lit points",
    "triangles": "number of triangles",
    "pixels": "pixels",
}


def scene_properties(scene: Scene) -> dict[str, float]:
    """Return the properties of a scene by name.

    Raises InputError for fog that differs from place to place: it has no extinction.
    """
    medium = scene.medium
    if not isinstance(medium, Homogeneous):
        raise InputError(
            "properties: the fog of this scene differs from place to place; expected a scene of "
            "homogeneous media"
        )
    lights, (origin, ends, depth) = light_places(scene), _view_rays(scene)
    # The middles of equal parts of each ray from the camera to its end.
    steps = 8  # points on each ray
    fraction = (np.arange(steps) + 0.5) / steps
    points = origin + fraction[:, None] * (ends - origin)[..., None, :]
    kinds = [light.kind for light in lights]
    # Shapes of area lights are lights, not occluders, and their triangles do not count.
    lamps = {light.name for light in scene.area_lights}
    balls = [(*_ball(each), _extinction(each.medium)) for each in medium.bounded_media]
    meshes = [
        shape for shape in scene.geometry.shapes() if shape.is_mesh() and shape.id() not in lamps
    ]
    values = {
        "lights": len(lights),
        **{f"{kind}s": kinds.count(kind) for kind in ("point", "spot", "directional", "area")},
        "bounded": len(medium.bounded_media),
        "optical_depth": optical_depths(balls, _extinction(medium), origin, ends).mean(),
        "mean_cosine": _mean_cosine(scene),
        "surface_fraction": np.isfinite(depth).mean(),
        "lit_fraction": np.mean([lit_points(scene.geometry, light, points) for light in lights]),
        "triangles": sum(shape.face_count() for shape in meshes),
        "pixels": scene.camera.width * scene.camera.height,
    }
    return {name: float(values[name]) for name in sorted(PROPERTIES)}


def _view_rays(scene: Scene) -> tuple[Array, Array, Array]:
    """Return the camera's place, (3,), the ends of a grid of its rays, (rows, columns, 3), and the
    distances of surfaces along these, (rows, columns) [m].

    Rays that meet nothing end beyond all lights and bounds.
    """
    # 32 x 24 rays, or one for each pixel of a smaller image
    grid = min(32, scene.camera.width), min(24, scene.camera.height)
    camera = read_camera(resized_camera(scene.camera, *grid))
    # Pixel centres, counted from the middle of the image.
    across = (0.5 * (camera.width - 1) - np.arange(camera.width))[None, :, None] * camera.left
    upwards = (0.5 * (camera.height - 1) - np.arange(camera.height))[:, None, None] * camera.up
    directions = camera.forward + across + upwards
    directions /= np.linalg.norm(directions, axis=-1, keepdims=True)
    depth = distance(scene.geometry, np.broadcast_to(camera.origin, directions.shape), directions)
    # The distances of lights, of the far ends of bounds and of surfaces; a half more is where rays
    # that meet nothing end.
    far = [
        float(np.linalg.norm(light.place - camera.origin))
        for light in light_places(scene)
        if light.kind != "directional"
    ]
    for centre, radius in map(_ball, scene.medium.bounded_media):
        far.append(float(np.linalg.norm(centre - camera.origin)) + radius)
    far += [float(value) for value in depth[np.isfinite(depth)]]
    length = np.minimum(depth, 1.5 * max(far, default=1.0))
    return camera.origin, camera.origin + length[..., None] * directions, depth


def _ball(bounded: BoundedMedium) -> tuple[Array, float]:
    """Return centre, (3,), and radius of the ball around a bounded medium [m]."""
    return np.array(bounded.centre, dtype=np.float64).ravel(), float(bounded.radius[0])


def _extinction(medium: Homogeneous) -> Array:
    """Return the extinction of a medium by channel [1/m]."""
    return np.array([float(sigma_t[0]) for sigma_t in medium.sigma_t])


def _mean_cosine(scene: Scene) -> float:
    """Return the mean cosine of the phase function that is farthest from isotropic."""
    # A scene may have vacuum around bounded media: then only these count.
    media = [bounded.medium for bounded in scene.medium.bounded_media]
    phases = [medium.phase for medium in ([] if scene.medium.clear else [scene.medium]) + media]
    return max((_cosine_of(phase) for phase in phases), key=abs, default=0.0)


def _cosine_of(phase: Phase) -> float:
    if phase.constant:
        return 0.0
    # Denser forward, where lobes are: cos = 1 - 2 s^3.
    count = 4096
    s = (np.arange(count) + 0.5) / count
    cosine, weight = 1 - 2 * s**3, 6 * s**2 / count
    values = np.array(phase.evaluate(mi.Float(cosine)), dtype=np.float64)
    dr.sync_thread()
    return float(np.sum(weight * values * cosine) / np.sum(weight * values))
