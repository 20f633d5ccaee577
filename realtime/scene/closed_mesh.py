# SPDX-License-Identifier: BSD-3-Clause
"""Closed meshes of any shape: what is wrong with one, by the name of an edge, and which points lie inside.

A mesh bounds a body if every edge is met by two triangles, once each way, no triangle passes through another, and
around every point its triangles wind once (inside) or not at all (outside). The winding number of a mesh about a point
is the sum of the solid angles of its triangles over 4 pi (Van Oosterom and Strackee 1983, eq. 8): with the corners a,
b, c seen from the point,

    tan(angle/2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from realtime.errors import InputError
from realtime.numerics.array_types import aligned_array
from realtime.scene.mesh_adjacency import scene_of

Array = NDArray[np.float64]

_SIDE = 1e-6  # of the length of an edge, and of the weights of a corner: what lies nearer to an end only touches it
_HITS = 8  # triangles that a ray along an edge meets, at its corners mostly, before all triangles are tried instead


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
        """Return what a message calls an edge: the user's numbers of its vertices, and its middle."""
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


def check_bodies(meshes: Sequence[ClosedMesh], shapes: Sequence[Any]) -> None:
    """Refuse meshes that are no disjoint bodies, with the name of an edge.

    `meshes`: the bounds of all media; `shapes`: Mitsuba's shapes of them, in the same order. Raises InputError for
    meshes that cross themselves or one another, are inside out, or lie within one another.
    """
    _check_crossings(meshes, shapes)
    parts = [part for number, mesh in enumerate(meshes) for part in _parts(number, mesh)]
    boxes = [(part.corners.min(axis=(0, 1)), part.corners.max(axis=(0, 1))) for part in parts]
    for number, part in enumerate(parts):
        mesh = meshes[part.mesh]
        tail, head = mesh.faces[part.first, :2]
        point = mesh.vertices[tail]
        around: dict[int, int] = {}  # by mesh
        for other, (low, high) in enumerate(boxes):
            if other != number and np.all(point >= low) and np.all(point <= high):
                winding = round(winding_number(parts[other].corners, point))
                around[parts[other].mesh] = around.get(parts[other].mesh, 0) + winding
        # A part that faces inwards is the wall of a hollow.
        if around.pop(part.mesh, 0) != (0 if part.outwards else 1):
            flaw = "has a part within another" if part.outwards else "is inside out"
            raise InputError(
                f"shape '{mesh.name}' bounds a medium and {flaw}, at {mesh.edge_words(tail, head)}; wanted faces that "
                "run counter-clockwise seen from outside, and parts beside one another"
            )
        nesting = [other for other, winding in around.items() if winding]
        if nesting:
            raise InputError(
                f"the medium of shape '{mesh.name}' lies within that of shape '{meshes[nesting[0]].name}', at "
                f"{mesh.edge_words(tail, head)}; wanted media beside one another, none nested"
            )


@dataclass(frozen=True)
class _Part:
    mesh: int  #: its number
    first: int  #: the number of one of its triangles
    corners: Array
    outwards: bool  #: whether its triangles face outwards


def _parts(number: int, mesh: ClosedMesh) -> list[_Part]:
    """Return the connected parts of a mesh."""
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    graph = coo_array((np.ones(len(tail), dtype=np.int8), (tail, head)), shape=(len(mesh.vertices),) * 2)
    _, component = connected_components(graph, directed=False)
    own = component[mesh.faces[:, 0]]
    parts = []
    for each in np.unique(own):
        inside = np.flatnonzero(own == each)
        corners = mesh.corners[inside]
        local = corners - corners.mean(axis=(0, 1))
        volume = np.einsum("ij,ij->", local[:, 0], np.cross(local[:, 1], local[:, 2]))
        parts.append(_Part(number, int(inside[0]), corners, bool(volume > 0)))
    return parts


def _check_crossings(meshes: Sequence[ClosedMesh], shapes: Sequence[Any]) -> None:
    """Refuse meshes of which an edge passes through a triangle that it does not touch.

    Mitsuba finds the triangles, in float32; the crossing is computed again in float64. Edges that meet very many
    triangles are tried against every triangle whose box theirs touches.
    """
    boundary = scene_of(shapes)
    numbers = {shape_number(shape): number for number, shape in enumerate(shapes)}
    for number, mesh in enumerate(meshes):
        tail, head = _edges(mesh)
        begin, end = mesh.vertices[tail], mesh.vertices[head]
        met, triangle, edge, left = _met_triangles(boundary, begin, end)
        other = np.array([numbers[each] for each in met.tolist()], dtype=np.int64)
        near = [_near_triangles(other.corners, begin[left], end[left]) for other in meshes]
        other = np.concatenate([other, *(np.full(len(found[0]), n) for n, found in enumerate(near))])
        triangle = np.concatenate([triangle, *(found[0] for found in near)])
        edge = np.concatenate([edge, *(left[found[1]] for found in near)])
        for second in np.unique(other):
            pairs = np.flatnonzero(other == second)
            against = meshes[second]
            at = _piercing(against.corners[triangle[pairs]], begin[edge[pairs]], end[edge[pairs]])
            if second == number:
                shared = against.faces[triangle[pairs]][:, :, None] == np.stack([tail, head], 1)[edge[pairs]][:, None]
                at &= ~shared.any(axis=(1, 2))
            if not at.any():
                continue
            first = pairs[int(np.argmax(at))]
            words = mesh.edge_words(tail[edge[first]], head[edge[first]])
            if second == number:
                raise InputError(
                    f"shape '{mesh.name}' bounds a medium and crosses itself: {words} passes through triangle "
                    f"{triangle[first]}; wanted a mesh without crossings"
                )
            raise InputError(
                f"the media of shapes '{mesh.name}' and '{against.name}' overlap: {words} of the first passes through "
                f"triangle {triangle[first]} of the other; wanted disjoint bounds"
            )


def _edges(mesh: ClosedMesh) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Return the numbers of the two vertices of every edge, each edge once."""
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    return tail[tail < head], head[tail < head]


def _met_triangles(boundary: Any, begin: Array, end: Array):
    """Return the numbers of shapes and triangles that edges meet, and of the edges; and edges that may meet more."""
    length = np.linalg.norm(end - begin, axis=1)
    unit = (end - begin) / length[:, None]
    shapes, triangles, edges = ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    left, past = np.arange(len(begin)), np.zeros(len(begin))
    for _ in range(_HITS):
        start = begin[left] + unit[left] * past[left, None]
        ray = mi.Ray3f(
            mi.Point3f(*(aligned_array(mi.Float, column) for column in start.T)),
            mi.Vector3f(*(aligned_array(mi.Float, column) for column in unit[left].T)),
            aligned_array(mi.Float, length[left] - past[left]),
            0.0,
            [],
        )
        hit = boundary.ray_intersect_preliminary(ray)
        dr.eval(hit)
        valid = np.isfinite(np.array(hit.t))
        distance = np.array(hit.t, dtype=np.float64)
        shapes.append(np.array(dr.reinterpret_array(mi.UInt32, hit.shape))[valid])
        triangles.append(np.array(hit.prim_index)[valid].astype(np.int64))
        edges.append(left[valid])
        left, distance = left[valid], distance[valid]
        past[left] += distance + 1e-5 * length[left]
        left = left[past[left] < length[left]]
        if not len(left):
            break
    return np.concatenate(shapes), np.concatenate(triangles), np.concatenate(edges), left


def _near_triangles(corners: Array, begin: Array, end: Array):
    """Return the numbers of triangles and of segments whose boxes touch."""
    low, high = corners.min(axis=1), corners.max(axis=1)
    ends = np.minimum(begin, end), np.maximum(begin, end)
    found = [np.flatnonzero(np.all((low <= b) & (high >= a), axis=1)) for a, b in zip(*ends, strict=True)]
    segments = np.repeat(np.arange(len(found)), [len(each) for each in found])
    return np.concatenate([*found, np.zeros(0, dtype=np.int64)]), segments


def _piercing(corners: Array, begin: Array, end: Array):
    """Return which segments pass through the inside of triangles, by Moeller and Trumbore's weights in float64."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    along, offset = end - begin, begin - corners[:, 0]
    across = np.cross(along, second)
    determinant = np.einsum("ij,ij->i", first, across)
    inverse = np.divide(1.0, determinant, out=np.full_like(determinant, np.inf), where=determinant != 0)
    with np.errstate(invalid="ignore"):
        u = np.einsum("ij,ij->i", offset, across) * inverse
        turned = np.cross(offset, first)
        v = np.einsum("ij,ij->i", along, turned) * inverse
        share = np.einsum("ij,ij->i", second, turned) * inverse
        weights = np.stack([u, v, 1 - u - v, share, 1 - share])
        return np.all(weights > _SIDE, axis=0) & np.isfinite(inverse)


def shape_number(shape: Any) -> int:
    """Return the number of a shape in Mitsuba's registry."""
    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])
