# SPDX-License-Identifier: BSD-3-Clause
"""What hides lights, as numbers: triangles of the polygons, balls, and the shapes that only casting rays can tell of.

Mitsuba takes a `sphere` for the ball around the image of its centre whose radius is the length of the image of its
first axis, whatever else the transform does to it: so does this module. Which side its normals point to matters to no
shadow.
"""

from dataclasses import dataclass, field
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.convex_bodies import Ball, half_chord
from reference.scene.read import TruthScene, scene_of

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Shapes:
    """The opaque shapes of a scene."""

    triangles: Array  #: those of meshes and rectangles, (triangles, 3, 3) [m]
    centre: Array = field(default_factory=lambda: np.empty((0, 3)))  #: of the balls, (balls, 3) [m]
    radius: Array = field(default_factory=lambda: np.empty(0))  #: of the balls, (balls,) [m]
    others: Any = None  #: an `mi.Scene` of all other shapes, None where there are none
    single: tuple[tuple[Any, Array | Ball], ...] = ()  #: meshes, rectangles and spheres one by one, each as numbers


def read_shapes(scene) -> Shapes:
    """Read the shapes of a Mitsuba scene, all of them opaque."""
    single: list[tuple[Any, Array | Ball]] = []
    others = []
    for shape in scene.shapes():
        if is_polygonal(shape):
            single.append((shape, _shape_triangles(shape)))
        elif shape.class_name() == "Sphere":
            single.append((shape, _ball(shape)))
        else:
            others.append(shape)
    triangles = [part for _, part in single if not isinstance(part, Ball)]
    balls = [part for _, part in single if isinstance(part, Ball)]
    return Shapes(
        np.concatenate([np.empty((0, 3, 3)), *triangles]),
        np.array([ball.centre for ball in balls]).reshape(-1, 3),
        np.array([ball.radius for ball in balls]),
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
        shape = next(one for one in shapes.others.shapes() if not is_polygonal(one) and one.class_name() != "Sphere")
        raise InputError(
            f"shape '{shape.id()}' is a {shape.class_name()}; wanted meshes, rectangles and spheres, whose lit "
            "intervals are exact: replace it by a mesh, or take edges='auto'"
        )


def is_polygonal(shape) -> bool:
    """Return whether a shape consists of triangles."""
    return shape.is_mesh() or _is_rectangle(shape)


def _is_rectangle(shape) -> bool:
    return shape.class_name() == "Rectangle"  # has no vertices to ask for


def _shape_triangles(shape) -> Array:
    if _is_rectangle(shape):
        corners = np.array([[-1.0, -1, 0, 1], [1, -1, 0, 1], [1, 1, 0, 1], [-1, 1, 0, 1]])
        return (corners @ _matrix(shape).T)[:, :3][np.array([[0, 1, 2], [0, 2, 3]])]
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    return vertices[np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)]


def _ball(shape) -> Ball:
    matrix = _matrix(shape)
    return Ball(matrix[:3, 3], float(np.linalg.norm(matrix[:3, 0])))


def _matrix(shape) -> Array:
    return np.array(mi.traverse(shape)["to_world"].matrix, dtype=np.float64).reshape(4, 4)


def exact_distance(truth: TruthScene, interaction: Any, distance: Array, shapes: Shapes | None = None) -> Array:
    """Return the distances to the visible surface again in float64, where that is a polygon or a ball.

    Parameters
    ----------
    truth
        The scene; its rays are those that were cast.
    interaction
        Mitsuba's surface interactions: which triangle each ray met.
    distance
        The distances that were found, (rays,), infinite where nothing is hit [m].
    shapes
        What `read_shapes` returned, if known.

    Notes
    -----
    Valid where the plane of the triangle is met within 1e-4 of the distance; elsewhere, on triangles seen edge-on, the
    distance stays what it was. So it does on balls that a ray misses in float64, which happens where it touches them,
    and on other shapes.
    """
    hit = np.isfinite(distance)
    shape_of_hit = np.array(dr.reinterpret_array(mi.UInt32, interaction.shape))
    primitive = np.array(interaction.prim_index, dtype=np.int64)
    refined = distance.copy()
    for shape, part in (shapes or read_shapes(truth.occluders)).single:
        number = np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(shape))).item()
        mine = np.flatnonzero(hit & (shape_of_hit == number))
        if not len(mine):
            continue
        if isinstance(part, Ball):
            refined[mine] = _to_ball(part, truth.origin, truth.direction[mine], distance[mine])
            continue
        # A rectangle counts as one primitive; both its triangles lie in one plane.
        number_in_shape = 0 * mine if _is_rectangle(shape) else primitive[mine]
        refined[mine] = _to_plane(part[number_in_shape] - truth.origin, truth.direction[mine], distance[mine])
    return refined


def _to_plane(corner: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays from the origin go to the planes of triangles."""
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    with np.errstate(divide="ignore", invalid="ignore"):
        exact = np.sum(normal * corner[:, 0], axis=1) / np.sum(normal * direction, axis=1)
    return np.where(np.abs(exact - distance) < 1e-4 * distance, exact, distance)


def _to_ball(ball: Ball, origin: Array, direction: Array, distance: Array) -> Array:
    """Return how far rays go to where they enter a ball, or leave it if they start inside."""
    centre = ball.centre - origin
    middle = direction @ centre
    miss = np.linalg.norm(centre - middle[:, None] * direction, axis=1)
    half = half_chord(ball.radius, miss)
    inside = np.linalg.norm(centre) < ball.radius
    return np.where(miss < ball.radius, middle + half if inside else middle - half, distance)
