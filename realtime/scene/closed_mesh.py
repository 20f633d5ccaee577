# SPDX-License-Identifier: BSD-3-Clause
"""Closed meshes of any shape, and which points lie inside.

A mesh is closed if every edge is met by two triangles, once each way. The winding number of a mesh about a point is the
sum of the solid angles of its triangles over 4 pi (Van Oosterom and Strackee 1983, eq. 8): with the corners a, b, c
seen from the point,

    tan(angle/2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|).
"""

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.errors import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedMesh:
    """A mesh whose edges all are met once each way; doubled vertices are one."""

    name: str
    vertices: Array  #: (vertices, 3) [m]
    faces: NDArray[np.int64]  #: numbers of vertices, counter-clockwise seen from outside, (faces, 3)
    own: NDArray[np.int64]  #: the numbers of the vertices in the user's mesh, (vertices,)

    @property
    def corners(self) -> Array:
        """The corners of the triangles, (faces, 3, 3) [m]."""
        return self.vertices[self.faces]

    def edge_words(self, tail: int, head: int) -> str:
        """Return the name of an edge in messages: the user's numbers of its vertices, and its middle."""
        place = 0.5 * (self.vertices[tail] + self.vertices[head])
        return f"edge {self.own[tail]}-{self.own[head]} at ({', '.join(f'{x:.6g}' for x in place)})"


def closed_mesh(name: str, vertices: Array, faces: NDArray[Any]) -> ClosedMesh:
    """Return a mesh with its doubled vertices joined.

    `name`: for messages; `vertices`: positions [m], (vertices, 3); `faces`: vertex numbers, counter-clockwise seen from
    outside, (faces, 3). Raises InputError where an edge is not met once each way, with its name.
    """
    joined, own, number = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    mesh = ClosedMesh(name, joined, number.reshape(-1)[np.asarray(faces, dtype=np.int64)], own)
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    if np.any(tail == head):
        first = int(np.argmax(tail == head)) // 3
        raise _open(mesh, mesh.faces[first, 0], mesh.faces[first, 2], f"triangle {first} is a line")
    count = len(joined)
    forward, backward = tail * count + head, head * count + tail
    _, first, met = np.unique(forward, return_index=True, return_counts=True)
    if np.any(met > 1):
        at = first[int(np.argmax(met > 1))]
        times = int(met.max())
        raise _open(mesh, tail[at], head[at], f"{times} triangles run along it the same way")
    alone = np.flatnonzero(~np.isin(forward, backward))
    if len(alone):
        raise _open(mesh, tail[alone[0]], head[alone[0]], "one triangle meets it where two should")
    return mesh


def _open(mesh: ClosedMesh, tail: int, head: int, why: str) -> InputError:
    return InputError(
        f"shape '{mesh.name}' bounds a medium and is not a closed surface: {mesh.edge_words(tail, head)}, {why}; "
        "wanted a closed mesh in which two triangles meet at every edge, and run along it in opposite ways"
    )


def winding_number(corners: Array, point: Array) -> float:
    """Return how often triangles with `corners` (triangles, 3, 3) [m] wind around a `point` [m]; 1 is inside."""
    a, b, c = np.moveaxis(corners - point, 1, 0)
    lengths = [np.linalg.norm(side, axis=1) for side in (a, b, c)]
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    products = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
    turned = products[0] * lengths[2] + products[1] * lengths[0] + products[2] * lengths[1]
    return float(np.sum(np.arctan2(volume, lengths[0] * lengths[1] * lengths[2] + turned)) / (2 * np.pi))


def encloses(mesh: ClosedMesh, point: Array) -> bool:
    """Return whether a `point` [m] lies within a mesh."""
    if np.any(point < mesh.vertices.min(axis=0)) or np.any(point > mesh.vertices.max(axis=0)):
        return False
    return winding_number(mesh.corners, point) > 0.5


def shape_number(shape: Any) -> int:
    """Return the number of a shape in Mitsuba's registry."""
    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])
