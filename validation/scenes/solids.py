# SPDX-License-Identifier: BSD-3-Clause
"""Solids of the built-in scenes: closed meshes in which every edge has two triangles, and walls with openings.

Silhouette edges form closed loops only if triangles share their vertices. So each vertex is stored once, and faces run
counter-clockwise as seen from outside.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from validation.scenes.parts import Mesh, grid, skin


def box(size: Sequence[float]) -> Mesh:
    """Return a box about the origin with edges of lengths `size`, (3,) [m]: 12 triangles, 8 vertices."""
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = np.array([[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]])
    return corners * np.asarray(size), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def tetrahedron(radius: float) -> Mesh:
    """Return a regular tetrahedron whose corners are at a distance `radius` [m] from the origin: 4 triangles."""
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    return radius * corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def icosphere(levels: int) -> Mesh:
    """Return the unit sphere as an icosahedron subdivided `levels` times: 20 * 4^levels triangles, strictly convex."""
    golden = (1 + np.sqrt(5)) / 2
    base = [(s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array([(0, s, t) for s, t in base] + [(s, t, 0) for s, t in base] + [(t, 0, s) for s, t in base])
    # The faces of the icosahedron are its triples of vertices at distance 2.
    near = np.isclose(np.linalg.norm(vertices[:, None] - vertices, axis=2), 2)
    triples = [
        (a, b, c) for a in range(12) for b in range(a) for c in range(b) if near[a, b] and near[b, c] and near[a, c]
    ]
    faces = np.array([t if np.linalg.det(vertices[list(t)]) > 0 else (t[0], t[2], t[1]) for t in triples])
    vertices = vertices / np.linalg.norm(vertices[0])
    for _ in range(levels):
        known = len(vertices)
        vertices, faces = divided((vertices, faces))
        vertices[known:] /= np.linalg.norm(vertices[known:], axis=1, keepdims=True)
    return vertices, faces


def divided(mesh: Mesh) -> Mesh:
    """Return each face as four, cut at the midpoints of its edges, which come after the vertices that were there."""
    vertices, faces = mesh
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = (number.reshape(-1, 3) + len(vertices)).T
    a, b, c = faces.T
    corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    middles = vertices[unique].mean(axis=1)
    return np.concatenate([vertices, middles]), np.concatenate([np.stack(triple, axis=1) for triple in corners])


def gem(sides: int, rings: int) -> Mesh:
    """Return a faceted unit sphere whose rings are turned by half a side each: 2 sides rings triangles, convex."""
    polar = np.pi * (1 - np.arange(1, rings + 1) / (rings + 1))
    i = np.arange(sides)
    j = (i + 1) % sides
    angle = 2 * np.pi * (i + 0.5 * np.arange(rings)[:, None]) / sides
    height = np.broadcast_to(np.cos(polar)[:, None], angle.shape)
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=2)
    points[:, :, :2] *= np.sin(polar)[:, None, None]
    faces = [np.stack([np.full(sides, rings * sides), j, i], axis=1)]
    for low in range(0, (rings - 1) * sides, sides):
        high = low + sides
        faces += [np.stack([low + i, low + j, high + i], axis=1), np.stack([low + j, high + j, high + i], axis=1)]
    last = (rings - 1) * sides
    faces += [np.stack([np.full(sides, rings * sides + 1), last + i, last + j], axis=1)]
    return np.concatenate([points.reshape(-1, 3), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]]), np.concatenate(faces)


def torus(radius: float, thickness: float, cells: tuple[int, int]) -> Mesh:
    """Return a torus about the z axis of 2 cells[0] cells[1] triangles.

    Parameters
    ----------
    radius, thickness
        Radii of the torus and of its tube [m].
    cells
        Number of cells round the axis, and round the tube.
    """
    around = 2 * np.pi * np.arange(cells[0])[:, None] / cells[0]
    # Clockwise in (distance, height): then each ring is counter-clockwise as seen from the next one.
    across = -2 * np.pi * np.arange(cells[1])[None] / cells[1]
    distance = radius + thickness * np.cos(across)
    height = np.broadcast_to(thickness * np.sin(across), (cells[0], cells[1]))
    rings = np.stack([distance * np.cos(around), distance * np.sin(around), height], axis=2)
    return skin(rings, ring_of_rings=True)


def prism(outline: ArrayLike, height: float) -> Mesh:
    """Return an upright prism on z = 0 of 4 k triangles.

    Parameters
    ----------
    outline
        (k, 2) [m], counter-clockwise and star-shaped about the mean of its points.
    height
        Height of the prism [m].
    """
    outline = np.asarray(outline, dtype=np.float64)
    return skin([np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, height)])


def star(inner: float, outer: float, points: int) -> NDArray[np.float64]:
    """Return the outline of a star about the origin with an inner and an outer radius [m], (2 points, 2) [m]."""
    angle = np.pi * np.arange(2 * points) / points
    return np.where(np.arange(2 * points) % 2, inner, outer)[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)


def arch(radii: tuple[float, float], depth: float, steps: int) -> Mesh:
    """Return half a ring of rectangular section in the plane y = 0, standing on z = 0: 8 (steps + 1) triangles.

    Parameters
    ----------
    radii
        Inner and outer radius [m].
    depth
        Along y [m].
    steps
        Number of segments of the half circle.
    """
    inner, outer = radii
    section = np.array([[inner, -0.5], [outer, -0.5], [outer, 0.5], [inner, 0.5]]) * (1, depth)
    angle = np.pi * np.arange(steps + 1)[:, None] / steps
    distance, side = section[None, :, 0], np.broadcast_to(section[:, 1], (steps + 1, 4))
    return skin(np.stack([distance * np.cos(angle), side, distance * np.sin(angle)], axis=2))


def gable(corner: Sequence[float], across: Sequence[float], up: Sequence[float], cells: tuple[int, int]) -> Mesh:
    """Return a wall with a gable of half its height: 2 cells[0] cells[1] + cells[0] triangles.

    Parameters
    ----------
    corner, across, up, cells
        Of the wall below the gable, (3,) each [m], see `validation.scenes.parts.grid`.
    """
    vertices, faces = grid(corner, across, up, cells)
    apex = np.asarray(corner) + 0.5 * np.asarray(across) + 1.5 * np.asarray(up)
    eaves = np.arange(cells[0] + 1) * (cells[1] + 1) + cells[1]
    fan = np.stack([eaves[:-1], eaves[1:], np.full(cells[0], len(vertices))], axis=1)
    return np.concatenate([vertices, [apex]]), np.concatenate([faces, fan])


def pierced(
    corner: Sequence[float], across: Sequence[float], up: Sequence[float], *, hole, cells: tuple[int, int]
) -> Mesh:
    """Return an open wall with a round hole: 2 cells[0] cells[1] triangles, cells[0] of which touch the hole.

    Parameters
    ----------
    corner, across, up
        A corner of the rectangle and the two edges that start there, (3,) each [m]; the normal is across x up.
    hole
        Position of the centre along `across` and along `up`, as shares of them, and the radius [m].
    cells
        Number of cells around the hole, even and at least 8, and from the hole to the border.
    """
    u, v, radius = hole
    right, above = np.asarray(across, dtype=np.float64), np.asarray(up, dtype=np.float64)
    angle = 2 * np.pi * (np.arange(cells[0]) + 0.5) / cells[0]
    width, height = np.linalg.norm(right), np.linalg.norm(above)
    # Each ray from the centre ends at the side that it meets first; the ray nearest to a corner ends at the corner.
    x, y = np.cos(angle), np.sin(angle)
    sideways = np.where(x > 0, 1 - u, u) * width / np.abs(x)
    upwards = np.where(y > 0, 1 - v, v) * height / np.abs(y)
    border = np.minimum(sideways, upwards)[:, None] * np.stack([x, y], axis=1)
    for end in np.array([[-u, -v], [1 - u, -v], [1 - u, 1 - v], [-u, 1 - v]]) * (width, height):
        border[np.argmax((x * end[0] + y * end[1]) / np.linalg.norm(end))] = end
    share = np.arange(cells[1] + 1)[:, None, None] / cells[1]
    offset = (1 - share) * radius * np.stack([x, y], axis=1) + share * border
    points = np.asarray(corner) + (u + offset[..., :1] / width) * right + (v + offset[..., 1:] / height) * above
    i, n = np.arange(cells[0]), cells[0]
    j = (i + 1) % n
    faces = []
    for low in range(0, cells[1] * n, n):
        high = low + n
        faces += [np.stack([low + i, high + i, high + j], axis=1), np.stack([low + i, high + j, low + j], axis=1)]
    return points.reshape(-1, 3), np.concatenate(faces)
