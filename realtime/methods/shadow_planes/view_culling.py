# SPDX-License-Identifier: BSD-3-Clause
"""Which casters can cast a shadow into the view.

The shadow volume of a caster lies in its bounding box extruded away from the light at (l, w): all points
c + s (w c - l), s >= 0, c in the box. That is convex, the hull of the corners c and of the directions w c - l. It
misses the view if it lies wholly outside one of the five planes through the pinhole that bound what the camera sees
(Biri 2006, section 5.2, does the same for bounded media).
"""

import numpy as np
from numpy.typing import NDArray

from realtime.scene.camera import HostCamera
from realtime.scene.lights import place_and_weight
from realtime.scene.mesh_adjacency import Casters

Array = NDArray[np.float64]


def components_in_view(casters: Casters, camera: HostCamera, light: Array) -> NDArray[np.bool_]:
    """Return by component whether its shadow can be seen; `light` is a homogeneous position, (4,), or a place, (3,)."""
    l, w = place_and_weight(light)  # noqa: E741
    origin, normals = view_planes(camera)
    choose = np.array([[i >> k & 1 for k in range(3)] for i in range(8)])
    corners = casters.boxes[:, choose, np.arange(3)]
    near = (corners - origin) @ normals.T
    far = (w * corners - l) @ normals.T
    outside = np.all(near < 0, axis=1) & np.all(far <= 0, axis=1)
    return ~outside.any(axis=1)


def view_planes(camera: HostCamera) -> tuple[Array, Array]:
    """Return the pinhole and the normals, towards the view, of the planes through it that bound the view."""
    half = 0.5 * np.array([camera.width, camera.height])
    signs = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)])
    corner = camera.forward + (signs * half) @ np.stack([camera.left, camera.up])
    normals = np.cross(corner, np.roll(corner, 1, axis=0))
    normals[normals @ camera.forward < 0] *= -1
    return camera.origin, np.vstack([normals, camera.forward])
