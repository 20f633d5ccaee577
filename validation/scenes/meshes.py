# SPDX-License-Identifier: BSD-3-Clause
"""Meshes by their parameters: solids, walls with openings, turned profiles, and the odd
shapes of built-in scenes.

A mesh is a pair of vertices and faces. Closed meshes store each vertex once, every edge has two
triangles, and faces run counter-clockwise as seen from outside: silhouette edges form closed loops
only if triangles share their vertices.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from airlight.validation.arrays import Array, Index

Vertices = Array  #: (vertices, 3) [m]
Faces = Index  #: (faces, 3), counter-clockwise as seen from outside
Mesh = tuple[Vertices, Faces]


def rotation(axis: ArrayLike, degrees: float) -> Array:
    """Return the matrix, (3, 3), of a rotation about an axis through the origin by an
    angle [degrees] (Rodrigues).
    """
    x, y, z = np.asarray(axis, dtype=np.float64) / np.linalg.norm(axis)
    # skew @ v is the cross product of the axis with v.
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * (skew @ skew)


def placed(mesh: Mesh, position: ArrayLike, turn: Array | None = None) -> Mesh:
    """Return a mesh turned about the origin by a matrix, (3, 3), then moved
    by `position`, (3,) [m].
    """
    vertices, faces = mesh
    return (vertices if turn is None else vertices @ turn.T) + np.asarray(position), faces


def scaled(mesh: Mesh, factor: ArrayLike) -> Mesh:
    """Return a mesh scaled about the origin, by one `factor` [1] or by one for each axis, (3,)."""
    vertices, faces = mesh
    return vertices * np.asarray(factor), faces


def joined(meshes: Sequence[Mesh]) -> Mesh:
    """Return several meshes as one, with the parts in the order given."""
    offsets = np.cumsum([0] + [len(vertices) for vertices, _ in meshes[:-1]])
    return (
        np.concatenate([vertices for vertices, _ in meshes]),
        np.concatenate([faces + offset for (_, faces), offset in zip(meshes, offsets)]),
    )


def lathe(radius: ArrayLike, height: ArrayLike, sides: int) -> Mesh:
    """Return the closed surface of a profile turned about the z axis, 2
    sides len(radius) triangles.

    Radii and heights go from bottom to top, (n,) each [m]. Every radius is
    positive; fans close the ends.
    """
    radius, height = np.asarray(radius, dtype=np.float64), np.asarray(height, dtype=np.float64)
    angle = 2 * np.pi * np.arange(sides) / sides
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(sides)], axis=1)
    return skin(radius[:, None, None] * circle + height[:, None, None] * np.array([0.0, 0.0, 1.0]))


def skin(rings: ArrayLike, *, ring_of_rings: bool = False) -> Mesh:
    """Return the closed surface through n rings of k points, (n, k, 3) [m]: 2 k n
    triangles with or without ends.

    Each ring runs counter-clockwise as seen from the next one. The last is joined to the first in a
    ring of rings; otherwise fans about the mean of a ring close both ends.
    """
    rings = np.asarray(rings, dtype=np.float64)
    count, sides = rings.shape[:2]
    i = np.arange(sides)
    j = (i + 1) % sides
    faces = []
    # Between neighbouring rings each quad is cut into two triangles; the modulo leads from the last
    # ring to the first in a ring of rings.
    for ring in range(count if ring_of_rings else count - 1):
        low, high = ring * sides, (ring + 1) % count * sides
        faces += [
            np.stack([low + i, low + j, high + j], axis=1),
            np.stack([low + i, high + j, high + i], axis=1),
        ]
    vertices = rings.reshape(-1, 3)
    if not ring_of_rings:
        # The centres of the fans are two more vertices, after those of the rings. The lower fan
        # runs against the ring, so that it faces downwards.
        first, last, end = count * sides, count * sides + 1, (count - 1) * sides
        faces += [
            np.stack([np.full(sides, first), j, i], axis=1),
            np.stack([np.full(sides, last), end + i, end + j], 1),
        ]
        vertices = np.concatenate([vertices, rings[[0, -1]].mean(axis=1)])
    return vertices, np.concatenate(faces)


def grid(
    corner: Sequence[float], across: Sequence[float], up: Sequence[float], cells: tuple[int, int]
) -> Mesh:
    """Return an open rectangle from a corner and the edges that start there [m];
    its normal is across x up.

    Along `across` and along `up` it has so many `cells` of two triangles.
    """
    n, m = cells
    u, v = np.meshgrid(np.arange(n + 1) / n, np.arange(m + 1) / m, indexing="ij")
    vertices = (
        np.asarray(corner)
        + u.reshape(-1, 1) * np.asarray(across)
        + v.reshape(-1, 1) * np.asarray(up)
    )
    i, j = (index.reshape(-1) for index in np.meshgrid(np.arange(n), np.arange(m), indexing="ij"))
    # The four corners of each cell, counter-clockwise seen from the side of the normal: vertices
    # are numbered along `up` first.
    a, b, c, d = (
        i * (m + 1) + j,
        (i + 1) * (m + 1) + j,
        (i + 1) * (m + 1) + j + 1,
        i * (m + 1) + j + 1,
    )
    return vertices, np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])


def box(size: ArrayLike) -> Mesh:
    """Return a box about the origin with edges of lengths `size`, (3,) [m]:
    12 triangles, 8 vertices.
    """
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = np.array(
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    )
    return corners * np.asarray(size), np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])


def tetrahedron(radius: float) -> Mesh:
    """Return a regular tetrahedron whose corners are at a distance `radius` [m] from
    the origin: 4 triangles.
    """
    corners = np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]]) / np.sqrt(3)
    return radius * corners, np.array([[0, 1, 2], [0, 3, 1], [0, 2, 3], [1, 3, 2]])


def icosphere(levels: int) -> Mesh:
    """Return the unit sphere as an icosahedron subdivided `levels` times: 20 * 4^levels
    triangles, strictly convex.
    """
    golden = (1 + np.sqrt(5)) / 2
    base = [(s, t * golden) for s in (-1, 1) for t in (-1, 1)]
    vertices = np.array(
        [(0, s, t) for s, t in base] + [(s, t, 0) for s, t in base] + [(t, 0, s) for s, t in base]
    )
    # The faces of the icosahedron are its triples of vertices at distance 2.
    near = np.isclose(np.linalg.norm(vertices[:, None] - vertices, axis=2), 2)
    triples = [
        (a, b, c)
        for a in range(12)
        for b in range(a)
        for c in range(b)
        if near[a, b] and near[b, c] and near[a, c]
    ]
    faces = np.array(
        [t if np.linalg.det(vertices[list(t)]) > 0 else (t[0], t[2], t[1]) for t in triples]
    )
    vertices = vertices / np.linalg.norm(vertices[0])
    # Only the midpoints are new; they are moved out to the unit sphere.
    for _ in range(levels):
        count = len(vertices)
        vertices, faces = divided((vertices, faces))
        vertices[count:] /= np.linalg.norm(vertices[count:], axis=1, keepdims=True)
    return vertices, faces


def divided(mesh: Mesh) -> Mesh:
    """Return each face as four, cut at the midpoints of its edges, which come after the
    vertices that were there.
    """
    vertices, faces = mesh
    # Each edge with its lower vertex first: both triangles of an edge then share one midpoint.
    edges = np.sort(np.stack([faces, np.roll(faces, -1, axis=1)], axis=2).reshape(-1, 2), axis=1)
    unique, number = np.unique(edges, axis=0, return_inverse=True)
    ab, bc, ca = (number.reshape(-1, 3) + len(vertices)).T
    a, b, c = faces.T
    corners = [(a, ab, ca), (b, bc, ab), (c, ca, bc), (ab, bc, ca)]
    middles = vertices[unique].mean(axis=1)
    return np.concatenate([vertices, middles]), np.concatenate(
        [np.stack(triple, axis=1) for triple in corners]
    )


def gem(sides: int, rings: int) -> Mesh:
    """Return a faceted unit sphere whose rings are turned by half a side each: 2 sides
    rings triangles, convex.
    """
    polar = np.pi * (1 - np.arange(1, rings + 1) / (rings + 1))
    i = np.arange(sides)
    j = (i + 1) % sides
    # Every ring is turned by half a side against the one below.
    angle = 2 * np.pi * (i + 0.5 * np.arange(rings)[:, None]) / sides
    height = np.broadcast_to(np.cos(polar)[:, None], angle.shape)
    points = np.stack([np.cos(angle), np.sin(angle), height], axis=2)
    points[:, :, :2] *= np.sin(polar)[:, None, None]
    # The south pole is vertex rings * sides, the north pole the one after it.
    faces = [np.stack([np.full(sides, rings * sides), j, i], axis=1)]
    for low in range(0, (rings - 1) * sides, sides):
        high = low + sides
        faces += [
            np.stack([low + i, low + j, high + i], axis=1),
            np.stack([low + j, high + j, high + i], axis=1),
        ]
    last = (rings - 1) * sides
    faces += [np.stack([np.full(sides, rings * sides + 1), last + i, last + j], axis=1)]
    return np.concatenate(
        [points.reshape(-1, 3), [[0.0, 0.0, -1.0], [0.0, 0.0, 1.0]]]
    ), np.concatenate(faces)


def torus(radius: float, thickness: float, cells: tuple[int, int]) -> Mesh:
    """Return a torus about the z axis, with the radius of its tube [m]: cells around the
    axis and around the tube.
    """
    around = 2 * np.pi * np.arange(cells[0])[:, None] / cells[0]
    # Clockwise in (distance, height): then each ring is counter-clockwise
    # as seen from the next one.
    across = -2 * np.pi * np.arange(cells[1])[None] / cells[1]
    distance = radius + thickness * np.cos(across)
    height = np.broadcast_to(thickness * np.sin(across), (cells[0], cells[1]))
    rings = np.stack([distance * np.cos(around), distance * np.sin(around), height], axis=2)
    return skin(rings, ring_of_rings=True)


def prism(outline: ArrayLike, height: float) -> Mesh:
    """Return an upright prism on z = 0 of 4 k triangles; its outline, (k, 2)
    [m], runs counter-clockwise.

    The outline is star-shaped about the mean of its points.
    """
    outline = np.asarray(outline, dtype=np.float64)
    return skin([np.column_stack([outline, np.full(len(outline), z)]) for z in (0.0, height)])


def star(inner: float, outer: float, points: int) -> Array:
    """Return the outline of a star about the origin with an inner and an outer
    radius [m], (2 points, 2) [m].
    """
    angle = np.pi * np.arange(2 * points) / points
    return np.where(np.arange(2 * points) % 2, inner, outer)[:, None] * np.stack(
        [np.cos(angle), np.sin(angle)], axis=1
    )


def arch(radii: tuple[float, float], depth: float, steps: int) -> Mesh:
    """Return half a ring of rectangular section in the plane y = 0, standing on z = 0:
    8 (steps + 1) triangles.

    It has an inner and an outer radius and a depth along y [m], and so many segments.
    """
    inner, outer = radii
    section = np.array([[inner, -0.5], [outer, -0.5], [outer, 0.5], [inner, 0.5]]) * (1, depth)
    angle = np.pi * np.arange(steps + 1)[:, None] / steps
    distance, side = section[None, :, 0], np.broadcast_to(section[:, 1], (steps + 1, 4))
    return skin(np.stack([distance * np.cos(angle), side, distance * np.sin(angle)], axis=2))


def gable(
    corner: Sequence[float], across: Sequence[float], up: Sequence[float], cells: tuple[int, int]
) -> Mesh:
    """Return the wall `grid` with a gable of half its height: 2 cells[0]
    cells[1] + cells[0] triangles.
    """
    vertices, faces = grid(corner, across, up, cells)
    apex = np.asarray(corner) + 0.5 * np.asarray(across) + 1.5 * np.asarray(up)
    # The vertices of the upper edge of the wall; the fan joins them to the apex.
    eaves = np.arange(cells[0] + 1) * (cells[1] + 1) + cells[1]
    fan = np.stack([eaves[:-1], eaves[1:], np.full(cells[0], len(vertices))], axis=1)
    return np.concatenate([vertices, [apex]]), np.concatenate([faces, fan])


def pierced(
    corner: Sequence[float],
    across: Sequence[float],
    up: Sequence[float],
    *,
    hole,
    cells: tuple[int, int],
) -> Mesh:
    """Return an open wall with a round hole: 2 cells[0] cells[1] triangles, of which cells[0] touch
    the hole.

    A `corner` of the rectangle and the two edges that start there, (3,) each [m], have the normal
    across x up. The hole has the position of its centre along `across` and along `up`, as fractions
    of them, and a radius [m]. Cells are counted around the hole, even and at least 8, and from the
    hole to the border.
    """
    u, v, radius = hole
    right, above = np.asarray(across, dtype=np.float64), np.asarray(up, dtype=np.float64)
    angle = 2 * np.pi * (np.arange(cells[0]) + 0.5) / cells[0]
    width, height = np.linalg.norm(right), np.linalg.norm(above)
    # Each ray from the centre ends at the side that it meets first; the ray nearest to a
    # corner ends at the corner.
    # Directions from the centre of the hole, half a cell off `across`, so that no sine is 0.
    x, y = np.cos(angle), np.sin(angle)
    sideways = np.where(x > 0, 1 - u, u) * width / np.abs(x)
    upwards = np.where(y > 0, 1 - v, v) * height / np.abs(y)
    border = np.minimum(sideways, upwards)[:, None] * np.stack([x, y], axis=1)
    for end in np.array([[-u, -v], [1 - u, -v], [1 - u, 1 - v], [-u, 1 - v]]) * (width, height):
        border[np.argmax((x * end[0] + y * end[1]) / np.linalg.norm(end))] = end
    # Rings of points go from the hole (0) to the border (1).
    fraction = np.arange(cells[1] + 1)[:, None, None] / cells[1]
    offset = (1 - fraction) * radius * np.stack([x, y], axis=1) + fraction * border
    points = (
        np.asarray(corner)
        + (u + offset[..., :1] / width) * right
        + (v + offset[..., 1:] / height) * above
    )
    i, n = np.arange(cells[0]), cells[0]
    j = (i + 1) % n
    faces = []
    for low in range(0, cells[1] * n, n):
        high = low + n
        faces += [
            np.stack([low + i, high + i, high + j], axis=1),
            np.stack([low + i, high + j, low + j], axis=1),
        ]
    return points.reshape(-1, 3), np.concatenate(faces)


def pierced_slab(along: NDArray, up: NDArray, thickness: float, corner: Sequence[float]) -> Mesh:
    """Return a closed upright slab in the plane x = corner[0] with a hole in every cell
    (i, j) with i and j odd.

    Lines between cells along y and z ascend from the lowest `corner` of the slab, (3,) [m], on, an
    even number of each, (n,) [m]; its thickness is towards -x [m].
    """
    n, m = len(along) - 1, len(up) - 1
    # Two layers of the same lattice of points: front at x = corner[0], back at a distance of the
    # thickness.
    y, z = np.meshgrid(along, up, indexing="ij")
    plane = np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    vertices = np.concatenate([plane, plane - [thickness, 0, 0]]) + np.asarray(corner)
    quads = []

    def solid(i: int, j: int) -> bool:
        return 0 <= i < n and 0 <= j < m and not (i % 2 and j % 2)

    def at(i: int, j: int, layer: int) -> int:
        # The number of a point of the lattice in the front (0) or back (1) layer.
        return layer * (n + 1) * (m + 1) + i * (m + 1) + j

    for i in range(n):
        for j in range(m):
            if not solid(i, j):
                continue
            # The front face, and the back face in the opposite order so that it faces away.
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            quads.append([at(*point, 0) for point in ring])
            quads.append([at(*point, 1) for point in reversed(ring)])
            # Where the next cell is open, a wall joins the two layers.
            for a, b, beyond in zip(
                ring, [*ring[1:], ring[0]], [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)]
            ):
                if not solid(*beyond):
                    quads.append([at(*a, 1), at(*b, 1), at(*b, 0), at(*a, 0)])
    faces = np.array(quads)
    return vertices, np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


# Shapes of single scenes --------------------------------------------------------------------------


def profile(
    stops: Sequence[float], radii: Sequence[float], *, height: float, rings: int, sides: int
) -> Mesh:
    """Return the lathe of a profile that is linear between stops (fractions of
    the height) with radii [m].
    """
    level = np.linspace(0.0, 1.0, rings)
    return lathe(np.interp(level, stops, radii), height * level, sides)


def vase(
    radius: float,
    swelling: float,
    wave: float,
    phase: float,
    *,
    height: float,
    rings: int,
    sides: int,
) -> Mesh:
    """Return the lathe of the profile radius + swelling sin^2(wave level +
    phase) [m], level from 0 to 1.
    """
    level = np.linspace(0.0, 1.0, rings)
    return lathe(radius + swelling * np.sin(wave * level + phase) ** 2, height * level, sides)


def spindle(height: float, rings: int, sides: int) -> Mesh:
    """Return a lathe that is thin at its ends and swells twice between them."""
    level = np.linspace(0.0, 1.0, rings)
    return lathe(
        0.023 + 0.093 * np.sin(np.pi * level) ** 2 * (1.3 + np.cos(9.1 * level)),
        height * level,
        sides,
    )


def faceted_sphere(radius: float, rings: int, sides: int, toward: Sequence[float]) -> Mesh:
    """Return a sphere of rings in the middle of equal bands of the polar angle; its axis
    points along `toward`, (3,).

    Seen along the axis its silhouette is one ring.
    """
    polar = np.pi * (1 - (np.arange(rings) + 0.5) / rings)
    axis = np.asarray(toward) / np.linalg.norm(toward)
    # Any vector across the axis: the sphere looks the same up to a turn about it.
    side = np.cross(axis, (1.0, 0.0, 0.0))
    side = side / np.linalg.norm(side)
    sphere = lathe(radius * np.sin(polar), radius * np.cos(polar), sides)
    return placed(sphere, (0.0, 0.0, 0.0), np.stack([np.cross(side, axis), side, axis], axis=1))


def fluted_column(
    radius: float,
    *,
    taper: float,
    foot: Sequence[float],
    head: Sequence[float],
    flutes: float,
    height: float,
    rings: int,
    sides: int,
) -> Mesh:
    """Return a column with twelve flutes: its radius falls by `taper`, foot and head add
    (size [m], decay [height]).
    """
    level = np.linspace(0.0, 1.0, rings)
    widened = foot[0] * np.exp(-level / foot[1]) + head[0] * np.exp(-(1 - level) / head[1])
    vertices, faces = lathe(radius * (1 - taper * level) + widened, height * level, sides)
    # The radius is reduced where the cosine is positive: twelve flutes around. The last two entries
    # are the centres of the fans, which stay.
    fluted = 1 - flutes * (np.cos(12 * 2 * np.pi * np.arange(sides) / sides) > 0)
    scale = np.concatenate([np.tile(fluted, rings), [1.0, 1.0]])
    return vertices * np.stack([scale, scale, np.ones_like(scale)], axis=1), faces


def statue(fold: float) -> Mesh:
    """Return a draped figure on a plinth, with folds that turn with height from the
    angle `fold`: 3584 triangles.
    """
    level = np.linspace(0.0, 1.0, 32)[:, None]
    angle = 2 * np.pi * np.arange(56)[None] / 56
    # Radii [m] at fractions of the height: a plinth up to 0.2, the figure above it.
    stops = [0, 0.2, 0.21, 0.3, 0.55, 0.62, 0.79, 0.83, 0.86, 0.93, 0.98, 1]
    outline = np.interp(
        level, stops, [0.37, 0.37, 0.29, 0.31, 0.19, 0.2, 0.27, 0.11, 0.08, 0.13, 0.1, 0.03]
    )
    # The folds begin above the plinth and end below the shoulders, where the figure is flatter
    # along y.
    draped = np.clip((level - 0.21) / 0.1, 0, 1) * np.clip((0.8 - level) / 0.2, 0, 1)
    folds = 1 + 0.13 * draped * np.cos(7 * angle + 5.3 * level + fold)
    radius = outline * folds * (1 - 0.23 * draped * np.sin(angle) ** 2)
    height = np.broadcast_to(2.37 * level, radius.shape)
    return skin(np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2))


def knot(
    turns: Sequence[int], radii: Sequence[float], thickness: float, cells: Sequence[int]
) -> Mesh:
    """Return a tube of uneven section along a knot on a torus about the z axis: 2
    cells[0] cells[1] triangles.

    The normal of the torus is perpendicular to every curve on it. It therefore orients the sections
    all the way round, and the last section joins the first without a seam.

    The turns about the axis of the torus and about its core are coprime; the radii are those of the
    core, and from it to the middle of the tube [m]; cells are along and about the tube.
    """
    (about, across), (radius, core), (rings, sides) = turns, radii, cells
    t = 2 * np.pi * np.arange(rings)[:, None] / rings
    a = 2 * np.pi * np.arange(sides)[None] / sides
    zero = np.zeros_like(t)
    # At the angle `about` t around the axis: away from the axis, and along the circle.
    outwards = np.stack([np.cos(about * t), np.sin(about * t), zero], axis=2)
    onwards = np.stack([-np.sin(about * t), np.cos(about * t), zero], axis=2)
    up = np.array([0.0, 0.0, 1.0])
    cos, sin = np.cos(across * t)[:, :, None], np.sin(across * t)[:, :, None]
    # The normal of the torus at the point of the curve, the tangent of the curve, and the third
    # vector of the frame, which lies in the torus.
    normal = cos * outwards + sin * up
    tangent = (radius + core * cos) * about * onwards + core * across * (cos * up - sin * outwards)
    side = np.cross(tangent / np.linalg.norm(tangent, axis=2, keepdims=True), normal)
    # Thickness along the tube and ridges around it; all factors stay above 0, so the section is a
    # star.
    swelling = 1 + 0.37 * np.sin((across + 4) * t + 0.7) + 0.19 * np.sin((3 * about + 7) * t + 1.9)
    ridges = 1 + 0.21 * np.cos(3 * a + (about + across) * t) + 0.13 * np.cos(2 * a - 5 * t + 0.9)
    section = (thickness * swelling * ridges)[:, :, None]
    centre = radius * outwards + core * normal
    return skin(
        centre + section * (np.cos(a)[:, :, None] * normal + np.sin(a)[:, :, None] * side),
        ring_of_rings=True,
    )


def bent(
    points: Vertices, waves: Sequence[tuple[Sequence[float], Sequence[float], float]]
) -> Vertices:
    """Return points, (n, 3) [m], displaced by waves: displacement [m], wave vector
    [1/m] and phase of each.

    Where the products of displacement and wave vector sum to less than 1, the map is one to one: no
    surface touches another or turns inside out.
    """
    moved = points.copy()
    for displacement, wave, phase in waves:
        moved += np.sin(points @ np.array(wave) + phase)[:, None] * np.array(displacement)
    return moved
