# SPDX-License-Identifier: BSD-3-Clause
"""The shapes of a Mitsuba scene as triangle meshes, for engines that support nothing else.

Meshes, rectangles and Mitsuba's cubes stay what they are. Round shapes are cut into `SIDES` around:
no point of the mesh is further inside the shape than 1 - cos(pi / SIDES) = 3e-4 of the radius,
twice that for spheres.
"""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.transforms import matrix_of

Array = NDArray[np.float64]
Index = NDArray[np.int64]

SIDES = 128


@dataclass(frozen=True)
class ShapeMesh:
    """A shape as triangles."""

    name: str
    vertices: Array  #: (vertices, 3) [m]
    faces: Index  #: (faces, 3), counter-clockwise seen from the side that normals point to
    normals: Array | None  #: unit normals at the vertices, where the shape is shaded smoothly
    exact: bool  #: whether the triangles are the shape itself


def shape_mesh(shape: Any) -> ShapeMesh:
    """Return a shape of a Mitsuba scene as a mesh; one that cannot be made a
    mesh is refused by name.
    """
    unit = {"Rectangle": _rectangle, "Sphere": _sphere, "Disk": _disk, "Cylinder": _cylinder}.get(
        shape.class_name()
    )
    # Mitsuba's rectangle claims to be a mesh, but has no vertices
    if unit is None and shape.is_mesh():
        return _of_mesh(shape)
    if unit is None:
        raise InputError(
            f"shape '{shape.id()}' is a {shape.class_name()}; expected meshes, cubes, rectangles, "
            "spheres, disks and "
            "cylinders to write as triangles: replace it by a mesh"
        )
    return _placed(shape, *unit())


def triangle_count(shape: Any) -> int | None:
    """Return the triangles of a mesh or a rectangle, None for other shapes."""
    if shape.class_name() == "Rectangle":
        return 2
    return int(shape.face_count()) if shape.is_mesh() else None


def _of_mesh(shape: Any) -> ShapeMesh:
    import mitsuba as mi

    # Mitsuba holds float32; the mesh is already where its transform puts it.
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    normals = None
    if shape.has_vertex_normals():
        normals = np.array(parameters["vertex_normals"], dtype=np.float64).reshape(-1, 3)
        # A vertex without a triangle has a normal of zero, which stays zero.
        length = np.linalg.norm(normals, axis=1, keepdims=True)
        normals = normals / np.where(length > 0, length, 1)
        faces = _towards(vertices, faces, normals)
    return _turned(shape, ShapeMesh(shape.id(), vertices, faces, normals, exact=True))


def _placed(shape: Any, vertices: Array, faces: Index, normals: Array | None) -> ShapeMesh:
    """Move a unit shape to where its transform puts it; normals go with the inverse transposed.

    Where the transform mirrors, Mitsuba's cylinder shades its inside, the others the side
    that the transform leaves.
    """
    import mitsuba as mi

    matrix = matrix_of(mi.traverse(shape)["to_world"])
    # A mirror turns the order of corners round. The order is reversed to keep the side that is
    # shaded, except for the cylinder.
    mirrored = np.linalg.det(matrix[:3, :3]) < 0
    if mirrored and shape.class_name() != "Cylinder":
        faces = faces[:, ::-1]
    if normals is not None:
        normals = (
            normals
            @ np.linalg.inv(matrix[:3, :3])
            * (-1 if mirrored and shape.class_name() == "Cylinder" else 1)
        )
        normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    moved = vertices @ matrix[:3, :3].T + matrix[:3, 3]
    return _turned(
        shape, ShapeMesh(shape.id(), moved, faces, normals, exact=shape.class_name() == "Rectangle")
    )


def _towards(vertices: Array, faces: Index, normals: Array) -> Index:
    """Return faces that run counter-clockwise about their normals: a mesh that was
    mirrored keeps its order.
    """
    corners = vertices[faces]
    area = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    # The normals of the three corners together say the side of a triangle.
    reversed_faces = np.sum(normals[faces].sum(axis=1) * area, axis=1) < 0
    return np.where(reversed_faces[:, None], faces[:, ::-1], faces)


def _turned(shape: Any, mesh: ShapeMesh) -> ShapeMesh:
    """Return the mesh inside out where the shape is."""
    if not shape.has_flipped_normals():
        return mesh
    normals = None if mesh.normals is None else -mesh.normals
    return ShapeMesh(mesh.name, mesh.vertices, mesh.faces[:, ::-1], normals, mesh.exact)


def _rectangle() -> tuple[Array, Index, None]:
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]])
    return corners, np.array([[0, 1, 2], [0, 2, 3]]), None


def _disk() -> tuple[Array, Index, None]:
    return *_revolved([(1, 0), (0, 0)]), None


def _cylinder() -> tuple[Array, Index, Array]:
    """Return the side of the cylinder from z = 0 to 1; Mitsuba's has no ends."""
    vertices, faces = _revolved([(1, 0), (1, 1)])
    return vertices, faces, vertices * [1, 1, 0]


def _sphere() -> tuple[Array, Index, Array]:
    # Half as many steps from pole to pole as around, so that cells at the equator are square.
    polar = np.pi * np.arange(SIDES // 2 + 1) / (SIDES // 2)
    vertices, faces = _revolved(np.stack([np.sin(polar), -np.cos(polar)], axis=1))
    return vertices, faces, vertices


def _revolved(profile: Any) -> tuple[Array, Index]:
    """Return the surface that points (radius, z) sweep about the z axis, seen
    from outside where z grows.
    """
    angle = 2 * np.pi * np.arange(SIDES) / SIDES
    # Rings of `SIDES` vertices, one for each point of the profile. Two triangles join each vertex
    # to the next ring.
    circle = np.stack([np.cos(angle), np.sin(angle), np.zeros(SIDES)], axis=1)
    vertices = np.concatenate([radius * circle + [0, 0, z] for radius, z in profile])
    i = np.arange(SIDES)
    j = (i + 1) % SIDES
    band = np.concatenate([np.stack([i, j, SIDES + j], 1), np.stack([i, SIDES + j, SIDES + i], 1)])
    faces = np.concatenate([band + ring * SIDES for ring in range(len(profile) - 1)])
    corners = vertices[faces]
    area = np.linalg.norm(
        np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1
    )
    return vertices, faces[area > 1e-9]  # half of the triangles at a pole have none
