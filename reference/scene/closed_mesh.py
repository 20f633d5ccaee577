# SPDX-License-Identifier: BSD-3-Clause
"""Whether surfaces bound bodies: closed, facing outwards, crossing neither themselves nor one another, not nested.

Vertices at the same place count as one, since files double them for the sake of normals. A surface is closed if every
directed edge of its faces occurs once and its reverse once. Surfaces cross where an edge of one goes through a face
that does not share a corner with it: each edge is cast as a ray.
"""

from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.scene.read import scene_from

Array = NDArray[np.float64]
Index = NDArray[np.int64]


def check_closed(shape: Any) -> None:
    """Check that the surface of a shape is closed and faces outwards.

    Raises InputError by the name of the shape, with an edge that is in the way.
    """
    if shape.class_name() == "Sphere":
        if shape.has_flipped_normals():
            raise _refusal(shape, "is inside out", "normals that point outwards: remove flip_normals")
        return
    if not shape.is_mesh():
        raise _refusal(shape, f"is a {shape.class_name().lower()}", "a sphere, a cube or a closed mesh")
    vertices, faces = _merged(shape)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    size = len(vertices)
    keys, counts = np.unique(edges[:, 0] * size + edges[:, 1], return_counts=True)
    reverse = keys % size * size + keys // size
    wrong = keys[(counts > 1) | ~np.isin(reverse, keys) | (keys // size == keys % size)]
    if wrong.size:
        a, b = divmod(int(wrong[0]), size)
        raise _refusal(
            shape,
            f"is not a closed surface: edge {_edge(vertices[a], vertices[b])} has not one face on each side that run "
            "through it in opposite directions",
            "a closed mesh",
        )
    a, b, c = (vertices[faces[:, corner]] - vertices.mean(axis=0) for corner in range(3))
    if np.sum(a * np.cross(b, c)) * (-1 if shape.has_flipped_normals() else 1) <= 0:
        raise _refusal(shape, "is inside out", "faces that run counter-clockwise seen from outside")


def check_apart(shapes: list[Any]) -> None:
    """Check that closed surfaces cross neither themselves nor one another, and that none lies within another.

    Raises InputError by the names of the shapes, with an edge that goes through a face.
    """
    scene = scene_from(shapes)
    for number, shape in enumerate(shapes):
        _check_crossings(scene, shapes, shape)
        others = shapes[:number] + shapes[number + 1 :]
        holder = enclosing(others, _outermost(shape)) if others else -1
        if holder >= 0:
            raise InputError(
                f"cloud '{shape.id()}' lies within cloud '{others[holder].id()}'; wanted clouds apart from one another"
            )


def enclosing(shapes: list[Any], point: Array) -> int:
    """Return the number of the closed surface around a point, (3,) [m], -1 if there is none.

    A ray from the point meets the surfaces that enclose it an odd number of times; the one met first from inside is it.
    """
    scene = scene_from(shapes)
    for direction in ((0.2672, 0.5345, 0.8018), (-0.6247, 0.3714, 0.6868)):
        ray = mi.Ray3f(mi.Point3f(*(float(c) for c in point)), mi.Vector3f(*direction))
        dr.make_opaque(ray)
        si = scene.ray_intersect(ray)
        dr.eval(si)
        if not bool(si.is_valid()[0]) or float(dr.dot(si.n, mi.Vector3f(*direction))[0]) <= 0:
            return -1
    hit = si.shape
    return next(number for number, shape in enumerate(shapes) if bool((hit == mi.ShapePtr(shape))[0]))


def _check_crossings(scene, shapes: list[Any], shape: Any) -> None:
    if not shape.is_mesh():
        return
    vertices, faces = _merged(shape)
    edges = np.unique(np.sort(np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    start, end = vertices[edges[:, 0]], vertices[edges[:, 1]]
    length = np.linalg.norm(end - start, axis=1)
    direction = (end - start) / length[:, None]
    corners = [_merged(other)[0][_merged(other)[1]] if other.is_mesh() else None for other in shapes]
    passed = np.zeros(len(edges))
    left = np.arange(len(edges))
    # Faces that share a corner with an edge may hide what lies behind them: the edge is cast on from there to its end.
    while left.size:
        origin = start[left] + passed[left, None] * direction[left]
        ray = mi.Ray3f(mi.Point3f(origin.T), mi.Vector3f(direction[left].T))
        ray.maxt = mi.Float(length[left] - passed[left])
        si = scene.ray_intersect_preliminary(ray)
        dr.eval(si)
        met = np.array(dr.reinterpret_array(mi.UInt32, si.shape))
        hit = np.array(si.is_valid(), dtype=bool)
        if not hit.any():
            return
        left, travelled = left[hit], passed[left[hit]] + np.array(si.t, dtype=np.float64)[hit]
        face = np.array(si.prim_index, dtype=np.int64)[hit]
        for other, of_faces in zip(shapes, corners, strict=True):
            on = (met == np.array(dr.reinterpret_array(mi.UInt32, mi.ShapePtr(other))))[hit]
            if of_faces is None:
                shares = np.zeros(int(on.sum()), dtype=bool)
            else:
                ends = np.stack([start[left[on]], end[left[on]]], axis=1)
                shares = (of_faces[face[on]][:, :, None] == ends[:, None]).all(axis=3).any(axis=(1, 2))
            if not shares.all():
                bad = left[on][~shares][0]
                through = "itself" if other is shape else f"cloud '{other.id()}'"
                raise _refusal(
                    shape, f"crosses {through}: edge {_edge(start[bad], end[bad])} goes through a face", "clouds apart"
                )
        passed[left] = travelled + 1e-6 * length[left] + 1e-6 * np.abs(start[left]).max(axis=1)
        left = left[passed[left] < length[left]]


def _outermost(shape: Any) -> Array:
    if shape.is_mesh():
        vertices, _ = _merged(shape)
        return np.asarray(vertices[np.argmax(vertices[:, 2])])
    box = shape.bbox()
    return np.array(0.5 * (box.min + box.max), dtype=np.float64).reshape(3)


def _merged(shape: Any) -> tuple[Array, Index]:
    parameters = mi.traverse(shape)
    vertices = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    vertices, same = np.unique(vertices, axis=0, return_inverse=True)
    return vertices, same.reshape(-1)[faces]


def _edge(a: Array, b: Array) -> str:
    return " - ".join("(" + ", ".join(f"{c:.6g}" for c in end) + ")" for end in (a, b))


def _refusal(shape: Any, fault: str, wanted: str) -> InputError:
    return InputError(f"shape '{shape.id()}' bounds a cloud and {fault}; wanted {wanted}")
