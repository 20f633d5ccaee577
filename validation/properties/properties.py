# SPDX-License-Identifier: BSD-3-Clause
"""The properties of a scene by name: finite numbers, none of which depends on a unit of length."""

import numpy as np
from numpy.typing import NDArray

from realtime.scene.read_scene import Scene
from validation.properties.lights import caster_properties
from validation.properties.media import optical_depth, phase_properties
from validation.properties.view import LightPlace, SeenView, light_places, lit_points, see

Array = NDArray[np.float64]


def scene_properties(scene: Scene) -> dict[str, float]:
    """Return what a scene holds.

    Parameters
    ----------
    scene
        As `realtime.scene.read_scene.read_scene` returned it, at the size of its image.

    Returns
    -------
    dict
        By name. Lights: `lights`, `points`, `spots`, `directionals`, `areas`, `soft_spots` (whether there are any),
        `light_size` (the largest half angle at which a light with extent is seen from the middle of the view [rad]),
        `light_nearest` (the distance from the camera of the nearest light that has a place, over the median depth),
        `light_ray` (the least distance of such a light to a ray of the image, over its distance from the camera),
        `lights_seen` (how many are in the image, unless a surface hides them). Media: `extinctions` (1 or 3),
        `endless`, `bounded`, `facets` of bounds, `inside` (whether the camera is in a bounded medium), `optical_depth`
        and `optical_depth_most` of the rays, `optical_depth_light` from the middle of the view to the nearest light,
        `mean_cosine`, `forward`. Surfaces and shadows: those of `caster_properties`, `surface_share` of the pixels,
        `depth_edges` (mean difference of the logarithm of neighbouring depths), `lit_share` of the points on rays,
        `shadow_edges` (mean number of changes between light and shadow along a ray, of all lights together),
        `shadow_edges_across` (mean share of points that another light reaches than the next ray's). Image: `pixels`.
    """
    lights = light_places(scene)
    view = see(scene, lights)
    properties = _light_properties(lights, view)
    properties |= _medium_properties(scene, lights, view)
    properties |= caster_properties(scene, lights)
    properties |= _shadow_properties(scene, lights, view)
    features = scene.features
    properties["soft_spots"] = float(features.soft_spots)
    properties["pixels"] = float(scene.camera.width * scene.camera.height)
    return {name: float(value) for name, value in sorted(properties.items())}


def _light_properties(lights: list[LightPlace], view: SeenView) -> dict[str, float]:
    kinds = [light.kind for light in lights]
    depth = float(np.median(view.ends))
    near = [light for light in lights if light.kind != "directional"]
    middle = view.origin + 0.5 * depth * view.directions[view.depth.shape[0] // 2, view.depth.shape[1] // 2]
    sizes = [np.arctan2(light.radius, np.linalg.norm(light.place - middle)) for light in near if light.kind == "area"]
    distances = [float(np.linalg.norm(light.place - view.origin)) for light in near]
    misses = [_miss(light, view) for light in near]
    pixel = float(np.median(np.linalg.norm(np.diff(view.directions, axis=1), axis=-1)))
    return {
        "lights": float(len(lights)),
        "points": float(kinds.count("point")),
        "spots": float(kinds.count("spot")),
        "directionals": float(kinds.count("directional")),
        "areas": float(kinds.count("area")),
        "light_size": float(max(sizes, default=0.0)),
        # A light from infinity is nearest at infinity: a hundred depths stand for it.
        "light_nearest": min([distance / depth for distance in distances], default=100.0),
        "light_ray": float(min(misses, default=1.0)),
        "lights_seen": float(sum(miss < pixel for miss in misses)),
    }


def _miss(light: LightPlace, view: SeenView) -> float:
    """Return the least distance of a light to the rays, over its distance from the camera."""
    way = light.place - view.origin
    length = float(np.linalg.norm(way))
    along = np.clip(view.directions @ way, 0, view.ends)
    nearest = np.linalg.norm(way - along[..., None] * view.directions, axis=-1)
    return float(np.clip(nearest.min() / max(length, 1e-30), 1e-4, 1.0))


def _medium_properties(scene: Scene, lights: list[LightPlace], view: SeenView) -> dict[str, float]:
    medium = scene.medium
    ends = view.origin + view.ends[..., None] * view.directions
    depths = optical_depth(scene, np.broadcast_to(view.origin, ends.shape), ends)
    middle = view.origin + 0.5 * float(np.median(view.ends)) * view.directions[len(ends) // 2, ends.shape[1] // 2]
    places = [middle + light.place * view.reach if light.kind == "directional" else light.place for light in lights]
    inside = any(
        np.linalg.norm(view.origin - np.array(each.centre, dtype=np.float64).ravel()) < float(each.radius[0])
        for each in medium.bounded_media
    )
    return {
        "extinctions": float(len(medium.sigma_t)),
        "endless": float(not medium.clear),
        "bounded": float(len(medium.bounded_media)),
        "facets": float(sum(each.count for each in medium.bounded_media)),
        "inside": float(inside),
        "optical_depth": float(depths.mean()),
        "optical_depth_most": float(depths.max()),
        "optical_depth_light": float(min(optical_depth(scene, middle, place) for place in places)),
        **phase_properties(scene),
    }


def _shadow_properties(scene: Scene, lights: list[LightPlace], view: SeenView) -> dict[str, float]:
    lit = [lit_points(scene.geometry, light, view.points) for light in lights]
    along = sum(np.diff(each.astype(np.int8), axis=2).astype(bool).sum(axis=2).mean() for each in lit)
    across = sum(np.diff(each.astype(np.int8), axis=1).astype(bool).mean() for each in lit)
    depth = np.log(view.ends)
    return {
        "surface_share": float(np.isfinite(view.depth).mean()),
        "depth_edges": float(np.abs(np.diff(depth, axis=1)).mean()) if depth.shape[1] > 1 else 0.0,
        "lit_share": float(np.mean([each.mean() for each in lit])),
        "shadow_edges": float(along),
        "shadow_edges_across": float(across),
    }
