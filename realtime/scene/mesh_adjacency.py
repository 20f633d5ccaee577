# SPDX-License-Identifier: BSD-3-Clause
"""Occluders: the triangles of a scene and how they hang together.

Vertices of a shape that coincide exactly are one vertex: meshes come with seams where texture
coordinates differ. How triangles hang together is the signed incidence matrix of edges and
triangles: with an edge e from its lower vertex number a to its higher one b, and a triangle t,

    s_te = +1 if t runs along e from a to b, -1 if it runs from b to a, 0 if e is no edge of t.

Its product with the layers of triangles gives silhouettes
(`realtime.methods.shadow_planes.silhouettes`). Triangles are of one component if they share an
edge. A component is closed if each of its edges is met as often one way as the other: if the sum of
s_te over the triangles is 0.

The matrix is made once; when a light moves only signs of triangles change, when an object moves
only its vertices (`with_positions`).
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.area_lights.shape import (
    AreaLight,
    occluder_triangles,
    occluder_vertices,
)

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Array = NDArray[np.float64]
Index = NDArray[np.int32]


@dataclass(frozen=True)
class Occluders:
    """Triangles that cast shadows, with their adjacency."""

    vertices: Array  #: positions [m], (vertices, 3)
    triangles: Index  #: vertex numbers, (triangles, 3)
    normals: Array  #: (v1 - v0) x (v2 - v0) [m^2], (triangles, 3)
    offsets: Array  #: normal . v0 [m^3], (triangles,)
    edges: Index  #: vertex numbers, the lower one first, (edges, 2)
    incidence: "csr_array[np.int32]"  #: s_te, (edges, triangles)
    component: Index  #: connected component that each triangle belongs to
    #: by component: whether every edge is met as often one way as the other
    closed: NDArray[np.bool_]
    #: by component: lower and upper corner of its bounding box [m], (components, 2, 3)
    boxes: Array
    shapes: tuple[str, ...]  #: names
    vertex_shape: Index  #: by vertex: the number of its shape
    #: by vertex: its number among the vertices of its shape, the first of equal ones
    vertex_source: Index
    warnings: tuple[str, ...] = ()  #: what is odd about the meshes, by name

    @property
    def component_shape(self) -> Index:
        """By component: the number of its shape."""
        _, triangle = np.unique(self.component, return_index=True)
        return self.vertex_shape[self.triangles[triangle, 0]]

    def of_shape(self, name: str) -> NDArray[np.bool_]:
        """Return which components are of the shapes of a name."""
        return np.array([shape == name for shape in self.shapes])[self.component_shape]


def read_occluders(scene, area_lights: Sequence[AreaLight] = ()) -> Occluders:
    """Read the triangles of a Mitsuba scene.

    Parameters
    ----------
    scene
        An `mi.Scene`; shapes whose surface lets light pass (`null`) cast no shadow.
    area_lights
        Its area lights: opaque ones have triangles even where their shapes have none.

    Raises
    ------
    InputError
        For a shape that has no triangles, with its name.
    """
    # Area lights say their triangles themselves; boundaries of media cast no shadow.
    lights = {light.name: light for light in area_lights}
    meshes = []
    for shape in scene.shapes():
        if shape.is_emitter() and shape.id() in lights:
            light = lights[shape.id()]
            meshes.append((light.name, occluder_vertices(light), occluder_triangles(light)))
            continue
        if shape.bsdf() is not None and mi.has_flag(shape.bsdf().flags(), mi.BSDFFlags.Null):
            continue
        meshes.append((shape.id(), *_triangles(shape)))
    return make_occluders(meshes)


def make_occluders(meshes: Sequence[tuple[str, Array, NDArray[Any]]]) -> Occluders:
    """Return the occluders of meshes.

    Triangles with a vertex twice and repeated ones are left out, the latter with a warning.

    Parameters
    ----------
    meshes
        By mesh its name, its vertices (n, 3) [m] and the vertex numbers of its triangles (m, 3).
    """
    names = tuple(name for name, _, _ in meshes)
    vertices, vertex_shape, vertex_source, triangles = _joined(meshes)

    # A triangle that is a line stays: it closes the gap between a long edge and the two
    # halves on its other side.
    triangles = triangles[np.all(triangles != np.roll(triangles, 1, axis=1), axis=1)]
    _, first = np.unique(np.sort(triangles, axis=1), axis=0, return_index=True)
    repeated = np.delete(vertex_shape[triangles[:, 0]], first)
    triangles = triangles[np.sort(first)]

    # How triangles hang together stays when shapes move; planes and boxes follow the vertices.
    edges, incidence, component, closed = _hang_together(triangles, len(vertices))
    normals, offsets = _planes(vertices, triangles)
    occluders = Occluders(
        vertices=vertices,
        triangles=triangles,
        normals=normals,
        offsets=offsets,
        edges=edges,
        incidence=incidence,
        component=component,
        closed=closed,
        boxes=_boxes(vertices, triangles, component, len(closed)),
        shapes=names,
        vertex_shape=vertex_shape,
        vertex_source=vertex_source,
    )
    return replace(occluders, warnings=_warnings(occluders, repeated))


def with_positions(occluders: Occluders, positions: Mapping[str, Array]) -> Occluders:
    """Return the occluders with the vertices of some shapes elsewhere.

    Parameters
    ----------
    positions
        By name of a shape, all of its vertices (n, 3) [m].
    """
    if not positions:
        return occluders
    vertices = occluders.vertices.copy()
    for number, name in enumerate(occluders.shapes):
        if name in positions:
            moved = occluders.vertex_shape == number
            vertices[moved] = positions[name][occluders.vertex_source[moved]]
    # How triangles hang together stays: only planes and boxes are of the new places.
    normals, offsets = _planes(vertices, occluders.triangles)
    boxes = _boxes(vertices, occluders.triangles, occluders.component, len(occluders.closed))
    return replace(occluders, vertices=vertices, normals=normals, offsets=offsets, boxes=boxes)


def mesh_triangles(mesh) -> tuple[Array, NDArray[np.int64]]:
    """Return the vertices [m] and the triangles of a Mitsuba mesh,
    (vertices, 3) and (triangles, 3).
    """
    # Ask for vertices one by one: `mi.traverse` shows the transform of a rectangle or
    # a cube, not its vertices.
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
        f"shape '{shape.id()}' is a {shape.class_name().lower()}, which has no triangles and so no "
        "silhouette edges; "
        "expected meshes (obj, ply, cube, rectangle); replace it by a mesh, or use --method "
        "ray-march"
    )


def _joined(meshes) -> tuple[Array, Index, Index, Index]:
    """Return the vertices of all meshes, equal ones of a mesh once, the shape and source of
    each, and the triangles.
    """
    places, triangles, count = [np.zeros((0, 4))], [np.zeros((0, 3), dtype=np.int64)], 0
    sources = [np.zeros(0, dtype=np.int64)]
    for number, (_, vertices, faces) in enumerate(meshes):
        vertices = np.asarray(vertices, dtype=np.float64).reshape(-1, 3)
        places.append(np.insert(vertices, 0, number, axis=1))
        sources.append(np.arange(len(vertices)))
        triangles.append(np.asarray(faces, dtype=np.int64).reshape(-1, 3) + count)
        count += len(vertices)
    # The number of the shape keeps vertices of different shapes apart.
    joined, first, number_of = np.unique(
        np.concatenate(places), axis=0, return_index=True, return_inverse=True
    )
    return (
        np.ascontiguousarray(joined[:, 1:]),
        joined[:, 0].astype(np.int32),
        np.concatenate(sources)[first].astype(np.int32),
        number_of.reshape(-1)[np.concatenate(triangles)].astype(np.int32),
    )


def _hang_together(
    triangles: Index, vertices: int
) -> tuple[Index, "csr_array[np.int32]", Index, NDArray[np.bool_]]:
    """Return the edges of triangles, their incidence matrix, the component of each
    triangle, and which are closed.
    """
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import connected_components

    # Each triangle has three half-edges, and those between the same two vertices are one edge.
    tail, head = triangles.ravel().astype(np.int64), np.roll(triangles, -1, axis=1).ravel()
    keys, edge = np.unique(
        np.minimum(tail, head) * vertices + np.maximum(tail, head), return_inverse=True
    )
    edges = np.stack(np.divmod(keys, max(vertices, 1)), axis=1).astype(np.int32)
    triangle = np.repeat(np.arange(len(triangles)), 3)
    sign = np.where(tail < head, np.int32(1), np.int32(-1))
    shape = len(edges), len(triangles)
    incidence = coo_array((sign, (edge, triangle)), shape=shape).tocsr()

    # A graph in which each triangle is linked to its three edges has the
    # components of the triangles.
    nodes = sum(shape)
    links = coo_array(
        (np.ones(len(edge), dtype=np.int8), (triangle, edge + len(triangles))), shape=(nodes, nodes)
    )
    count, component = (
        connected_components(links, directed=False) if nodes else (0, np.zeros(0, dtype=np.int32))
    )
    component = component[: len(triangles)]
    # A row sum of the matrix that is not 0 is an edge that is met more often one way than the
    # other: it opens the component of its triangles.
    closed = np.ones(count, dtype=bool)
    closed[component[triangle[incidence.sum(axis=1)[edge] != 0]]] = False
    return edges, incidence, component, closed


def _warnings(occluders: Occluders, repeated: Index) -> tuple[str, ...]:
    """Return what is odd about the meshes; `repeated`: by triangle that was left out,
    the number of its shape.
    """
    warnings = []
    # By edge how many triangles meet there, whichever way they run.
    meeting = abs(occluders.incidence).sum(axis=1)
    edge_shape, component_shape = (
        occluders.vertex_shape[occluders.edges[:, 0]],
        occluders.component_shape,
    )
    for number, name in enumerate(occluders.shapes):
        met = meeting[edge_shape == number]
        if copies := np.count_nonzero(repeated == number):
            warnings.append(f"shape '{name}' has {copies} repeated triangles: each is used once")
        if crowded := np.count_nonzero(met > 2):
            warnings.append(
                f"shape '{name}' has {crowded} edges at which more than two triangles meet: right "
                "with "
                "order=exact; order=none and order=paper may count planes twice"
            )
        # With an odd number of triangles at an edge one of them ends there.
        if np.any(met % 2 == 1):
            warnings.append(
                f"shape '{name}' is open: its border casts shadow planes too; right with "
                "order=exact; order=none and "
                "order=paper count its folds twice"
            )
        elif not np.all(occluders.closed[component_shape == number]):
            warnings.append(
                f"shape '{name}' has triangles that run both ways round: each is turned to the "
                "light; right with "
                "order=exact; order=none and order=paper count its folds twice"
            )
    return tuple(warnings)


def _planes(vertices: Array, triangles) -> tuple[Array, Array]:
    """Return normals and offsets of triangles."""
    first, second, third = (vertices[corner] for corner in triangles.T)
    ax, ay, az = (second - first).T
    bx, by, bz = (third - first).T  # `np.cross` takes three times as long
    normals = np.stack([ay * bz - az * by, az * bx - ax * bz, ax * by - ay * bx], axis=1)
    return normals, np.einsum("ij,ij->i", normals, first)


def _boxes(vertices: Array, triangles, component, components: int) -> Array:
    # Triangles in the order of their components, so that each component is one run of rows.
    order = np.argsort(component, kind="stable")
    starts = np.searchsorted(component[order], np.arange(components))
    corners = vertices[triangles[order]]
    if not components:
        return np.zeros((0, 2, 3))
    low, high = (
        np.minimum.reduceat(corners.min(axis=1), starts),
        np.maximum.reduceat(corners.max(axis=1), starts),
    )
    return np.stack([low, high], axis=1)


def scene_of(shapes: Sequence[Any], others: dict[str, Any] | None = None) -> Any:
    """Return a Mitsuba scene of shapes, all of which keep their names; `others` is what
    else is in its dictionary.
    """
    names = [shape.id() for shape in shapes]
    # A key of Mitsuba's dictionaries becomes the name of the shape, may hold no dots, and of two
    # shapes with one key the last alone is left: so keys are numbers, and the shapes get their
    # names back.
    parts = {f"shape-{number}": shape for number, shape in enumerate(shapes)}
    scene = mi.load_dict({"type": "scene"} | (others or {}) | parts)
    for shape, name in zip(shapes, names, strict=True):
        shape.set_id(name)
    return scene
