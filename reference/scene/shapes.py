# SPDX-License-Identifier: BSD-3-Clause
"""Occluders as numbers: triangles of meshes and rectangles, spheres, and disks.

Mitsuba takes a `sphere` for the sphere around the image of its centre whose radius is the length of
the image of its first axis, whatever else the transform does to it, and so does this module.
Shadows do not depend on the side to which normals point.
"""

import math
from dataclasses import dataclass, field
from functools import cached_property

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.convex_bounds import Sphere
from airlight.reference.scene.transforms import SAME, matrix_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Disks:
    """Flat round shapes."""

    centre: Array = field(default_factory=lambda: np.empty((0, 3)))  #: (disks, 3) [m]
    #: unit, of either side, (disks, 3)
    normal: Array = field(default_factory=lambda: np.empty((0, 3)))
    radius: Array = field(default_factory=lambda: np.empty(0))  #: (disks,) [m]


@dataclass(frozen=True)
class Shapes:
    """The opaque shapes of a scene."""

    triangles: Array  #: of meshes and rectangles, (triangles, 3, 3) [m]
    #: of the spheres, (spheres, 3) [m]
    centre: Array = field(default_factory=lambda: np.empty((0, 3)))
    radius: Array = field(default_factory=lambda: np.empty(0))  #: of the spheres, (spheres,) [m]
    disks: Disks = field(default_factory=Disks)
    #: all shapes one by one: Mitsuba's shape, and its numbers
    single: "tuple[tuple[mi.Shape, Array | Sphere | Disks], ...]" = ()

    @property
    def count(self) -> int:
        """How many triangles, spheres and disks there are."""
        return len(self.triangles) + len(self.radius) + len(self.disks.radius)

    @cached_property
    def box(self) -> tuple[Array, Array]:
        """The lowest and the highest corner of a box around all shapes, (3,) each [m]; infinite
        the wrong way round without shapes.
        """
        points = np.concatenate(
            [
                self.triangles.reshape(-1, 3),
                *(self.centre + sign * self.radius[:, None] for sign in (-1, 1)),
                *(self.disks.centre + sign * self.disks.radius[:, None] for sign in (-1, 1)),
            ]
        )
        return points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)

    def metre(self, *points: Array) -> float:
        """Return 1 m, or the size of a smaller scene of these shapes and of points, (n, 3) or (3,)
        [m]: what lengths of rounding are parts of. 1 m without shapes.
        """
        if not self.count:
            return 1.0
        every = np.concatenate([*self.box, *(np.ravel(each) for each in points)]).reshape(-1, 3)
        return min(1.0, float(np.linalg.norm(np.ptp(every, axis=0))))


def read_shapes(scene: "mi.Scene") -> Shapes:
    """Read the shapes of a Mitsuba scene, all of them opaque.

    Raises InputError, by the name of the shape, unless it is a mesh, a rectangle, a sphere or a
    disk.
    """
    single = tuple((shape, _read(shape)) for shape in scene.shapes())
    triangles = [part for _, part in single if isinstance(part, np.ndarray)]
    spheres = [part for _, part in single if isinstance(part, Sphere)]
    disks = [part for _, part in single if isinstance(part, Disks)]
    return Shapes(
        np.concatenate([np.empty((0, 3, 3)), *triangles]),
        np.array([sphere.centre for sphere in spheres]).reshape(-1, 3),
        np.array([sphere.radius for sphere in spheres]),
        Disks(
            np.concatenate([Disks().centre, *(disk.centre for disk in disks)]),
            np.concatenate([Disks().normal, *(disk.normal for disk in disks)]),
            np.concatenate([Disks().radius, *(disk.radius for disk in disks)]),
        ),
        single,
    )


def _read(shape: "mi.Shape") -> Array | Sphere | Disks:
    if is_polygonal(shape):
        return triangles_of(shape)
    matrix = _matrix(shape)
    length = np.linalg.norm(matrix[:3, :3], axis=0)
    if shape.class_name() == "Sphere":
        return Sphere(matrix[:3, 3], float(length[0]))
    if shape.class_name() != "Disk":
        raise InputError(
            f"shape '{shape.id()}' is a {shape.class_name().lower()}; expected meshes, rectangles, "
            "spheres and disks, whose shadows are exact: replace it by a mesh, as fine as you need"
        )
    if (
        abs(length[0] - length[1]) > SAME * length[0]
        or abs(matrix[:3, 0] @ matrix[:3, 1]) > SAME * length[0] ** 2
    ):
        raise InputError(f"shape '{shape.id()}' is an oval disk; expected a round one, or a mesh")
    # Transforms may shear the third axis: the normal is across the first two.
    normal = np.cross(matrix[:3, 0], matrix[:3, 1])
    return Disks(matrix[None, :3, 3], normal[None] / np.linalg.norm(normal), length[:1])


def distance_to(shapes: Shapes, point: Array) -> float:
    """Return the distance from a point, (3,) [m], to the nearest surface of shapes [m]."""
    spheres = np.abs(np.linalg.norm(shapes.centre - point, axis=1) - shapes.radius)
    away = point - shapes.disks.centre
    above = np.sum(away * shapes.disks.normal, axis=1)
    # The nearest place of a disk is below the point, or on the rim.
    beside = np.linalg.norm(away - above[:, None] * shapes.disks.normal, axis=1)
    disks = np.hypot(above, np.maximum(beside - shapes.disks.radius, 0.0))
    return min(
        distance_to_triangles(shapes.triangles, point), *spheres.tolist(), *disks.tolist(), math.inf
    )


def distance_to_triangles(triangles: Array, point: Array) -> float:
    """Return the distance from a point, (3,) [m], to the nearest of triangles, (n, 3, 3) [m]."""
    # The foot of the point on the plane of a triangle is in the triangle if it is on the inner side
    # of all three sides: then the distance to the plane counts, else that to the nearest side.
    corners = triangles - point
    sides = np.roll(corners, -1, axis=1) - corners
    normals = np.cross(sides[:, 0], sides[:, 1])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), np.finfo(float).tiny)
    # of a side: how far the foot lies
    inwards = np.einsum("tsx,tx->ts", np.cross(sides, -corners), normals)
    planes = np.abs(np.einsum("tx,tx->t", corners[:, 0], normals))[np.all(inwards > 0, axis=1)]
    length = np.maximum(np.sum(sides**2, axis=2), np.finfo(float).tiny)
    along = np.clip(-np.sum(corners * sides, axis=2) / length, 0, 1)
    edges = np.linalg.norm(corners + along[..., None] * sides, axis=2)
    return float(min(planes.min(initial=np.inf), edges.min(initial=np.inf)))


def is_polygonal(shape: "mi.Shape") -> bool:
    """Return whether a shape consists of triangles."""
    return shape.is_mesh() or is_rectangle(shape)


def is_rectangle(shape: "mi.Shape") -> bool:
    """Return whether a shape is Mitsuba's rectangle."""
    return shape.class_name() == "Rectangle"  # has no vertices to ask for


def triangles_of(shape: "mi.Shape") -> Array:
    """Return the triangles of a mesh or rectangle, (triangles, 3, 3) [m]."""
    if is_rectangle(shape):
        # Mitsuba's rectangle is [-1, 1]^2 in its own frame, here two triangles.
        corners = np.array([[-1.0, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]])
        return (corners @ _matrix(shape).T)[:, :3][np.array([[0, 1, 2], [0, 2, 3]])]
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    return vertices[np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)]


def _matrix(shape: "mi.Shape") -> Array:
    return matrix_of(mi.traverse(shape)["to_world"])
