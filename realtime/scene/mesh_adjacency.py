# SPDX-License-Identifier: BSD-3-Clause
"""Occluders: the triangles of a scene and how they hang together.

Adjacency is computed once; when a light moves only signs change (`realtime.methods.shadow_planes.silhouettes`), when
an object moves only its vertices (`with_positions`).

Vertices that coincide exactly are one vertex: meshes come with seams where texture coordinates differ. An edge is met
by *half-edges*, one for each triangle at it, each with a direction. Half-edges of an edge are paired, opposite ones
first, and each pair is one entry of `Occluders.edges`; one that finds no partner is an entry whose second triangle is
`Occluders.none`. A manifold edge is therefore one entry, a border edge is one entry with a single triangle, and an edge
at which four triangles meet is two entries, whose sum does not depend on the pairing.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.realtime.area_lights.shape import AreaLight, occluder_triangles, occluder_vertices
from airlight.realtime.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int32]


@dataclass(frozen=True)
class Occluders:
    """Triangles that cast shadows, with their adjacency."""

    vertices: Array  #: positions [m], (vertices, 3)
    triangles: Index  #: vertex numbers, (triangles, 3)
    normals: Array  #: (v1 - v0) x (v2 - v0) [m^2], (triangles, 3)
    offsets: Array  #: normal . v0 [m^3], (triangles,)
    edges: Index  #: vertex numbers of the entries, (entries, 2)
    left: Index  #: triangle that runs along the entry from its first vertex to its second
    right: Index  #: the other triangle, or `none`
    same_way: NDArray[np.bool_]  #: whether `right` runs along the entry in the same direction as `left`
    component: Index  #: connected component that each triangle belongs to
    closed: NDArray[np.bool_]  #: by component: whether every edge is met as often one way as the other
    boxes: Array  #: by component: lower and upper corner of its bounding box [m], (components, 2, 3)
    shapes: tuple[tuple[str, int, Index], ...]  #: name, its first vertex, and which of the shape's own each one is
    owner: NDArray[np.int64]  #: by component: the number of its shape
    warnings: tuple[str, ...] = ()  #: what is odd about the meshes, by name

    @property
    def none(self) -> int:
        """The number that stands for no triangle."""
        return len(self.triangles)

    def of_shape(self, name: str) -> NDArray[np.bool_]:
        """Return which components are of a shape."""
        return np.isin(self.owner, [number for number, (own, _, _) in enumerate(self.shapes) if own == name])


def read_occluders(scene, area_lights: Sequence[AreaLight] = ()) -> Occluders:
    """Read the triangles of a Mitsuba scene.

    `scene`: an `mi.Scene`; shapes whose surface lets light pass (`null`) cast no shadow; `area_lights`: its lights with
    extent: those that are opaque have triangles even where their shapes have none. Raises InputError for a shape that
    has no triangles, with its name.
    """
    known = {light.name: light for light in area_lights}
    meshes = []
    for shape in scene.shapes():
        if shape.is_emitter() and shape.id() in known:
            light = known[shape.id()]
            meshes.append((light.name, occluder_vertices(light), occluder_triangles(light)))
            continue
        if shape.bsdf() is not None and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null):
            continue
        meshes.append((shape.id(), *_triangles(shape)))
    return make_occluders(meshes)


def make_occluders(meshes) -> Occluders:
    """Return the occluders of meshes.

    `meshes`: (name, vertices (n, 3) [m], triangles (m, 3)) each. Triangles with a vertex twice and repeated ones are
    left out, the latter with a warning.
    """
    parts, warnings, shapes, first_vertex, first_component = [], [], [], 0, 0
    for name, vertices, triangles in meshes:
        part, remarks, own = _mesh_part(name, vertices, triangles)
        shapes.append((name, first_vertex, own))
        parts.append(_shifted(part, first_vertex, first_component))
        first_vertex += len(part["vertices"])
        first_component += len(part["closed"])
        warnings += remarks
    if not parts:
        parts = [_mesh_part("none", np.zeros((0, 3)), np.zeros((0, 3), dtype=int))[0]]
    first_triangle = np.cumsum([0] + [len(part["triangles"]) for part in parts])
    for part, first in zip(parts, first_triangle):
        count = len(part["triangles"])
        for side in ("left", "right"):
            part[side] = np.where(part[side] == count, first_triangle[-1], part[side] + first)
    joined: dict[str, Any] = {key: np.concatenate([part[key] for part in parts]) for key in parts[0]}
    for key in ("triangles", "edges", "left", "right", "component"):
        joined[key] = np.ascontiguousarray(joined[key], dtype=np.int32)
    owner = np.repeat(np.arange(len(parts)), [len(part["closed"]) for part in parts])
    return Occluders(
        **joined,
        shapes=tuple(shapes),
        owner=owner,
        warnings=tuple(warnings),
    )


def with_positions(occluders: Occluders, positions: Mapping[str, Array]) -> Occluders:
    """Return the occluders with the vertices of some shapes elsewhere; `positions` are those of the shapes [m]."""
    if not positions:
        return occluders
    vertices = occluders.vertices.copy()
    for name, first, own in occluders.shapes:
        if name in positions:
            vertices[first : first + len(own)] = positions[name][own]
    normals, offsets = _planes(vertices, occluders.triangles)
    boxes = _boxes(vertices, occluders.triangles, occluders.component, len(occluders.closed))
    return replace(occluders, vertices=vertices, normals=normals, offsets=offsets, boxes=boxes)


def mesh_triangles(mesh) -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices [m] and the triangles of a Mitsuba mesh, (vertices, 3) and (triangles, 3)."""
    # Ask for vertices one by one: `mi.traverse` shows the transform of a rectangle or a cube, not its vertices.
    position = mesh.vertex_position(dr.arange(mi.UInt32, mesh.vertex_count()))
    face = mesh.face_indices(dr.arange(mi.UInt32, mesh.face_count()))
    dr.eval(position, face)
    return (
        np.stack([np.array(part, dtype=np.float64) for part in position], axis=1),
        np.stack([np.array(part, dtype=np.int64) for part in face], axis=1),
    )


def _triangles(shape) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and triangles of a Mitsuba shape."""
    if shape.is_mesh():
        return mesh_triangles(shape)
    raise InputError(
        f"shape '{shape.id()}' is a {shape.class_name().lower()}, which has no triangles and so no silhouette edges; "
        "expected meshes (obj, ply, cube, rectangle); replace it by a mesh, or use --method ray-march"
    )


def _mesh_part(name: str, vertices: Array, triangles: NDArray[Any]) -> tuple[dict[str, Any], list[str], Index]:
    warnings = []
    vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
    vertices, own, inverse = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    triangles = inverse.reshape(-1)[np.asarray(triangles, dtype=np.int64).reshape(-1, 3)]
    # A triangle that is a line stays: it closes the gap between a long edge and the two halves on its other side.
    triangles = triangles[np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)]
    _, kept = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    if len(kept) < len(triangles):
        warnings.append(f"shape '{name}' has {len(triangles) - len(kept)} repeated triangles: each is used once")
        triangles = triangles[np.sort(kept)]
    normals, offsets = _planes(vertices, triangles)
    edges, left, right, same_way, met = _paired_edges(triangles)
    component, closed = _connected_components(triangles, edges, (left, right, same_way))
    if np.any(met > 2):
        warnings.append(
            f"shape '{name}' has {int(np.sum(met > 2))} edges at which more than two triangles meet: right with "
            "order=exact; order=none and order=paper may count planes twice"
        )
    if np.any(right == len(triangles)):
        warnings.append(
            f"shape '{name}' is open: its border casts shadow planes too; right with order=exact; order=none and "
            "order=paper count its folds twice"
        )
    elif not np.all(closed):
        warnings.append(
            f"shape '{name}' has triangles that run both ways round: each is turned to the light; right with "
            "order=exact; order=none and order=paper count its folds twice"
        )
    part = {
        "vertices": vertices,
        "triangles": triangles,
        "normals": normals,
        "offsets": offsets,
        "edges": edges,
        "left": left,
        "right": right,
        "same_way": same_way,
        "component": component,
        "closed": closed,
        "boxes": _boxes(vertices, triangles, component, len(closed)),
    }
    return part, warnings, own.astype(np.int32)


def _shifted(part: dict[str, Any], vertex: int, component: int) -> dict[str, Any]:
    return part | {
        "triangles": part["triangles"] + vertex,
        "edges": part["edges"] + vertex,
        "component": part["component"] + component,
    }


def _planes(vertices: Array, triangles) -> tuple[Array, Array]:
    """Return normals and offsets of triangles."""
    first, second, third = (vertices[corner] for corner in triangles.T)
    ax, ay, az = (second - first).T
    bx, by, bz = (third - first).T  # `np.cross` takes three times as long
    normals = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
    return normals, np.einsum("ij,ij->i", normals, first)


def _boxes(vertices: Array, triangles, component, components: int) -> Array:
    order = np.argsort(component, kind="stable")
    starts = np.searchsorted(component[order], np.arange(components))
    corners = vertices[triangles[order]]
    if not components:
        return np.zeros((0, 2, 3))
    low, high = np.minimum.reduceat(corners.min(axis=1), starts), np.maximum.reduceat(corners.max(axis=1), starts)
    return np.stack([low, high], axis=1)


def _paired_edges(triangles: NDArray[Any]):
    """Pair the half-edges of every edge, opposite directions first.

    Sorted by edge, then by direction, the half-edges of an edge are a run of `forward` ones followed by `backward`
    ones. The first min(forward, backward) of both are partners; the rest are of one direction and pair up among
    themselves.
    """
    count = len(triangles)
    tail = triangles.reshape(-1)
    head = np.roll(triangles, -1, axis=1).reshape(-1)
    triangle = np.repeat(np.arange(count), 3)
    backward = tail > head
    low, high = np.minimum(tail, head), np.maximum(tail, head)
    order = np.lexsort((backward, high, low))
    low, high, backward, triangle = low[order], high[order], backward[order], triangle[order]
    starts = np.flatnonzero(np.r_[True, (low[1:] != low[:-1]) | (high[1:] != high[:-1])][: len(low)])
    met = np.diff(np.r_[starts, len(low)])
    forward_count = np.add.reduceat((~backward).astype(int), starts) if len(starts) else np.zeros(0, dtype=int)
    matched = np.minimum(forward_count, met - forward_count)
    rank = np.arange(len(low)) - np.repeat(starts, met)
    in_direction = np.where(backward, rank - np.repeat(forward_count, met), rank)
    rest = in_direction - np.repeat(matched, met)
    is_left = np.where(rest < 0, ~backward, rest % 2 == 0)
    # Keys that partners share: the edge, whether they are matched, and the rank among their likes.
    first = np.flatnonzero(is_left)
    partner = np.where(
        rest[first] < 0,
        np.repeat(starts + forward_count, met)[first] + in_direction[first],
        first + 1,
    )
    run_end = np.repeat(starts + met, met)[first]
    same_direction = (partner < run_end) & (backward[np.minimum(partner, len(low) - 1)] == backward[first])
    alone = (rest[first] >= 0) & ~same_direction
    right = np.where(alone, count, triangle[np.minimum(partner, len(low) - 1)]) if len(first) else first
    tail_vertex = np.where(backward[first], high[first], low[first])
    head_vertex = np.where(backward[first], low[first], high[first])
    edges = np.stack([tail_vertex, head_vertex], axis=1)
    return edges, triangle[first], right, (rest[first] >= 0) & ~alone, met


def _connected_components(triangles, edges, entries):
    """Return the connected component of every triangle, and by component whether it is closed."""
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    left, right, same_way = entries
    count = len(triangles)
    if not count:
        return np.zeros(0, dtype=int), np.zeros(0, dtype=bool)
    # Triangles that share an edge, however many meet there.
    both = right < count
    links = [(left[both], right[both])]
    order = np.lexsort((edges.max(axis=1), edges.min(axis=1)))
    key = np.sort(edges[order], axis=1)
    again = np.flatnonzero(np.all(key[1:] == key[:-1], axis=1))
    links.append((left[order[again]], left[order[again + 1]]))
    first, second = (np.concatenate([link[side] for link in links]) for side in (0, 1))
    graph = coo_array((np.ones(len(first), dtype=np.int8), (first, second)), shape=(count, count))
    components, component = connected_components(graph, directed=False)
    closed = np.ones(components, dtype=bool)
    closed[component[left[~both | same_way]]] = False
    return component, closed


def scene_of(shapes: Sequence[Any], others: dict[str, Any] | None = None) -> Any:
    """Return a Mitsuba scene of shapes, all of which keep their names; `others` is what else is in its dictionary."""
    names = [shape.id() for shape in shapes]
    # A key of Mitsuba's dictionaries becomes the name of the shape, may hold no dots, and of two shapes with one key
    # the last alone is left: so keys are numbers, and the shapes get their names back.
    parts = {f"shape-{number}": shape for number, shape in enumerate(shapes)}
    scene = mi.load_dict({"type": "scene"} | (others or {}) | parts)
    for shape, name in zip(shapes, names, strict=True):
        shape.set_id(name)
    return scene
