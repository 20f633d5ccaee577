# SPDX-License-Identifier: BSD-3-Clause
"""What hides lights, as numbers: triangles of polygons, spheres, and the shapes that only cast rays can find.

Mitsuba takes a `sphere` for the sphere around the image of its centre whose radius is the length of the image of its
first axis, whatever else the transform does to it, and so does this module. Shadows do not depend on the side to which
normals point.
"""

from dataclasses import dataclass, field
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.convex_bounds import Sphere
from reference.scene.read import scene_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """The opaque shapes of a scene."""

    triangles: Array  #: those of meshes and rectangles, (triangles, 3, 3) [m]
    centre: Array = field(default_factory=lambda: np.empty((0, 3)))  #: of the spheres, (spheres, 3) [m]
    radius: Array = field(default_factory=lambda: np.empty(0))  #: of the spheres, (spheres,) [m]
    others: Any = None  #: an `mi.Scene` of all other shapes, None where there are none
    single: tuple[tuple[Any, Array | Sphere], ...] = ()  #: meshes, rectangles and spheres one by one, each as numbers


def read_shapes(scene) -> Shapes:
    """Read the shapes of a Mitsuba scene, all of them opaque."""
    single: list[tuple[Any, Array | Sphere]] = []
    others = []
    for shape in scene.shapes():
        if is_polygonal(shape):
            single.append((shape, _shape_triangles(shape)))
        elif shape.class_name() == "Sphere":
            single.append((shape, _sphere(shape)))
        else:
            others.append(shape)
    triangles = [part for _, part in single if not isinstance(part, Sphere)]
    spheres = [part for _, part in single if isinstance(part, Sphere)]
    return Shapes(
        np.concatenate([np.empty((0, 3, 3)), *triangles]),
        np.array([sphere.centre for sphere in spheres]).reshape(-1, 3),
        np.array([sphere.radius for sphere in spheres]),
        scene_of(others, scene) if others else None,
        tuple(single),
    )


def refuse_others(shapes: Shapes) -> None:
    """Refuse shapes whose shadows are not exact.

    Raises
    ------
    InputError
        For a shape that is neither a mesh nor a rectangle nor a sphere, with its name.
    """
    if shapes.others is not None:
        shape = next(
            each for each in shapes.others.shapes() if not is_polygonal(each) and each.class_name() != "Sphere"
        )
        raise InputError(
            f"shape '{shape.id()}' is a {shape.class_name()}; wanted meshes, rectangles and spheres, whose lit "
            "intervals are exact: replace it by a mesh, or take edges='auto'"
        )


def is_polygonal(shape) -> bool:
    """Return whether a shape consists of triangles."""
    return shape.is_mesh() or is_rectangle(shape)


def is_rectangle(shape) -> bool:
    """Return whether a shape is Mitsuba's rectangle."""
    return shape.class_name() == "Rectangle"  # has no vertices to ask for


def _shape_triangles(shape) -> Array:
    if is_rectangle(shape):
        corners = np.array([[-1.0, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]])
        return (corners @ _matrix(shape).T)[:, :3][np.array([[0, 1, 2], [0, 2, 3]])]
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    return vertices[np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)]


def _sphere(shape) -> Sphere:
    matrix = _matrix(shape)
    return Sphere(matrix[:3, 3], float(np.linalg.norm(matrix[:3, 0])))


def _matrix(shape) -> Array:
    return np.array(mi.traverse(shape)["to_world"].matrix, dtype=np.float64).reshape(4, 4)
