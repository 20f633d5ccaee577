# SPDX-License-Identifier: BSD-3-Clause
"""Clouds for tests: meshes that are not convex, scenes of them, and lengths within them by
all triangles in float64.
"""

from typing import Any

import mitsuba as mi
import numpy as np

from airlight.validation.scenes.meshes import placed, rotation, torus
from airlight.validation.scenes.parts import camera, medium_boundary

TURN = rotation((1.0, 0.4, 0.2), 63.1)
DROPLETS = {
    "type": "homogeneous",
    "sigma_t": 0.0363,
    "albedo": 1.0,
    "phase": {"type": "hg", "g": 0.85},
}
SUN = {
    "type": "directional",
    "direction": [0.737, -0.271, -0.619],
    "irradiance": {"type": "rgb", "value": [3.1, 2.9, 2.3]},
}


def ring(middle=(3.71, -0.13, 2.03), radii=(101.37, 40.047)):
    """Return a closed ring, the shape of which is not convex."""
    return placed(torus(*radii, (23, 17)), middle, TURN)


def cloud(name: str, mesh, medium: dict[str, Any] | None = None) -> Any:
    """Return a Mitsuba mesh around droplets, or around another medium."""
    return medium_boundary(name, mesh, medium or DROPLETS)


def cloud_of(name: str, mesh, medium: Any) -> Any:
    """Return a Mitsuba mesh around a medium that others share, a Mitsuba object."""
    properties = mi.Properties()
    properties["mesh_bsdf"], properties["interior"] = mi.load_dict({"type": "null"}), medium
    vertices, faces = mesh
    shape = mi.Mesh(name, vertex_count=len(vertices), face_count=len(faces), props=properties)
    parameters = mi.traverse(shape)
    parameters["vertex_positions"] = vertices.astype(np.float32).ravel()
    parameters["faces"] = faces.astype(np.uint32).ravel()
    parameters.update()
    return shape


def cloud_scene(size=(16, 12), *, origin=(30.83, -400.91, 57.03), **parts) -> dict[str, Any]:
    """Return the dictionary of a scene of clouds: by default a ring in the sun."""
    view = camera(origin, (3.17, 0.29, 1.49), fov=47.9, size=size, in_fog=False)
    named = parts or {"sun": SUN, "ring": cloud("ring", ring())}
    return {"type": "scene", "sensor": view} | named


def loaded(**parts):
    """Return a Mitsuba scene of clouds."""
    return mi.load_dict(cloud_scene(**parts))


def crossings(mesh, origin, direction):
    """Return distances where a line crosses a mesh, ascending, and whether it
    leaves there, in float64.
    """
    vertices, faces = mesh
    a, b, c = np.moveaxis(vertices.astype(np.float32).astype(np.float64)[faces], 1, 0)
    first, second = b - a, c - a
    across = np.cross(direction, second)
    inverse = 1 / np.einsum("ij,ij->i", first, across)
    offset = origin - a
    u = np.einsum("ij,ij->i", offset, across) * inverse
    turned = np.cross(offset, first)
    v = turned @ direction * inverse
    distance = np.einsum("ij,ij->i", second, turned) * inverse
    met = (u >= 0) & (v >= 0) & (u + v <= 1) & (distance > 0)
    order = np.argsort(distance[met])
    return distance[met][order], (np.cross(first, second) @ direction > 0)[met][order]


def length_inside(mesh, origin, direction, end=np.inf):
    """Return what of a ray up to `end` lies in a mesh [m]."""
    distance, leaves = crossings(mesh, origin, direction)
    before = np.concatenate([[0.0], distance[:-1]]) if len(distance) else distance
    return float(np.sum((np.minimum(distance, end) - np.minimum(before, end))[leaves]))


def dense(values, low, high, sigma_t=0.0363, **changes) -> dict[str, Any]:
    """Return droplets whose extinction is `sigma_t` times a grid of values (z, y, x)
    between two corners [m].
    """
    low, high = np.asarray(low, dtype=float), np.asarray(high, dtype=float)
    box = mi.ScalarTransform4f().translate(low.tolist()).scale((high - low).tolist())
    values = np.asarray(values, dtype=np.float32)[..., None]
    volume = {"type": "gridvolume", "grid": mi.VolumeGrid(values), "to_world": box}
    return DROPLETS | {"type": "heterogeneous", "sigma_t": volume, "scale": sigma_t} | changes


def linear_between(values, low, high, points):
    """Return what such a grid holds at points (n, 3) [m], linear between the middles
    of its voxels, in float64.
    """
    counts = np.array(values.shape[::-1])
    place = np.clip(
        (points - np.asarray(low)) / (np.asarray(high) - np.asarray(low)) * counts - 0.5,
        0,
        counts - 1,
    )
    cell = np.minimum(place.astype(int), np.maximum(counts - 2, 0))
    fraction, total = place - cell, np.zeros(len(points))
    for corner in np.ndindex(2, 2, 2):
        x, y, z = np.minimum(cell + corner, counts - 1).T
        total += np.where(corner, fraction, 1 - fraction).prod(axis=1) * values[z, y, x]
    return total
