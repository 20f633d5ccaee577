# SPDX-License-Identifier: BSD-3-Clause
"""The sides of surfaces: which meshes are closed, and whether the backs of open ones are lit.

pbrt and Mitsuba differ on backs alone. A surface reflects light to the eye where both are on one
side of it; the back counts where both are behind.
"""

from __future__ import annotations

import numpy as np

from airlight.validation.arrays import Array


def is_closed(corners: Array) -> bool:
    """Return whether triangles, (n, 3, 3) [m], close: each edge is met twice, once each way.

    Vertices with the same coordinates are one.
    """
    points, numbers = np.unique(corners.reshape(-1, 3), axis=0, return_inverse=True)
    faces = numbers.reshape(-1, 3)
    tail, head = faces.ravel().astype(np.int64), np.roll(faces, -1, axis=1).ravel()
    edges = np.sort(tail * len(points) + head)
    return bool(np.all(np.diff(edges) > 0)) and np.array_equal(
        edges, np.sort(head * len(points) + tail)
    )


def volume(corners: Array) -> float:
    """Return the volume that closed triangles hold [m^3], below 0 where they face inwards."""
    local = corners - corners.mean(axis=(0, 1))
    return float(np.einsum("ij,ij->", local[:, 0], np.cross(local[:, 1], local[:, 2])) / 6)


def backs_are_lit(corners: Array, eye: Array, places: Array, towards: Array) -> bool:
    """Return whether a triangle has both the eye and a light behind it, whatever is between them.

    `corners`: counter-clockwise seen from the front, (n, 3, 3) [m]; `eye`: (3,) [m]; `places`: of
    lights, (m, 3) [m]; `towards`: directions to lights at infinity, (k, 3).
    """
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    level = np.einsum("ij,ij->i", normals, corners[:, 0])
    behind = normals @ eye < level
    # Light by light: a scene may have many of both.
    lit = np.zeros(len(corners), dtype=bool)
    for place in places:
        lit |= normals @ place < level
    for direction in towards:
        lit |= normals @ direction < 0
    return bool(np.any(behind & lit))
