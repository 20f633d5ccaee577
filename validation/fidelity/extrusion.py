# SPDX-License-Identifier: BSD-3-Clause
"""Sections 5.1.1 and 5.1.2 of Biri 2006: silhouettes, the direction of their extrusion, and the light on surfaces."""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.methods.shadow_planes.silhouettes import silhouette
from realtime.scene.mesh_adjacency import Casters, read_casters
from reference.scene.read import TruthScene, read_truth
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene

Array = NDArray[np.float64]

_SIZE = (160, 120)
_ASIDE = 1e-3  # how far beside a point of a shadow's edge shadow rays end [m]
_FLOOR = -0.03  # height of the floor of `sphere-spot` [m]
_REFLECTANCE = (0.43, 0.41, 0.37)
_INTENSITY = (67.0, 71.0, 83.0)  # of its spot [W/sr]


def extrusion() -> dict[str, Any]:
    """Return what holds of silhouettes and surfaces.

    Returns
    -------
    dict
        `silhouette_edges` of the sphere in `sphere-spot`; `printed`, `derived`: share of points on extruded edges
        beside which one side is dark and the other lit, for both directions; `even_vertices`: share of the vertices of
        silhouettes of closed meshes in `clutter` at which an even number of edges meet; `surface`: largest relative
        difference of the printed light on the floor, with k_t for k_r, to the truth.
    """
    loaded = load_scene("sphere-spot", _SIZE).scene
    casters, truth = read_casters(loaded), read_truth(loaded)
    edges = _closed_silhouette(casters, truth.lights[0].position)
    ends = casters.vertices[edges].mean(axis=1)
    away = ends - truth.lights[0].position
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    return {
        "silhouette_edges": len(edges),
        "derived": _bounding(truth, ends, away),
        "printed": _bounding(truth, ends, -away),
        "even_vertices": _even_vertices(),
        "surface": _surface(loaded, truth),
    }


def _closed_silhouette(casters: Casters, light: Array) -> NDArray[np.int64]:
    edges = silhouette(casters, light).edges.astype(np.int64)
    of_closed = np.zeros(len(casters.vertices), dtype=bool)
    of_closed[casters.triangles[casters.closed[casters.component]]] = True
    return edges[of_closed[edges].all(axis=1)]


def _bounding(truth: TruthScene, ends: Array, way: Array) -> float:
    """Return the share of points along `way` that have shadow on the caster's side and light on the other."""
    middle = ends.mean(axis=0)
    bounding = []
    for reach in (0.2, 0.5, 0.8):
        points = ends + reach * way
        inward = middle - ends
        inward -= np.sum(inward * way, axis=1, keepdims=True) * way
        inward /= np.linalg.norm(inward, axis=1, keepdims=True)
        dark, lit = (~_lit(truth, points + side * _ASIDE * inward) for side in (1, -1))
        bounding.append(dark & ~lit)
    return float(np.mean(bounding))


def _lit(truth: TruthScene, points: Array) -> NDArray[np.bool_]:
    """Return which points the light reaches."""
    ray = mi.Point3f(*(mi.Float(column) for column in points.T))
    light = mi.Point3f(*truth.lights[0].position.tolist())
    way = ray - light
    return ~np.array(truth.occluders.ray_test(mi.Ray3f(light, way, 1.0, 0.0, [])))


def _even_vertices() -> float:
    loaded = load_scene("clutter", _SIZE).scene
    edges = _closed_silhouette(read_casters(loaded), read_truth(loaded).lights[0].position)
    count = np.bincount(edges.ravel())
    return float(np.mean(count[count > 0] % 2 == 0))


def _surface(loaded: Any, truth: TruthScene) -> float:
    """Compare rho I cos / (pi r^2) exp(-k_t r) with the truth before the camera's leg, on the lit floor."""
    image = truth_image(loaded)
    distance = image.distance.ravel()
    points = truth.origin + np.where(np.isfinite(distance), distance, 0)[:, None] * truth.direction
    surface = image.surface.reshape(-1, 3)
    floor = (np.abs(points[:, 2] - _FLOOR) < 1e-4) & (surface[:, 0] > 0)
    to_light = truth.lights[0].position - points[floor]
    r = np.linalg.norm(to_light, axis=1)
    sigma = float(truth.medium.sigma_t[0])
    printed = (to_light[:, 2] / r / (np.pi * r**2) * np.exp(-sigma * r))[:, None] * np.multiply(
        _REFLECTANCE, _INTENSITY
    )
    true = surface[floor] * np.exp(sigma * distance[floor])[:, None]
    return float(np.max(np.abs(printed / true - 1)))
