# SPDX-License-Identifier: BSD-3-Clause
"""The light volume as a closed mesh: the displaced grid of a shadow map, joined to the light.

Billeter, Sintorn, Assarsson 2010, section 4, after McCool 2000. Each corner (u, v) of a texel, or
of a larger quad of an adaptive tessellation, is a vertex at light + k / s, k = axis + u across + v
up, with s the inverse planar depth (`realtime.shadow_maps.inverse_depth_field`). In homogeneous
coordinates that is

    (light s + k, s),

which needs no division and holds vertices at infinity, s = 0. The grid of a spot ends at the border
of its face; there it is joined to the light itself, (light, 1). The six grids of a cube are welded
along their common edges, where their heights are the same numbers, and close by themselves.

Triangles are counter-clockwise in (u, v), as the light sees them: their normals point away from the
light and out of the volume. Faces of a cube that look along a negative axis are mirrored: there the
triangles are turned over.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np

from airlight.errors import InputError
from airlight.realtime.methods.published.billeter2010.tessellation import divide, edges, triangles
from airlight.realtime.scene.lights import Light
from airlight.realtime.shadow_maps.shadow_map import ShadowMap, inverse_depth

#: Departure of an adaptive mesh from the shadow map that is allowed by
#: default, relative to the depth.
THRESHOLD = 1e-3


@dataclass(frozen=True)
class VolumeMesh:
    """A closed mesh around the space that a light reaches."""

    #: (n, 4), homogeneous: the point is [:3] / [3] in world space [m]; [3] >= 0, 0 at infinity
    vertices: Any
    #: (m, 3) numbers of vertices; (v1 - v0) x (v2 - v0) points out of the lit volume
    triangles: Any


def volume_mesh(
    shadow_map: ShadowMap,
    light: Light,
    *,
    tessellation: str = "static",
    threshold: float = THRESHOLD,
) -> VolumeMesh:
    """Return the mesh around what a light reaches.

    `shadow_map`: shadow map of the light; `light`: a point or spot light; `tessellation`:
    ``static``: two triangles a texel; ``adaptive``: larger ones where the map is flat (see
    `realtime.methods.published.billeter2010.tessellation`); `threshold`: for ``adaptive``:
    departure from the map that is allowed, relative to the depth. Raises InputError if
    `tessellation` or `threshold` is none, or a surface touches the light.
    """
    if tessellation not in ("static", "adaptive"):
        raise InputError(f"tessellation: got {tessellation!r}, expected static or adaptive")
    height = _heights(shadow_map)
    if tessellation == "static":
        return _static_mesh(shadow_map, light, height)
    return adaptive_mesh(shadow_map, light, height, triangles(divide(edges(height, threshold))))


def memory_needed(faces: int, size: int) -> int:
    """Return about how much a static mesh takes at its making, an upper bound of
    an adaptive one [bytes].

    Each texel has one vertex (four doubles), two triangles (six 32 bit integers), a height with the
    copy of its distance, and its numbers (one of 32, one of 64 bits).
    """
    return faces * (size + 1) ** 2 * (4 * 8 + 6 * 4 + 2 * 4 + 4 + 8)


def _heights(shadow_map: ShadowMap):
    # A surface at the light has no finite inverse depth.
    side = shadow_map.size + 1
    height = np.array(inverse_depth(shadow_map)).reshape(shadow_map.faces, side, side)
    if not np.all(np.isfinite(height)):
        raise InputError(
            "light: a surface touches it, so that it has no light volume; move it off the surface"
        )
    return height


def _static_mesh(shadow_map: ShadowMap, light: Light, height) -> VolumeMesh:
    """Return the mesh of two triangles for each texel."""
    faces, size = shadow_map.faces, shadow_map.size
    number, vertex_corners = _numbering(faces, size, np.ones(height.size, bool))
    # Two triangles for each texel; a spot has one more for each side of a texel on the border.
    cells = 2 * faces * size * size
    corner_numbers = np.empty((cells + (4 * size if faces == 1 else 0), 3), np.int32)
    if faces == 1:
        corner_numbers[cells:] = _sides(size, number, apex=len(vertex_corners))
    grid, number = (
        corner_numbers[:cells].reshape(faces, size, size, 2, 3),
        number.reshape(height.shape),
    )
    # Both triangles of a texel share its diagonal from (0, 0) to (1, 1); the mirrored faces of a
    # cube take their corners in reverse.
    steps = ((0, 0), (0, 1), (1, 1)), ((0, 0), (1, 1), (1, 0))  # (row, column)
    for face in range(faces):
        for which, three in enumerate(steps):
            for k, (row, column) in enumerate(three[::-1] if face % 2 else three):
                grid[face, ..., which, k] = number[face, row : row + size, column : column + size]
    return VolumeMesh(_vertices(shadow_map, light, height, vertex_corners), corner_numbers)


def adaptive_mesh(shadow_map: ShadowMap, light: Light, height, corners) -> VolumeMesh:
    """Return the mesh of triangles between corners of texels; the corners of triangles
    become its vertices.
    """
    faces, size = shadow_map.faces, shadow_map.size
    used = np.zeros(height.size, bool)
    used[corners] = True
    number, vertex_corners = _numbering(faces, size, used)
    corner_numbers = number[corners]
    # A spot is closed by triangles to its light; mirrored faces of a cube are turned over.
    if faces == 1:
        sides = _sides(size, number, apex=len(vertex_corners))
        corner_numbers = np.concatenate([corner_numbers, sides])
    else:
        mirrored = corners[:, 0] // (size + 1) ** 2 % 2 == 1
        corner_numbers[mirrored] = corner_numbers[mirrored, ::-1]
    return VolumeMesh(_vertices(shadow_map, light, height, vertex_corners), corner_numbers)


def _numbering(faces: int, size: int, used):
    """Return the number of the vertex at each corner, -1 for none, and the corners in the order
    of these numbers.
    """
    # Faces of a cube meet in corners that are one point: the earlier corner stands for both, and is
    # used if either is.
    if faces == 6:
        twin, original = _welds(size)
        used[original[used[twin]]] = True
        used[twin] = False
    number = np.cumsum(used, dtype=np.int32) - 1
    number[~used] = -1
    if faces == 6:
        number[twin] = number[original]
    return number, np.flatnonzero(used)


def _sides(size: int, number, *, apex: int):
    """Return the triangles between the vertices on the border of a spot's face and the light."""
    # An adaptive mesh uses some corners of the border alone.
    ring = number[_border(size)]
    ring = ring[ring >= 0]
    return np.stack([np.roll(ring, -1), ring, np.full(len(ring), apex, np.int32)], axis=1)


def _vertices(shadow_map: ShadowMap, light: Light, height, vertex_corners):
    """Return the homogeneous coordinates of corners of texels, in ascending
    order, and of a spot's light.
    """
    # (light, 1) comes last; corners are (light s + k, s), with k of the corner on its face.
    side = shadow_map.size + 1
    place = np.array(light.position, dtype=float).ravel()
    count = len(vertex_corners)
    result = np.empty((count + (1 if shadow_map.projection.basis else 0), 4))
    result[count:] = (*place, 1)
    starts = np.searchsorted(vertex_corners, np.arange(shadow_map.faces + 1) * side**2)
    batch = 2**16  # what is in between stays in the cache
    for face in range(shadow_map.faces):
        for start in range(starts[face], starts[face + 1], batch):
            some = slice(start, min(start + batch, starts[face + 1]))
            numbers = (vertex_corners[some] - face * side**2).astype(np.int32)
            row, column = np.divmod(numbers, side)
            u, v = column * (2 / shadow_map.size) - 1, row * (2 / shadow_map.size) - 1
            s = height[face].ravel()[numbers].astype(float)
            for axis, k in enumerate(_directions(shadow_map.projection.basis, face, u, v)):
                result[some, axis] = place[axis] * s + k
            result[some, 3] = s
    return result


def _directions(basis, face: int, u, v) -> list[Any]:
    """Return the coordinates of axis + u across + v up of a face."""
    if basis:
        across, up, axis = (np.array(vector, dtype=float).ravel() for vector in basis)
        return [axis[k] + u * across[k] + v * up[k] for k in range(3)]
    cyclic = [1.0 - 2 * (face & 1), u, v]  # from the coordinate of the axis onwards
    return [cyclic[(k - (face >> 1)) % 3] for k in range(3)]


def _border(size: int):
    """Return the corners on the border of a face, counter-clockwise in (u, v)."""
    # Four sides, each without the corner at which the next one begins.
    along = np.arange(size)
    side = size + 1
    return np.concatenate(
        [along, along * side + size, size * side + size - along, (size - along) * side]
    )


def _welds(size: int):
    """Return the corners of a cube's faces that are the same as an earlier one, and that one."""
    # The corners on the borders of all faces, and their places in the lattice of the cube, 0 to
    # `size` along each axis: the coordinate of the face's axis, then column and row along the next.
    face = np.repeat(np.arange(6), 4 * size)
    border = np.tile(_border(size), 6)
    row, column = np.divmod(border, size + 1)
    lattice = np.empty((3, len(face)), np.int64)
    for step, value in enumerate((size * (1 - (face & 1)), column, row)):
        lattice[((face >> 1) + step) % 3, np.arange(len(face))] = value
    # Corners at one place of the lattice are one point; the first of them is the original.
    numbers = face * (size + 1) ** 2 + border
    key = np.ravel_multi_index(tuple(lattice), (size + 1,) * 3)
    _, first, group = np.unique(key, return_index=True, return_inverse=True)
    original = numbers[first[group]]
    twin = original != numbers
    return numbers[twin], original[twin]
