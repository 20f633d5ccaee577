# SPDX-License-Identifier: BSD-3-Clause
"""Properties of a scene: numbers that say what it holds. Sweeps keep them beside errors and times.

Distances are shares of others, so that none depends on the unit of length. A share of light is that of 6144 points on a
grid of camera rays.
"""

from collections.abc import Callable, Mapping

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.errors import InputError
from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.scene.mesh_adjacency import read_occluders
from realtime.scene.phase import Phase
from realtime.scene.read_scene import Scene
from validation.properties.view import SeenView, optical_depth, see

_COSINES = 4096

#: Each with its words, and how it follows from what the camera sees.
PROPERTIES: Mapping[str, tuple[str, Callable[[SeenView], float]]] = {
    "lights": ("number of lights", lambda view: len(view.lights)),
    "points": ("number of point lights", lambda view: _count(view, "point")),
    "spots": ("number of spot lights", lambda view: _count(view, "spot")),
    "directionals": ("number of directional lights", lambda view: _count(view, "directional")),
    "areas": ("number of area lights", lambda view: _count(view, "area")),
    "light_size": ("size of the largest area light from the middle of the view", lambda view: _light_size(view)),
    "light_nearest": ("distance of the nearest light", lambda view: _light_nearest(view)),
    "bounded": ("number of bounded media", lambda view: len(view.scene.medium.bounded_media)),
    "optical_depth": ("optical depth", lambda view: float(optical_depth(view.scene, view.origin, view.ends).mean())),
    "optical_depth_light": ("optical depth from the light", lambda view: _light_depth(view)),
    "mean_cosine": ("mean cosine of scattering", lambda view: _mean_cosine(view.scene)),
    "surface_share": ("fraction of pixels with surfaces", lambda view: float(np.isfinite(view.depth).mean())),
    "lit_share": ("fraction of lit points", lambda view: float(view.lit.mean())),
    "shadow_edges": ("shadow edges along a ray", lambda view: float(np.diff(view.lit).sum(axis=(0, 3)).mean())),
    "triangles": ("number of triangles", lambda view: sum(each.face_count() for each in _meshes(view.scene))),
    "silhouettes": ("silhouette edges", lambda view: _silhouettes(view)),
    "pixels": ("pixels", lambda view: view.scene.camera.width * view.scene.camera.height),
}


def scene_properties(scene: Scene) -> dict[str, float]:
    """Return the properties of a scene by name, as `realtime.scene.read_scene.read_scene` returned it."""
    view = see(scene)
    return {name: float(value(view)) for name, (_, value) in sorted(PROPERTIES.items())}


def _count(view: SeenView, kind: str) -> int:
    return sum(light.kind == kind for light in view.lights)


def _light_size(view: SeenView) -> float:
    """Return the largest half angle at which an area light is seen from the middle of the view [rad]."""
    areas = [light for light in view.lights if light.kind == "area"]
    return max(
        (float(np.arctan2(each.radius, np.linalg.norm(each.place - view.middle))) for each in areas), default=0.0
    )


def _light_nearest(view: SeenView) -> float:
    """Return the least distance of a light from the camera over the median depth, 100 where all are at infinity."""
    near = [light.place for light in view.lights if light.kind != "directional"]
    return min((float(np.linalg.norm(place - view.origin)) / view.median for place in near), default=100.0)


def _light_depth(view: SeenView) -> float:
    """Return the least optical depth from the middle of the view to a light."""
    directional = [light.kind == "directional" for light in view.lights]
    places = [
        view.middle + light.place * view.reach if far else light.place
        for light, far in zip(view.lights, directional, strict=True)
    ]
    return min(float(optical_depth(view.scene, view.middle, place)) for place in places)


def _mean_cosine(scene: Scene) -> float:
    """Return the mean cosine of the phase function that is farthest from isotropic."""
    media = [bounded.medium for bounded in scene.medium.bounded_media]
    phases = [medium.phase for medium in ([] if scene.medium.clear else [scene.medium]) + media]
    return max((_cosine_of(phase) for phase in phases), key=abs, default=0.0)


def _cosine_of(phase: Phase) -> float:
    if phase.constant:
        return 0.0
    # Denser forward, where lobes are: cos = 1 - 2 s^3.
    s = (np.arange(_COSINES) + 0.5) / _COSINES
    cosine, weight = 1 - 2 * s**3, 6 * s**2 / _COSINES
    values = np.array(phase.evaluate(mi.Float(cosine)), dtype=np.float64)
    dr.sync_thread()
    return float(np.sum(weight * values * cosine) / np.sum(weight * values))


def _meshes(scene: Scene) -> list:
    lamps = {light.name for light in scene.area_lights}
    return [shape for shape in scene.geometry.shapes() if shape.is_mesh() and shape.id() not in lamps]


def _silhouettes(view: SeenView) -> float:
    """Return the silhouette edges of all lights together, 0 where shapes have none."""
    try:
        occluders = read_occluders(view.scene.geometry, view.scene.area_lights)
    except InputError:
        return 0.0
    weights = [0.0 if light.kind == "directional" else 1.0 for light in view.lights]
    ends = [np.append(light.place, weight) for light, weight in zip(view.lights, weights, strict=True)]
    return float(sum(len(silhouette(occluders, end).edges) for end in ends))
