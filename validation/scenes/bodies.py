# SPDX-License-Identifier: BSD-3-Clause
"""Whether what bounds media are bodies beside one another, checked once, where a scene of a user is loaded.

A mesh bounds a body if every edge is met by two triangles, once each way, no triangle passes through another, and
around every point its triangles wind once (inside) or not at all (outside). Methods and reference count on that.
"""

from collections.abc import Sequence
from itertools import combinations, product
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import scipy
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from analytic.errors import InputError
from realtime.errors import InputError as MeshError
from realtime.numerics.array_types import aligned_array
from realtime.scene.closed_mesh import (
    FLAT,
    Bounds,
    ClosedMesh,
    encloses,
    holds,
    read_bounds,
    shape_number,
    winding_number,
)
from realtime.scene.mesh_adjacency import scene_of
from validation.arrays import Array, Index

_SIDE = 1e-6  # of the length of an edge, and of the weights of a corner: what lies nearer to an end only touches it


def check_bodies(scene: Any) -> None:
    """Refuse an `mi.Scene` in which the bounds of media are no disjoint bodies, with the name of an edge.

    Raises InputError for bounds that are no spheres or closed meshes, cross themselves or one another, are inside out,
    or lie within one another.
    """
    shapes = [shape for shape in scene.shapes() if _bounds_medium(shape)]
    try:
        read = [read_bounds(shape) for shape in shapes]
    except MeshError as error:
        raise InputError(str(error)) from None
    convex = [bounds for bounds, _ in read if bounds is not None]
    if len(convex) == len(read):
        shared: list[tuple[Any, Any]] = [pair for pair in combinations(convex, 2) if overlap(*pair)]
    else:
        meshes, balls = [mesh for _, mesh in read if mesh], [bounds for bounds in convex if bounds.is_sphere]
        _check_crossings([mesh for _, mesh in read], shapes)
        _check_nesting(meshes)
        shared = [pair for pair in combinations(balls, 2) if overlap(*pair)]
        pairs = product(meshes, balls)
        shared += [(a, b) for a, b in pairs if encloses(a, b.centre) or holds(b, a.vertices[0])]
    for first, second in shared:
        raise InputError(
            f"the media of shapes '{first.name}' and '{second.name}' overlap or one holds the other; wanted disjoint "
            "bounds"
        )


def _bounds_medium(shape: Any) -> bool:
    null = shape.bsdf() is not None and shape.bsdf().class_name() == "Null"
    return null and not shape.is_emitter() and shape.interior_medium() is not None


def overlap(first: Bounds, second: Bounds) -> bool:
    """Return whether two bounds share more than 1e-5 of their size; bounds that touch do not."""
    gap = float(np.linalg.norm(first.centre - second.centre))
    margin = FLAT * min(first.radius, second.radius)
    if gap >= first.radius + second.radius - margin:
        return False
    if first.is_sphere and second.is_sphere:
        return True
    if first.is_sphere or second.is_sphere:
        sphere, mesh = (first, second) if first.is_sphere else (second, first)
        return _distance_to_hull(mesh, sphere.centre) < sphere.radius - margin
    # The largest sphere in both: maximise t under n . x + t <= offset.
    planes = np.concatenate([first.normals, second.normals])
    largest_sphere = scipy.optimize.linprog(
        [0, 0, 0, -1],
        A_ub=np.column_stack([planes, np.ones(len(planes))]),
        b_ub=np.concatenate([first.offsets, second.offsets]),
        bounds=[(None, None)] * 4,
    )
    return bool(largest_sphere.status == 0 and -largest_sphere.fun > margin)


def _distance_to_hull(bounds: Bounds, point: Array) -> float:
    """Return the distance from a point to the convex hull of the corners.

    min |sum_i l_i v_i - point| with l_i >= 0 and sum l_i = 1 is a problem of non-negative least squares; a heavy last
    row holds the sum.
    """
    if holds(bounds, point):
        return 0.0
    weight = 1e4 * bounds.radius
    corners = np.unique(bounds.corners.reshape(-1, 3), axis=0) - point
    matrix = np.vstack([corners.T, np.full(len(corners), weight)])
    fractions, _ = scipy.optimize.nnls(matrix, np.array([0.0, 0.0, 0.0, weight]))
    return float(np.linalg.norm(fractions @ corners / fractions.sum()))


def _check_nesting(meshes: Sequence[ClosedMesh]) -> None:
    """Refuse meshes of which a part is inside out, or lies within another."""
    parts = [(number, *part) for number, mesh in enumerate(meshes) for part in _parts(mesh)]
    boxes = [(corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for *_, corners, _ in parts]
    for number, (own, first, _, outwards) in enumerate(parts):
        mesh = meshes[own]
        tail, head = mesh.faces[first, :2]
        point = mesh.vertices[tail]
        around: dict[int, int] = {}  # by mesh
        for other, (low, high) in enumerate(boxes):
            if other != number and np.all(point >= low) and np.all(point <= high):
                holder, _, corners, _ = parts[other]
                around[holder] = around.get(holder, 0) + round(winding_number(corners, point))
        # A part that faces inwards is the wall of a hollow.
        if around.pop(own, 0) != (0 if outwards else 1):
            flaw = "has a part within another" if outwards else "is inside out"
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


def _parts(mesh: ClosedMesh) -> list[tuple[int, Array, bool]]:
    """Return of each connected part of a mesh one triangle, the corners of all, and whether these face outwards."""
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
        parts.append((int(inside[0]), corners, bool(volume > 0)))
    return parts


def _check_crossings(meshes: Sequence[ClosedMesh | None], shapes: Sequence[Any]) -> None:
    """Refuse meshes of which an edge passes through a triangle that it does not touch, or through a sphere.

    `meshes`: those of the shapes, None for a sphere. Mitsuba finds the triangles, in float32; the crossing is computed
    again in float64.
    """
    boundary = scene_of(shapes)
    numbers = {shape_number(shape): number for number, shape in enumerate(shapes)}
    for number, mesh in enumerate(meshes):
        if mesh is None:
            continue
        tail, head = _edges(mesh)
        begin, end = mesh.vertices[tail], mesh.vertices[head]
        met, triangle, edge = _met_triangles(boundary, begin, end)
        other = np.array([numbers[each] for each in met.tolist()], dtype=np.int64)
        for second in np.unique(other):
            pairs = np.flatnonzero(other == second)
            against, at = meshes[second], np.ones(len(pairs), dtype=bool)
            if against is not None:
                at = _piercing(against.corners[triangle[pairs]], begin[edge[pairs]], end[edge[pairs]])
            if against is mesh:
                shared = mesh.faces[triangle[pairs]][:, :, None] == np.stack([tail, head], 1)[edge[pairs]][:, None]
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
                f"the media of shapes '{mesh.name}' and '{shapes[second].id()}' overlap: {words} of the first passes "
                f"through triangle {triangle[first]} of the other; wanted disjoint bounds"
            )


def _edges(mesh: ClosedMesh) -> tuple[Index, Index]:
    """Return the numbers of the two vertices of every edge, each edge once."""
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    return tail[tail < head], head[tail < head]


def _met_triangles(boundary: Any, begin: Array, end: Array):
    """Return the numbers of shapes and triangles that edges meet, and of the edges."""
    length = np.linalg.norm(end - begin, axis=1)
    unit = (end - begin) / length[:, None]
    shapes, triangles, edges = ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    left, past = np.arange(len(begin)), np.zeros(len(begin))
    # Triangles at the corners of an edge may hide what lies behind them: the edge is cast on from there to its end.
    while len(left):
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
        shapes.append(np.array(dr.reinterpret_array(mi.UInt32, hit.shape))[valid])
        triangles.append(np.array(hit.prim_index)[valid].astype(np.int64))
        left = left[valid]
        edges.append(left)
        past[left] += np.array(hit.t, dtype=np.float64)[valid] + 1e-5 * length[left]
        left = left[past[left] < length[left]]
    return np.concatenate(shapes), np.concatenate(triangles), np.concatenate(edges)


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
        fraction = np.einsum("ij,ij->i", second, turned) * inverse
        weights = np.stack([u, v, 1 - u - v, fraction, 1 - fraction])
        return np.all(weights > _SIDE, axis=0) & np.isfinite(inverse)
