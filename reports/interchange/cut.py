# SPDX-License-Identifier: BSD-3-Clause
"""A mesh in the parts within and beyond the convex bounds of a medium.

A triangle that passes through the bounds is cut at each of their planes: the polygon behind all
planes is within, the pieces in front of one are beyond.
"""

import numpy as np
from numpy.typing import NDArray

from airlight.reference.scene.convex_bounds import Polyhedron
from airlight.reports.interchange.meshes import ShapeMesh

Array = NDArray[np.float64]


def cut_by(mesh: ShapeMesh, bounds: Polyhedron) -> tuple[ShapeMesh, ShapeMesh]:
    """Return the parts of a mesh within and beyond convex bounds; either may have no triangles."""
    # Corners with their normals, which are cut alike.
    rows = mesh.vertices if mesh.normals is None else np.hstack([mesh.vertices, mesh.normals])
    corners = rows[mesh.faces]
    height = mesh.vertices @ bounds.normal.T - bounds.offset
    # A corner nearer to a plane than this is in it: coordinates have seven digits.
    margin = 1e-6 * max(np.abs(mesh.vertices).max(initial=0.0), np.abs(bounds.offset).max())
    above = (height > margin)[mesh.faces]
    below = (height < -margin)[mesh.faces]
    # Whole triangles: in front of one plane, or in front of none.
    beyond = np.any(above.any(axis=1) & ~below.any(axis=1), axis=1)
    within = ~np.any(above, axis=(1, 2))
    inner, outer = [*corners[within]], [*corners[beyond]]
    for triangle in corners[~beyond & ~within]:
        polygon = triangle
        for normal, offset in zip(bounds.normal, bounds.offset, strict=True):
            front, polygon = _split(polygon, polygon[:, :3] @ normal - offset, margin)
            outer += _fan(front)
        inner += _fan(polygon)
    return _joined(mesh, inner), _joined(mesh, outer)


def _split(polygon: Array, height: Array, margin: float) -> tuple[Array, Array]:
    """Return the parts of a convex polygon, (n, k), above and below a plane, in the same order."""
    if not np.any(height > margin):
        return polygon[:0], polygon
    parts: tuple[list[Array], list[Array]] = ([], [])
    for number, corner in enumerate(polygon):
        here, after = height[number], height[(number + 1) % len(polygon)]
        for part, sign in zip(parts, (1.0, -1.0), strict=True):
            if sign * here >= -margin:
                part.append(corner)
        # An edge that passes through the plane adds its point in it to both parts.
        if abs(here) > margin and abs(after) > margin and here * after < 0:
            following = polygon[(number + 1) % len(polygon)]
            point = corner + here / (here - after) * (following - corner)
            parts[0].append(point)
            parts[1].append(point)
    above, below = (np.array(part).reshape(-1, polygon.shape[1]) for part in parts)
    return above, below if len(below) > 2 else below[:0]


def _fan(polygon: Array) -> list[Array]:
    """Return a convex polygon as triangles."""
    return [polygon[[0, i, i + 1]] for i in range(1, len(polygon) - 1)]


def _joined(mesh: ShapeMesh, triangles: list[Array]) -> ShapeMesh:
    width = 3 if mesh.normals is None else 6
    rows = np.array(triangles).reshape(-1, width)
    vertices, numbers = np.unique(rows, axis=0, return_inverse=True)
    normals = None if mesh.normals is None else vertices[:, 3:]
    return ShapeMesh(mesh.name, vertices[:, :3], numbers.reshape(-1, 3), normals, exact=mesh.exact)
