# SPDX-License-Identifier: BSD-3-Clause
"""Shadow casters: the triangles of a scene and how they hang together.

Adjacency is computed once; when a light moves only signs change (`realtime.methods.shadow_planes.silhouettes`), when
an object moves only its vertices (`moved`).

Vertices that coincide exactly are one vertex: meshes come with seams where texture coordinates differ. An edge is met
by *half-edges*, one for each triangle at it, each with a direction. Half-edges of an edge are paired, opposite ones
first, and each pair is one entry of `Casters.edges`; one that finds no partner is an entry whose second triangle is
`Casters.none`. So a manifold edge is one entry, a border edge one with a single triangle, and an edge at which four
triangles meet two entries: their sum is the same whichever way they are paired.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from realtime.area_lights.caster import caster_triangles, caster_vertices
from realtime.area_lights.shape import AreaLight
from realtime.errors import InputError

Array = NDArray[np.float64]
Index = NDArray[np.int32]


@dataclass(frozen=True)
class Placement:
    """Where a shape that moved as a whole stands: a point p of it as it was is at `rotation` p + `shift`."""

    rotation: Array  #: (3, 3)
    shift: Array  #: [m], (3,)
    start: NDArray[np.float32]  #: its vertices before, as Mitsuba had them [m], (vertices, 3)

    def seen(self, point: Array, w: int = 1) -> Array:
        """Return a place (w = 1) or direction (w = 0) as the shape's own space has it."""
        return (point - w * self.shift) @ self.rotation

    def positions(self, vertices: Any = slice(None)) -> Array:
        """Return where some of its vertices are, all by default, rounded to float32 as Mitsuba holds them [m]."""
        # Sums and no product of matrices: a vertex is at the same place, bit for bit, whichever others are asked for.
        x, y, z = np.moveaxis(self.start[vertices].astype(np.float64), -1, 0)[..., None]
        there = x * self.rotation[:, 0] + y * self.rotation[:, 1] + z * self.rotation[:, 2] + self.shift
        return there.astype(np.float32).astype(np.float64)


@dataclass(frozen=True)
class _Placed:
    """A shape of casters that stands elsewhere."""

    placement: Placement
    own: Index  #: which of the shape's own vertices each vertex of the casters is


@dataclass(frozen=True)
class Casters:
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
    first_triangles: NDArray[np.int64]  #: of every shape, and the end of the last
    owner: NDArray[np.int64]  #: by component: the number of its shape
    warnings: tuple[str, ...] = ()  #: what is odd about the meshes, by name
    read: tuple[NDArray[np.float32], ...] = ()  #: by shape, its own vertices as they were read [m]
    placed: Mapping[int, _Placed] = field(default_factory=dict)  #: by number, shapes that stand elsewhere as a whole

    @property
    def none(self) -> int:
        """The number that stands for no triangle."""
        return len(self.triangles)

    def positions_of(self, vertices: NDArray[Any]) -> Array:
        """Return where some vertices are [m], (..., 3)."""
        here = self.vertices[vertices]
        for number, placed in self.placed.items():
            first = self.shapes[number][1]
            own = (vertices >= first) & (vertices < first + len(placed.own))
            here[own] = placed.placement.positions(placed.own[vertices[own] - first])
        return here

    def planes_of(self, triangles: NDArray[Any]) -> tuple[Array, Array]:
        """Return normals [m^2], (n, 3), and offsets [m^3], (n,), of some triangles where they are."""
        if not self.placed:
            return self.normals[triangles], self.offsets[triangles]
        return _planes_at(self.positions_of(self.triangles[triangles]))

    def vertices_by_space(self) -> list[tuple[slice, Placement | None]]:
        """Return all vertices in runs of one space, and where what is in it stands; None: where it was read."""
        return self._by_space([*(first for _, first, _ in self.shapes), len(self.vertices)])

    def triangles_by_space(self) -> list[tuple[slice, Placement | None]]:
        """Return all triangles in such runs."""
        return self._by_space(self.first_triangles)

    def _by_space(self, firsts) -> list[tuple[slice, Placement | None]]:
        """Return runs of what of every shape begins at `firsts`, which has the end of the last too."""
        runs: list[tuple[slice, Placement | None]] = []
        begin = 0
        for number in sorted(self.placed):
            runs += [(slice(begin, firsts[number]), None)]
            begin = firsts[number + 1]
            runs += [(slice(firsts[number], begin), self.placed[number].placement)]
        return [*runs, (slice(begin, firsts[-1]), None)]

    def of_shape(self, name: str) -> NDArray[np.bool_]:
        """Return which components are of a shape."""
        return np.isin(self.owner, [number for number, (own, _, _) in enumerate(self.shapes) if own == name])


def read_casters(scene, area_lights: Sequence[AreaLight] = ()) -> Casters:
    """Read the triangles of a Mitsuba scene.

    Parameters
    ----------
    scene
        An `mi.Scene`; shapes whose surface lets light pass (`null`) cast no shadow.
    area_lights
        Its lights with extent: those that are opaque have triangles even where their shapes have none.

    Raises
    ------
    InputError
        For a shape that has no triangles, with its name.
    """
    known = {light.name: light for light in area_lights}
    meshes = []
    for shape in scene.shapes():
        if shape.is_emitter() and shape.id() in known:
            light = known[shape.id()]
            meshes.append((light.name, caster_vertices(light), caster_triangles(light)))
            continue
        if shape.bsdf() is not None and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null):
            continue
        meshes.append((shape.id(), *_triangles(shape)))
    return make_casters(meshes)


def make_casters(meshes) -> Casters:
    """Return the casters of meshes.

    Parameters
    ----------
    meshes
        (name, vertices (n, 3) [m], triangles (m, 3)) each. Triangles with a vertex twice and repeated ones are left
        out, the latter with a warning.
    """
    parts, warnings, shapes, read, first_vertex, first_component = [], [], [], [], 0, 0
    for name, vertices, triangles in meshes:
        part, remarks, own = _mesh_part(name, vertices, triangles)
        shapes.append((name, first_vertex, own))
        read.append(np.asarray(vertices, dtype=np.float32))
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
    return Casters(
        **joined,
        shapes=tuple(shapes),
        first_triangles=first_triangle,
        owner=owner,
        warnings=tuple(warnings),
        read=tuple(read),
    )


def moved(casters: Casters, vertices: Array) -> Casters:
    """Return the casters with their vertices elsewhere; adjacency stays."""
    normals, offsets = _planes(vertices, casters.triangles)
    boxes = _boxes(vertices, casters.triangles, casters.component, len(casters.closed))
    return replace(casters, vertices=vertices, normals=normals, offsets=offsets, boxes=boxes)


def with_positions(casters: Casters, positions: Mapping[str, Array]) -> Casters:
    """Return the casters with the vertices of some shapes elsewhere; `positions` are those of the shapes [m]."""
    if not positions:
        return casters
    vertices = casters.vertices.copy()
    for name, first, own in casters.shapes:
        if name in positions:
            vertices[first : first + len(own)] = positions[name][own]
    return moved(casters, vertices)


def mesh_triangles(mesh) -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices [m] and the triangles of a Mitsuba mesh, (vertices, 3) and (triangles, 3)."""
    # Ask for vertices one by one: `mi.traverse` shows the transform of a rectangle or a cube, not its vertices.
    position = mesh.vertex_position(dr.arange(mi.UInt32, mesh.vertex_count()))
    face = mesh.face_indices(dr.arange(mi.UInt32, mesh.face_count()))
    return np.array(position, dtype=np.float64).T.copy(), np.array(face, dtype=np.int64).T.copy()


def with_placements(casters: Casters, positions: Mapping[str, Array], placements: Mapping[str, Placement]) -> Casters:
    """Return what `with_positions` does, with no work on the triangles of shapes that moved as a whole.

    Their vertices, normals and offsets stay those of the space in which the shapes were read; what of casters takes a
    place asks for that, and vertices move where they are asked for. A shape with positions, or with a placement from
    another start than what was read, moves vertex by vertex.
    """
    if not positions and not placements:
        return casters
    placed: dict[int, _Placed] = {}
    others: dict[str, Array] = {}
    boxes = casters.boxes.copy()
    for number, (name, _, own) in enumerate(casters.shapes):
        placement = placements.get(name)
        if placement is None:
            if name in positions:
                others[name] = positions[name]
            continue
        if not np.array_equal(placement.start, casters.read[number]):
            others[name] = placement.positions()
            continue
        placed[number] = _Placed(placement, own)
        boxes[casters.owner == number] = _turned_boxes(boxes[casters.owner == number], placement)
    standing = with_positions(casters, others)
    if others:
        moved_otherwise = ~np.isin(casters.owner, list(placed))
        boxes[moved_otherwise] = standing.boxes[moved_otherwise]
    return replace(standing, boxes=boxes, placed=placed)


def _turned_boxes(boxes: Array, placement: Placement) -> Array:
    """Return boxes about turned boxes, (boxes, 2, 3)."""
    middle, half = boxes.mean(axis=1) @ placement.rotation.T + placement.shift, 0.5 * (boxes[:, 1] - boxes[:, 0])
    reach = half @ np.abs(placement.rotation).T * (1 + 1e-6)  # vertices are rounded to float32
    return np.stack([middle - reach, middle + reach], axis=1)


def _triangles(shape) -> tuple[Array, NDArray[np.int64]]:
    """Return vertices and triangles of a Mitsuba shape."""
    if shape.is_mesh():
        return mesh_triangles(shape)
    raise InputError(
        f"shape '{shape.id()}' is a {shape.class_name()}, which has no triangles and so no silhouette edges; wanted "
        "meshes (obj, ply, cube, rectangle); replace it by a mesh, or use --method ray-march"
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
    return _planes_at(vertices[triangles])


def _planes_at(corner: Array) -> tuple[Array, Array]:
    """Return normals and offsets of triangles with corners (triangles, 3, 3)."""
    normals = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    return normals, np.einsum("ij,ij->i", normals, corner[:, 0])


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
