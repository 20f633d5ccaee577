# SPDX-License-Identifier: BSD-3-Clause
"""Closed meshes of any shape, and which points lie inside.

A mesh is closed if every edge is met by two triangles, once each way. The winding number of a mesh
about a point is the sum of the solid angles of its triangles over 4 pi (Van Oosterom and Strackee
1983, eq. 8): with the corners a, b, c seen from the point,

    tan(angle/2) = a . (b x c) / (|a||b||c| + (a . b)|c| + (b . c)|a| + (c . a)|b|).

**Convex bounds of media:** the half spaces of a closed convex mesh, or a sphere,
read from Mitsuba's shapes.

A mesh is convex if its surface is the one of its convex hull. The depth below the hull, the least
distance to any of its planes, is concave along a triangle: with the depth d at the centroid and
none below 0 it is at most 3 d anywhere. The centroids alone therefore decide, to 2e-5 of the size
of the body. The volume below the hull does not: a box of 2 m at 31 m from the origin, its faces
divided into 40 x 40, lacks 8e-7 of it by the rounding of float32, and a ball of 81 920 facets 6e-7
by a dent of 1 % of its radius (29 November 2026).

Facets that lie in one plane to the rounding of float32 vertices are one half space: a cube has 6,
however finely it is divided. The hull merges them (Barber, Dobkin, Huhdanpaa 1996, *The quickhull
algorithm for convex hulls*, ACM Transactions on Mathematical Software 22(4)).
"""

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.scene.mesh_adjacency import mesh_triangles
from airlight.realtime.transforms import host_matrix, turned_outwards

Array = NDArray[np.float64]


@dataclass(frozen=True)
class ClosedMesh:
    """A mesh whose edges all are met once each way; doubled vertices are one."""

    name: str
    vertices: Array  #: (vertices, 3) [m]
    #: numbers of vertices, counter-clockwise seen from outside, (faces, 3)
    faces: NDArray[np.int64]
    own: NDArray[np.int64]  #: the numbers of the vertices in the user's mesh, (vertices,)

    @property
    def corners(self) -> Array:
        """The corners of the triangles, (faces, 3, 3) [m]."""
        return self.vertices[self.faces]

    def edge_words(self, tail: int, head: int) -> str:
        """Return the name of an edge in messages: the user's numbers of its
        vertices, and its middle.
        """
        place = 0.5 * (self.vertices[tail] + self.vertices[head])
        return f"edge {self.own[tail]}-{self.own[head]} at ({', '.join(f'{x:.6g}' for x in place)})"


def closed_mesh(name: str, vertices: Array, faces: NDArray[Any]) -> ClosedMesh:
    """Return a mesh with its doubled vertices joined.

    Parameters
    ----------
    name
        For messages.
    vertices
        Positions, (vertices, 3) [m].
    faces
        Vertex numbers, counter-clockwise seen from outside, (faces, 3).

    Raises
    ------
    InputError
        Where an edge is not met once each way, with its name.
    """
    # Meshes come with seams, where texture coordinates differ: equal vertices become one.
    joined, source, number = np.unique(vertices, axis=0, return_index=True, return_inverse=True)
    mesh = ClosedMesh(name, joined, number.reshape(-1)[np.asarray(faces, dtype=np.int64)], source)

    # Each triangle runs along three edges, from the tail to the head of each.
    tail, head = mesh.faces.ravel(), np.roll(mesh.faces, -1, axis=1).ravel()
    if np.any(tail == head):
        first = int(np.argmax(tail == head)) // 3
        raise _open(mesh, mesh.faces[first, 0], mesh.faces[first, 2], f"triangle {first} is a line")

    # An edge and its way have one number, tail times count plus head. The mesh is closed if each
    # such number occurs once, and the number of the opposite way, too.
    count = len(joined)
    forward, backward = tail * count + head, head * count + tail
    _, first, met = np.unique(forward, return_index=True, return_counts=True)
    if np.any(met > 1):
        edge = int(np.argmax(met > 1))
        at, times = first[edge], int(met[edge])
        raise _open(mesh, tail[at], head[at], f"{times} triangles run along it the same way")
    alone = np.flatnonzero(~np.isin(forward, backward))
    if len(alone):
        raise _open(mesh, tail[alone[0]], head[alone[0]], "one triangle meets it where two should")
    return mesh


def _open(mesh: ClosedMesh, tail: int, head: int, why: str) -> InputError:
    return InputError(
        f"shape '{mesh.name}' bounds a medium and is not a closed surface: "
        f"{mesh.edge_words(tail, head)}, {why}; "
        "expected a closed mesh in which two triangles meet at every edge, and run along it in "
        "opposite ways"
    )


def winding_number(corners: Array, point: Array) -> float:
    """Return how often triangles with `corners` (triangles, 3, 3) [m] wind around a
    `point` [m]; 1 is inside.
    """
    a, b, c = np.moveaxis(corners - point, 1, 0)
    lengths = [np.linalg.norm(side, axis=1) for side in (a, b, c)]
    # Numerator a . (b x c) and denominator of tan(angle/2), by triangle.
    volume = np.einsum("ij,ij->i", a, np.cross(b, c))
    products = [np.einsum("ij,ij->i", *pair) for pair in ((a, b), (b, c), (c, a))]
    turned = products[0] * lengths[2] + products[1] * lengths[0] + products[2] * lengths[1]
    # arctan2 is half of the solid angle: the sum over 4 pi has 2 pi here.
    return float(
        np.sum(np.arctan2(volume, lengths[0] * lengths[1] * lengths[2] + turned)) / (2 * np.pi)
    )


def encloses(mesh: ClosedMesh, point: Array) -> bool:
    """Return whether a `point` [m] lies within a mesh."""
    # The box first: the winding number needs all triangles.
    if np.any(point < mesh.vertices.min(axis=0)) or np.any(point > mesh.vertices.max(axis=0)):
        return False
    return winding_number(mesh.corners, point) > 0.5


def shape_number(shape: Any) -> int:
    """Return the number of a shape in Mitsuba's registry."""
    return int(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))[0])


FLAT = 1e-5  #: how far a surface may lie from a convex one, relative to the size of the body
CELLS = 8  #: of directions along each axis, by which walks over the facets find a place to begin
_SAMPLES = 1 << 16  # pairs of points for the mean distance: its standard error is 0.2 %


@dataclass(frozen=True)
class Bounds:
    """A convex body: what lies in all half spaces normal . x <= offset, or in the
    sphere where there are none.
    """

    name: str
    normals: Array  #: unit vectors that point outwards, (planes, 3)
    offsets: Array  #: (planes,) [m]
    corners: Array  #: of the triangles, (triangles, 3, 3) [m]
    centre: Array  #: of a sphere that holds the body [m]
    radius: float  #: of that sphere [m]
    #: pairs of planes that share an edge, each pair both ways and in order, (pairs, 2)
    neighbours: NDArray[np.int64] = field(default_factory=lambda: np.zeros((0, 2), dtype=np.int64))

    @property
    def is_sphere(self) -> bool:
        """Whether the body is its sphere."""
        return not len(self.offsets)


def read_bounds(shape) -> tuple[Bounds | None, ClosedMesh | None]:
    """Read the bounds of a medium from a shape.

    Parameters
    ----------
    shape
        A Mitsuba shape.

    Returns
    -------
    bounds
        Its convex bounds, None where it is not convex.
    mesh
        Its triangles, None for a sphere.

    Raises
    ------
    InputError
        For a shape that is neither a sphere nor a closed mesh with its normals
        outwards, with its name.
    """
    name = shape.id()
    if shape.class_name() == "Sphere":
        return _read_sphere(shape), None
    if not shape.is_mesh() or shape.class_name() == "Rectangle":
        raise _refusal(
            name, f"is a {shape.class_name().lower()}", "a sphere, a cube or a closed mesh"
        )
    # flip_normals turns Mitsuba's normals and not the order of vertices: the order follows them
    # here.
    vertices, faces = mesh_triangles(shape)
    faces = faces[:, ::-1] if shape.has_flipped_normals() else faces
    mesh = closed_mesh(name, vertices, faces)
    return mesh_bounds(mesh), mesh


def _read_sphere(shape) -> Bounds:
    # The transform keeps the radius of a small sphere far from the origin, which the box of its
    # float32 corners rounds.
    matrix = host_matrix(mi.traverse(shape)["to_world"])
    scales = np.linalg.norm(matrix[:3, :3], axis=0)
    if np.ptp(scales) > FLAT * scales.max():
        raise _refusal(
            shape.id(), "is a sphere with different scales along its axes", "one scale, or a mesh"
        )
    if shape.has_flipped_normals():
        raise _refusal(
            shape.id(), "is inside out", f"normals that point outwards: {turned_outwards(shape)}"
        )
    return Bounds(
        shape.id(),
        np.zeros((0, 3)),
        np.zeros(0),
        np.zeros((0, 3, 3)),
        matrix[:3, 3],
        float(scales.mean()),
    )


def mesh_bounds(mesh: ClosedMesh) -> Bounds | None:
    """Return the bounds that a mesh describes, None where it is not convex.

    Raises
    ------
    InputError
        For a mesh that is inside out or flat, with its name.
    """
    from scipy.spatial import ConvexHull

    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    size, centre = float(np.linalg.norm(high - low)), 0.5 * (low + high)

    # The body is the sum of the tetrahedra from its centre to its triangles.
    a, b, c = np.moveaxis(mesh.corners - centre, 1, 0)
    volume = np.sum(a * np.cross(b, c)) / 6
    if not abs(volume) > FLAT * size**3 * 1e-3:
        raise _refusal(mesh.name, "has no volume", "a closed mesh around a body")
    if volume < 0:
        flaw = f"is inside out, at {mesh.edge_words(*mesh.faces[0, :2])}"
        raise _refusal(
            mesh.name,
            flaw,
            "normals that point outwards: change flip_normals, which a mirrored to_world of a mesh "
            "asks for too",
        )

    # The hull is made around the centre, so that it adds no rounding. Qhull repeats the plane of
    # each facet for all triangles that it divides the facet into. It merges facets whose planes
    # differ by four times the rounding of a float32 of the largest coordinate, as three of them add
    # up.
    rounding = 2.0**-22 * float(np.abs(mesh.vertices).max())
    hull = ConvexHull(mesh.vertices - centre, qhull_options=f"Qt C{rounding:g}")
    planes, plane = np.unique(hull.equations, axis=0, return_inverse=True)
    if not _on_surface(mesh, hull.simplices, planes, centre, max(FLAT * size, rounding)):
        return None

    # Triangles of the hull that share an edge and lie in different planes make
    # these planes neighbours.
    plane = plane.reshape(-1)
    beside = plane[hull.neighbors]
    pairs = np.unique((plane[:, None] * len(planes) + beside)[beside != plane[:, None]])
    normals = planes[:, :3]
    return Bounds(
        mesh.name,
        normals,
        offsets=normals @ centre - planes[:, 3],
        corners=mesh.corners,
        centre=centre,
        radius=float(np.linalg.norm(mesh.vertices - centre, axis=1).max()),
        neighbours=np.column_stack(np.divmod(pairs, len(planes))),
    )


def _on_surface(
    mesh: ClosedMesh, simplices: NDArray[Any], planes: Array, centre: Array, depth: float
) -> bool:
    """Return whether the triangles of a mesh lie on its convex hull, no deeper than 2
    `depth` [m] (see the module).

    `simplices`: numbers of the vertices of the hull's triangles; `planes`: rows (normal,
    -offset) about the `centre`.
    """
    # Most triangles of smooth bodies are triangles of the hull: their three vertex numbers, sorted
    # and put into one number, are found among those of the hull.
    count = len(mesh.vertices)
    of_mesh, of_hull = (
        np.sort(part, axis=1) @ [count**2, count, 1]
        for part in (mesh.faces, simplices.astype(np.int64))
    )
    others = np.flatnonzero(~np.isin(of_mesh, of_hull))
    # The centroids of the others may lie 2/3 `depth` below the hull: no point of a triangle is more
    # than three times as deep. At most 2^22 distances from planes are in memory at once.
    rows = max(1, (1 << 22) // len(planes))
    for first in range(0, len(others), rows):
        points = mesh.corners[others[first : first + rows]].mean(axis=1) - centre
        nearest = (points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        if np.any(nearest < -2 / 3 * depth):
            return False
    return True


def _refusal(name: str, flaw: str, wanted: str) -> InputError:
    return InputError(f"shape '{name}' bounds a medium and {flaw}; expected {wanted}")


def plane_neighbours(bounds: Bounds) -> NDArray[np.uint32]:
    """Return by plane the planes that share an edge with it, filled up with its own
    number, (planes, most of any).
    """
    plane, neighbour = bounds.neighbours.T
    counts = np.bincount(plane, minlength=len(bounds.offsets))
    table = np.repeat(np.arange(len(counts), dtype=np.uint32)[:, None], counts.max(), axis=1)
    # Pairs are in the order of their first plane: the place of a pair in its row is its number less
    # the number of pairs of all planes before.
    table[plane, np.arange(len(plane)) - np.repeat(np.cumsum(counts) - counts, counts)] = neighbour
    return table


def radial_planes(bounds: Bounds) -> NDArray[np.uint32]:
    """Return by cell of directions from the centre a plane that is met there; cells are
    `CELLS` along each axis.
    """
    # The middle of a cell stands for its directions, in the cube from -1 to 1 along each axis.
    places = (np.arange(CELLS) + 0.5) * (2 / CELLS) - 1
    distance = bounds.offsets - bounds.normals @ bounds.centre
    x, y, z = bounds.normals.T
    first = np.empty((CELLS, CELLS, CELLS), dtype=np.uint32)
    for layer, row, column in np.ndindex(first.shape):  # one at a time: there may be many planes
        # A ray from the centre leaves the body at the nearest of the planes that it approaches.
        along = places[layer] * z + places[row] * y + places[column] * x
        with np.errstate(divide="ignore"):
            at = distance / along
        at[along <= 0] = np.inf
        first[layer, row, column] = at.argmin()
    return first.ravel()


def holds(bounds: Bounds, point: Array) -> bool:
    """Return whether a point lies inside [m], (3,)."""
    if bounds.is_sphere:
        return bool(np.linalg.norm(point - bounds.centre) < bounds.radius)
    return bool(np.all(bounds.normals @ point < bounds.offsets))


def touches(bounds: Bounds, point: Array) -> bool:
    """Return whether a point lies in the boundary [m], (3,), to what float32 knows of it."""
    margin = 1e-6 * (bounds.radius + float(np.abs(point).max()))
    if bounds.is_sphere:
        return bool(abs(np.linalg.norm(point - bounds.centre) - bounds.radius) < margin)
    # The largest signed distance from a plane: below 0 within the body, 0 on its surface.
    beyond = float((bounds.normals @ point - bounds.offsets).max())
    return abs(beyond) < margin


def mean_distance(bounds: Bounds) -> float:
    """Return R, the average distance between a point of the boundary and a point of the body [m].

    Both are uniform, by area and by volume, and independent: one reading of "the average distance
    between a point located in the boundary and a point in the medium". In a sphere the mean over
    the boundary is a + d^2/(3 a) for a point at the distance d from the centre, so R = 6 a/5. In a
    mesh it is the mean over 65 536 pairs drawn once for all from a fixed seed, with a standard
    error of about 0.2 %.

    Biri, Arques, Michelin 2006, section 4.2.
    """
    if bounds.is_sphere:
        return 1.2 * bounds.radius
    random = np.random.default_rng(20_061)
    corner = bounds.corners
    # Twice the area of each triangle as a vector along its normal, and with it six times the volume
    # of the tetrahedron between the triangle and the middle.
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    middle = np.unique(corner.reshape(-1, 3), axis=0).mean(axis=0)
    volume = np.sum((corner[:, 0] - middle) * area, axis=1)
    # Triangles are chosen by area for the boundary, tetrahedra by volume for the body.
    boundary = _on_triangles(corner, np.linalg.norm(area, axis=1), random)
    # A point of a tetrahedron lies on the way from its apex to a point of its base; the cube root
    # makes it uniform, as the cross-section grows with the square of the way.
    inside = middle + np.cbrt(random.random((_SAMPLES, 1))) * (
        _on_triangles(corner, volume, random) - middle
    )
    return float(np.mean(np.linalg.norm(boundary - inside, axis=1)))


def _on_triangles(corner: Array, fraction: Array, random) -> Array:
    """Draw points that are uniform on each triangle, which is chosen by its fraction."""
    fraction = np.maximum(fraction, 0)
    chosen = corner[random.choice(len(corner), _SAMPLES, p=fraction / fraction.sum())]
    u, v = np.sqrt(random.random((_SAMPLES, 1))), random.random((_SAMPLES, 1))
    # sqrt makes the point uniform: the width of the triangle grows with the way from its first
    # corner.
    return (1 - u) * chosen[:, 0] + u * (1 - v) * chosen[:, 1] + u * v * chosen[:, 2]
