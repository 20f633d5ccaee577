# SPDX-License-Identifier: BSD-3-Clause
"""The bounds of media must be disjoint bodies: checked once, where a scene of a user is loaded.

A mesh bounds a body if every edge is met by two triangles, once each way, no triangle passes
through another, and around every point its triangles wind once (inside) or not at all (outside).
Methods and reference count on that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.numerics.array_types import aligned_array
from airlight.realtime.scene.closed_mesh import (
    FLAT,
    Bounds,
    ClosedMesh,
    encloses,
    read_bounds,
    shape_number,
    winding_number,
)
from airlight.realtime.scene.mesh_adjacency import scene_of
from airlight.reference.scene.convex_bounds import largest_ball
from airlight.reference.scene.shapes import distance_to_triangles
from airlight.validation.arrays import Array, Bools, Index

Body = tuple[Bounds | None, ClosedMesh | None]  #: as `read_bounds` returns it


def check_bodies(scene: mi.Scene) -> None:
    """Refuse a scene in which the bounds of media are no disjoint bodies, with the name of an edge.

    Raises InputError for bounds that are no spheres or closed meshes, cross themselves or one
    another, are inside out, or lie within one another.
    """
    shapes = [shape for shape in scene.shapes() if _bounds_medium(shape)]
    bodies = [read_bounds(shape) for shape in shapes]
    # Spheres and convex meshes are compared pair by pair below. Only meshes that are not convex
    # need the search for crossing edges, and then all meshes take part, since either of two may be
    # the one that is not convex.
    if any(bounds is None for bounds, _ in bodies):
        with_mesh = [(shape, mesh) for shape, (_, mesh) in zip(shapes, bodies) if mesh is not None]
        meshes = {shape_number(shape): mesh for shape, mesh in with_mesh}
        _check_crossings(meshes, scene_of([shape for shape, _ in with_mesh]))
        _check_nesting(list(meshes.values()))
    for first, second in combinations(range(len(bodies)), 2):
        if _overlap(bodies[first], bodies[second]):
            raise InputError(
                f"the media of shapes '{shapes[first].id()}' and '{shapes[second].id()}' overlap "
                "or one holds the "
                "other; expected disjoint bounds"
            )


def _bounds_medium(shape: mi.Shape) -> bool:
    null = shape.bsdf() is not None and shape.bsdf().class_name() == "Null"
    return null and not shape.is_emitter() and shape.interior_medium() is not None


def _overlap(first: Body, second: Body) -> bool:
    """Return whether two bodies share more than 1e-5 of their size; bodies that touch do not.

    Two meshes that are not both convex are for `_check_crossings` and `_check_nesting`.
    """
    (one, one_mesh), (other, other_mesh) = first, second
    # Both are spheres or convex meshes: their bounding spheres come first.
    if one is not None and other is not None:
        gap = float(np.linalg.norm(one.centre - other.centre))
        margin = FLAT * min(one.radius, other.radius)
        if gap >= one.radius + other.radius - margin:
            return False
        # For two spheres the bounding spheres are the bodies themselves.
        if one_mesh is None and other_mesh is None:
            return True
        if one_mesh is not None and other_mesh is not None:
            return _common_sphere(one, other) > margin
    # A sphere and a mesh of any shape. Apart means that no triangle comes nearer to the centre than
    # the radius; the centre inside the mesh is the case of a sphere that touches no triangle
    # because the mesh holds it.
    sphere, mesh = (one, other_mesh) if one_mesh is None else (other, one_mesh)
    if sphere is None or mesh is None or not sphere.is_sphere:
        return False
    apart = distance_to_triangles(mesh.corners, sphere.centre) >= sphere.radius * (1 - FLAT)
    return not apart or encloses(mesh, sphere.centre)


def _common_sphere(first: Bounds, second: Bounds) -> float:
    """Return the radius of the largest sphere in two convex meshes."""
    # In radii of the smaller body, about its centre: the tolerances of the solver are 1e-7 of
    # whatever unit there is.
    small = min(first, second, key=lambda each: each.radius)
    normals = np.concatenate([first.normals, second.normals])
    offsets = np.concatenate([first.offsets, second.offsets]) - normals @ small.centre
    return small.radius * largest_ball(normals, offsets / small.radius)


def _check_nesting(meshes: Sequence[ClosedMesh]) -> None:
    """Refuse meshes with a part that is inside out, or lies within another part or mesh."""
    # Every connected part of every mesh is tested against all other parts with one of its vertices:
    # no edges cross (checked before), so one point decides for the whole part.
    parts = [(number, *part) for number, mesh in enumerate(meshes) for part in _parts(mesh)]
    boxes = [(corners.min(axis=(0, 1)), corners.max(axis=(0, 1))) for *_, corners, _ in parts]
    for number, (of_mesh, first, _, outwards) in enumerate(parts):
        mesh = meshes[of_mesh]
        tail, head = mesh.faces[first, :2]
        point = mesh.vertices[tail]
        # The winding numbers of all other parts about the point, summed over the parts of a mesh.
        # The bounding boxes save the sum of solid angles for parts far away.
        around: dict[int, int] = {}  # by mesh
        for other, (low, high) in enumerate(boxes):
            if other != number and np.all(point >= low) and np.all(point <= high):
                holder, _, corners, _ = parts[other]
                around[holder] = around.get(holder, 0) + round(winding_number(corners, point))
        # A part that faces inwards is the wall of a hollow.
        if around.pop(of_mesh, 0) != (0 if outwards else 1):
            flaw = "has a part within another" if outwards else "is inside out"
            raise InputError(
                f"shape '{mesh.name}' bounds a medium and {flaw}, at "
                f"{mesh.edge_words(tail, head)}; expected faces "
                "that run counter-clockwise seen from outside, and parts beside one another"
            )
        # `around` has only the windings of other meshes now.
        nesting = [other for other, winding in around.items() if winding]
        if nesting:
            raise InputError(
                f"the medium of shape '{mesh.name}' lies within that of shape "
                f"'{meshes[nesting[0]].name}', at "
                f"{mesh.edge_words(tail, head)}; expected media beside one another, none nested"
            )


def _parts(mesh: ClosedMesh) -> list[tuple[int, Array, bool]]:
    """Return the connected parts of a mesh: of each the number of one triangle, the corners of
    its triangles, (triangles, 3, 3) [m], and whether these face outwards.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Two vertices are connected if an edge of a triangle joins them.
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    graph = coo_array(
        (np.ones(len(tail), dtype=np.int8), (tail, head)), shape=(len(mesh.vertices),) * 2
    )
    _, component = connected_components(graph, directed=False)
    of_face = component[mesh.faces[:, 0]]
    parts = []
    for each in np.unique(of_face):
        triangles = np.flatnonzero(of_face == each)
        corners = mesh.corners[triangles]
        # Six times the signed volume, about the mean of the corners, where the sum loses fewest
        # digits. It is positive for faces that run counter-clockwise seen from outside.
        local = corners - corners.mean(axis=(0, 1))
        volume = np.einsum("ij,ij->", local[:, 0], np.cross(local[:, 1], local[:, 2]))
        parts.append((int(triangles[0]), corners, bool(volume > 0)))
    return parts


def _check_crossings(meshes: Mapping[int, ClosedMesh], boundary: mi.Scene) -> None:
    """Refuse meshes with an edge that passes through a triangle that it does not touch.

    `meshes`: by the numbers of their shapes in the Mitsuba scene `boundary`. Mitsuba finds
    the triangles, in float32; the crossing is computed again in float64.
    """
    for mesh in meshes.values():
        tail, head = _edges(mesh)
        begin, end = mesh.vertices[tail], mesh.vertices[head]
        # Candidates come from Mitsuba's float32 rays along the edges; each is decided in float64.
        met, triangle, edge = _met_triangles(boundary, begin, end)
        for number in np.unique(met).tolist():
            against, pairs = meshes[number], np.flatnonzero(met == number)
            at = _piercing(against.corners[triangle[pairs]], begin[edge[pairs]], end[edge[pairs]])
            # An edge meets the triangles at its own ends; they share a vertex and do not cross.
            if against is mesh:
                shared = (
                    mesh.faces[triangle[pairs]][:, :, None]
                    == np.stack([tail, head], 1)[edge[pairs]][:, None]
                )
                at &= ~shared.any(axis=(1, 2))
            if not at.any():
                continue
            first = pairs[int(np.argmax(at))]
            words = mesh.edge_words(tail[edge[first]], head[edge[first]])
            if against is mesh:
                raise InputError(
                    f"shape '{mesh.name}' bounds a medium and crosses itself: {words} passes "
                    "through triangle "
                    f"{triangle[first]}; expected a mesh without crossings"
                )
            raise InputError(
                f"the media of shapes '{mesh.name}' and '{against.name}' overlap: {words} of the "
                "first passes "
                f"through triangle {triangle[first]} of the other; expected disjoint bounds"
            )


def _edges(mesh: ClosedMesh) -> tuple[Index, Index]:
    """Return the numbers of the two vertices of every edge, each edge once."""
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    return tail[tail < head], head[tail < head]


def _met_triangles(boundary: mi.Scene, begin: Array, end: Array) -> tuple[Index, Index, Index]:
    """Return the numbers of the shapes and of the triangles that edges meet, and of the edges,
    (hits,) each.

    `begin`, `end`: of the edges, (edges, 3) each [m].
    """
    length = np.linalg.norm(end - begin, axis=1)
    unit = (end - begin) / length[:, None]
    shapes, triangles, edges = ([np.zeros(0, dtype=np.int64)] for _ in range(3))
    active, past = np.arange(len(begin)), np.zeros(len(begin))
    # Triangles at the corners of an edge may hide what lies behind them: the edge is cast
    # on from there to its end.
    while len(active):
        start = begin[active] + unit[active] * past[active, None]
        ray = mi.Ray3f(
            mi.Point3f(*(aligned_array(mi.Float, column) for column in start.T)),
            mi.Vector3f(*(aligned_array(mi.Float, column) for column in unit[active].T)),
            aligned_array(mi.Float, length[active] - past[active]),
            0.0,
            [],
        )
        hit = boundary.ray_intersect_preliminary(ray)
        dr.eval(hit)
        valid = np.isfinite(np.array(hit.t))
        shapes.append(np.array(dr.reinterpret_array(mi.UInt32, hit.shape))[valid])
        triangles.append(np.array(hit.prim_index)[valid].astype(np.int64))
        active = active[valid]
        edges.append(active)
        # The next ray starts a little beyond the hit, by 1e-5 of the edge, so that it does not find
        # the same triangle again.
        past[active] += np.array(hit.t, dtype=np.float64)[valid] + 1e-5 * length[active]
        active = active[past[active] < length[active]]
    return np.concatenate(shapes), np.concatenate(triangles), np.concatenate(edges)


def _piercing(corners: Array, begin: Array, end: Array) -> Bools:
    """Return which segments pass through the inside of triangles, (n,), by Moeller and
    Trumbore's weights in float64.

    `corners`: of a triangle for each segment, (n, 3, 3) [m]; `begin`, `end`: (n, 3) each [m].
    """
    # Solve begin + fraction along = corner + u first + v second by Cramer's rule; the weights of
    # the corners are 1 - u - v, u, v. A segment in the plane has no determinant and pierces
    # nothing.
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    along, offset = end - begin, begin - corners[:, 0]
    across = np.cross(along, second)
    determinant = np.einsum("ij,ij->i", first, across)
    inverse = np.divide(
        1.0, determinant, out=np.full_like(determinant, np.inf), where=determinant != 0
    )
    with np.errstate(invalid="ignore"):
        u = np.einsum("ij,ij->i", offset, across) * inverse
        turned = np.cross(offset, first)
        v = np.einsum("ij,ij->i", along, turned) * inverse
        fraction = np.einsum("ij,ij->i", second, turned) * inverse
        weights = np.stack([u, v, 1 - u - v, fraction, 1 - fraction])
        # As a fraction of the edge's length and of the weights of a corner: a crossing nearer to an
        # end than this only touches.
        side = 1e-6
        return np.all(weights > side, axis=0) & np.isfinite(inverse)
