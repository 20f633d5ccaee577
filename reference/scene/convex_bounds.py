# SPDX-License-Identifier: BSD-3-Clause
"""Convex bounds of media in float64: polyhedra and spheres, read from Mitsuba's shapes and checked.

A polyhedron is what its facets' half spaces n . x <= offset have in common. Vertices are float32
numbers, so a facet of four corners is only nearly flat; a mesh counts as convex where no vertex
lies further outside any facet's plane than

    size (1e-6 + 4 eps largest coordinate / altitude of the facet),        eps = 2^-24:

the most by which rounding of its corners moves the plane of a facet. Slivers with an altitude below
1e-6 of the size have no plane that can be relied on; their neighbours bound the body without them.
"""

from dataclasses import dataclass

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.transforms import SAME, matrix_of, outwards

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Polyhedron:
    """A convex polyhedron."""

    normal: Array  #: outward unit normals of the facets, (facets, 3)
    offset: Array  #: the body is where normal . x <= offset for all facets, (facets,) [m]
    edge: Array  #: ends of the edges at which the surface bends, (edges, 2, 3) [m]


@dataclass(frozen=True)
class Sphere:
    """A sphere."""

    centre: Array  #: [m]
    radius: float  #: [m]


Bounds = Polyhedron | Sphere


def read_bounds(shape: "mi.Shape") -> Bounds:
    """Read the bounds of a medium from a shape.

    Raises InputError, by the name of the shape, unless it is a sphere or a closed convex mesh whose
    normals point outwards.
    """
    parameters = mi.traverse(shape)
    if shape.class_name() == "Sphere":
        return _read_sphere(shape, matrix_of(parameters["to_world"]))
    if not shape.is_mesh() or "vertex_positions" not in parameters:
        raise _refusal(
            shape, f"is a {shape.class_name().lower()}", "a sphere, a cube or a closed convex mesh"
        )
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    # The test of convexity looks at every vertex and every facet.
    most = 20_000
    if len(faces) > most:
        raise _refusal(shape, f"has {len(faces)} triangles", f"at most {most}: simplify the mesh")
    return _read_polyhedron(shape, vertices, faces)


def _read_sphere(shape: "mi.Shape", matrix: Array) -> Sphere:
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if np.ptp(lengths) > SAME * lengths.max():
        raise _refusal(
            shape, "is a sphere with different scales along its axes", "one scale, or a mesh"
        )
    if shape.has_flipped_normals():
        raise _refusal(shape, "is inside out", outwards(matrix))
    # Mitsuba takes the length of the first axis for the radius, see `reference.scene.shapes`.
    return Sphere(matrix[:3, 3], float(lengths[0]))


def _read_polyhedron(shape: "mi.Shape", vertices: Array, faces: Index) -> Polyhedron:
    # Merge vertices that the mesh doubles for the sake of normals or texture.
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    faces = same.reshape(-1)[faces]
    # Normals and altitudes of the facets.
    corner = vertices[faces]
    size = float(np.linalg.norm(np.ptp(vertices, axis=0)))
    area = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    twice_area = np.linalg.norm(area, axis=1)
    longest = np.linalg.norm(corner - np.roll(corner, 1, axis=1), axis=2).max(axis=1)
    altitude = twice_area / np.maximum(longest, np.finfo(float).tiny)
    # Slivers, with an altitude below 1e-6 of the size, have no plane that can be relied on.
    flat = 1e-6
    sound = altitude > flat * size
    edges, sides = _edges(shape, faces)
    normal = area / np.maximum(twice_area, np.finfo(float).tiny)[:, None]
    # The sum over all facets is six times the volume, above zero if normals point outwards.
    if np.sum(corner[:, 0] * area) * (-1 if shape.has_flipped_normals() else 1) < 0:
        raise _refusal(
            shape,
            "is inside out",
            "normals that point outwards: change flip_normals, which a mirrored to_world of a mesh "
            "asks for too",
        )
    if shape.has_flipped_normals():
        normal = -normal
    offset = np.mean(np.sum(corner * normal[:, None], axis=2), axis=1)
    # How far rounding of its corners may turn the plane of a facet, at the distance of the furthest
    # vertex: the formula of the module; 2^-22 is 4 eps.
    allowed = size * (flat + 2.0**-22 * np.abs(vertices).max() / np.maximum(altitude, flat * size))
    for first in range(0, len(faces), 256):
        block = slice(first, first + 256)
        outside = np.max(vertices @ normal[block].T, axis=0) - offset[block]
        if np.any(sound[block] & (outside > allowed[block])):
            raise _refusal(
                shape,
                "is not convex",
                "convex bounds: cut the body into convex parts; clouds of any shape are for "
                "`airlight reference --estimator cloud-paths` and methods of clouds",
            )
    if not np.any(sound):
        raise _refusal(shape, "has no volume", "a closed convex mesh")
    # An edge within a flat facet of several triangles is no edge of the body; one beside a sliver
    # may be.
    bends = np.linalg.norm(normal[sides[:, 0]] - normal[sides[:, 1]], axis=1) > 10 * flat
    bends |= ~sound[sides].all(axis=1)
    return Polyhedron(normal[sound], offset[sound], vertices[edges[bends]])


def _edges(shape: "mi.Shape", faces: Index) -> tuple[Index, Index]:
    """Return the ends of the edges and the two faces beside each edge; refuse a surface that is not
    closed.
    """
    ends = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    face = np.tile(np.arange(len(faces)), 3)
    lower, upper = ends.min(axis=1), ends.max(axis=1)
    order = np.lexsort((ends[:, 0] > ends[:, 1], upper, lower))
    ends, face = ends[order], face[order]
    # In a closed surface every edge comes twice, once in each direction.
    closed = len(ends) % 2 == 0 and np.array_equal(ends[::2], ends[1::2, ::-1])
    if not closed or np.any(lower == upper) or np.any(np.all(ends[2::2] == ends[:-2:2], axis=1)):
        raise _refusal(
            shape,
            "is not a closed surface",
            "a closed convex mesh without doubled or degenerate faces",
        )
    return ends[::2], np.stack([face[::2], face[1::2]], axis=1)


def _refusal(shape: "mi.Shape", fault: str, expected: str) -> InputError:
    return InputError(f"shape '{shape.id()}' bounds a medium and {fault}; expected {expected}")


def holds(bounds: Bounds, point: Array) -> bool:
    """Return whether a point, (3,) [m], lies inside of bounds, off their surface."""
    if isinstance(bounds, Sphere):
        return bool(np.linalg.norm(point - bounds.centre) < bounds.radius)
    return bool(np.all(bounds.normal @ point < bounds.offset))


def furthest(bounds: Bounds, point: Array) -> float:
    """Return how far from a point, (3,) [m], bounds reach [m]."""
    if isinstance(bounds, Sphere):
        return float(np.linalg.norm(bounds.centre - point)) + bounds.radius
    return float(np.linalg.norm(bounds.edge.reshape(-1, 3) - point, axis=1).max(initial=0.0))


def largest_ball(normal: Array, offset: Array) -> float:
    """Return the radius of the largest ball in half spaces normal . x <= offset, unit normals,
    (n, 3), and (n,) [m]; below 0 how far all planes must move outwards to share a point.
    """
    from scipy.optimize import linprog  # few scenes need it, and it takes long to import

    # Unknowns are the centre x and the radius t; a ball is within a half space if n . x + t <=
    # offset. The least -t is wanted.
    found = linprog(
        [0, 0, 0, -1],
        A_ub=np.column_stack([normal, np.ones(len(normal))]),
        b_ub=offset,
        bounds=[(None, None)] * 4,
    )
    return -float(found.fun) if found.status == 0 else 0.0


def in_surface(bounds: Bounds, point: Array) -> bool:
    """Return whether a point, (3,) [m], lies in the surface of bounds, up to float32 rounding."""
    margin = 1e-6 * float(np.abs(point).max())
    if isinstance(bounds, Sphere):
        return bool(
            abs(np.linalg.norm(point - bounds.centre) - bounds.radius)
            < margin + 1e-6 * bounds.radius
        )
    furthest = float(np.max(bounds.normal @ point - bounds.offset))
    return abs(furthest) < margin + 1e-6 * float(np.ptp(bounds.offset))


def normals_at(bounds: Bounds, points: Array) -> Array:
    """Return outward unit normals at points of a surface, (n, 3) [m]; at an edge the normal of one
    of its facets.
    """
    if isinstance(bounds, Sphere):
        return (points - bounds.centre) / bounds.radius
    return bounds.normal[np.argmax(points @ bounds.normal.T - bounds.offset, axis=1)]
