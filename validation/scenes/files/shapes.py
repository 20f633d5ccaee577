# SPDX-License-Identifier: BSD-3-Clause
"""Shapes of files made into shapes that all readers can read.

Instances are written out, lamps on boxes become rectangles, and windows of rooms full of fog the
boxes of that fog. Cylinders become meshes: every method and estimator then has the same triangles,
whose shadows are exact.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.reference.scene.transforms import matrix_of
from airlight.validation.arrays import Array
from airlight.validation.scenes.files.nodes import kind, of_kind, properties, references

# How far the corners of a rectangle may be off one plane, off a parallelogram and off right angles,
# as a fraction of its size; float32 rounds its coordinates by 6e-8.
_FLAT = 1e-5

_SIDES = 256  # of the mesh of a cylinder: it differs from it by 8e-5 of the radius
_POINTS = 16  # samples of a shape that decide where it lies


def write_out_instances(state: mi.parser.ParserState) -> None:
    """Replace instances of shape groups, and merged shapes, by plain shapes: the image is the same.

    The copy of a group's only shape has the name of the instance; copies of several shapes
    have the names of the instance and of the shape.
    """
    copies = [
        copy for _, index in references(properties(state, 0)) for copy in _copies(state, index)
    ]
    # Only now are nodes appended, which may move all nodes: nothing refers to one any more.
    for node in copies:
        state.nodes.append(node)
    # Properties are looked up again: the nodes may have moved in memory.
    scene = properties(state, 0)
    for key, index in references(scene):
        if properties(state, index).plugin_name() in ("shapegroup", "instance", "merge"):
            del scene[key]
    for number in range(len(state.nodes) - len(copies), len(state.nodes)):
        scene[f"_written_out_{number}"] = mi.Properties.ResolvedReference(number)


def _copies(state: mi.parser.ParserState, index: int) -> Iterator[mi.parser.SceneNode]:
    """Yield copies of the shapes of an instance or a merge; of other shapes none."""
    instance = properties(state, index)
    if instance.plugin_name() == "merge":
        yield from (
            mi.parser.SceneNode(state.nodes[at])
            for _, at in references(instance)
            if kind(state, at) == "Shape"
        )
    if instance.plugin_name() != "instance":
        return
    group = next(
        (
            at
            for _, at in references(instance)
            if properties(state, at).plugin_name() == "shapegroup"
        ),
        None,
    )
    if group is None:
        raise InputError(
            f"shape '{instance.id()}' is an instance of no shape group; expected a reference to one"
        )
    # Mitsuba places a part by its own transform first, then by the instance's.
    place = instance.get("to_world", mi.ScalarAffineTransform4d())
    parts = [at for _, at in references(properties(state, group)) if kind(state, at) == "Shape"]
    for part in parts:
        node = mi.parser.SceneNode(state.nodes[part])
        node.props["to_world"] = place @ node.props.get("to_world", mi.ScalarAffineTransform4d())
        node.props.set_id(f"{instance.id()}-{node.props.id()}" if len(parts) > 1 else instance.id())
        yield node


def cylinders_as_meshes(state: mi.parser.ParserState, folder: Path) -> list[str]:
    """Replace cylinders by meshes, which are written into a folder for Mitsuba to read; return
    notes on them.
    """
    notes = []
    for index in list(of_kind(state, "Shape")):
        old = properties(state, index)
        if old.plugin_name() != "cylinder":
            continue
        first, last = (
            np.array(old.get(name, end), dtype=np.float64)
            # the foot and head of Mitsuba's cylinder where the file gives none
            for name, end in (("p0", (0.0, 0.0, 0.0)), ("p1", (0.0, 0.0, 1.0)))
        )
        path = folder / f"cylinder-{index}.ply"
        _write_cylinder(path, first, last, float(old.get("radius", 1.0)))
        # The new node keeps the name, the transform, and the references to material, media and
        # emitter.
        new = mi.Properties("ply")
        new.set_id(old.id())
        new["filename"] = str(path)
        for name in ("to_world", "flip_normals"):
            if name in old:
                new[name] = old[name]
        for key, at in list(references(old)):
            new[key] = mi.Properties.ResolvedReference(at)
        state.nodes[index].props = new
        notes.append(
            f"shape '{old.id()}' is a cylinder: it is a mesh of {_SIDES} sides for all that follows"
        )
    return notes


def _write_cylinder(path: Path, first: Array, last: Array, radius: float) -> None:
    """Write the side of a cylinder with the normals of a round one, as a PLY file."""
    axis = last - first
    # The axis of coordinates least parallel to the cylinder's gives the cross product most digits.
    across = np.cross(axis, np.eye(3)[np.argmin(np.abs(axis))])
    across /= np.linalg.norm(across)
    turn = 2 * np.pi * np.arange(_SIDES)[:, None] / _SIDES
    normal = np.cos(turn) * across + np.sin(turn) * np.cross(axis / np.linalg.norm(axis), across)
    # One row for each vertex: position and normal; first all of one end, then all of the other.
    corners = np.concatenate(
        [np.concatenate([end + radius * normal, normal], axis=1) for end in (first, last)]
    )
    side = np.arange(_SIDES)
    after = (side + 1) % _SIDES
    faces = np.concatenate(
        [
            np.stack([side, after, side + _SIDES], axis=1),
            np.stack([after, after + _SIDES, side + _SIDES], axis=1),
        ]
    )
    names = "".join(f"property float {name}\n" for name in ("x", "y", "z", "nx", "ny", "nz"))
    header = f"ply\nformat binary_little_endian 1.0\nelement vertex {len(corners)}\n{names}"
    header += f"element face {len(faces)}\nproperty list uchar int vertex_indices\nend_header\n"
    rows = np.zeros(len(faces), dtype=[("count", "u1"), ("corners", "<i4", 3)])
    rows["count"], rows["corners"] = 3, faces
    path.write_bytes(header.encode() + corners.astype("<f4").tobytes() + rows.tobytes())


def lamps_as_rectangles(state: mi.parser.ParserState, shapes: Iterable[mi.Shape]) -> bool:
    """Replace lamps on meshes by rectangles where their triangles are halves of rectangles;
    return whether there was such a lamp.

    A lamp of one rectangle keeps its name; the rectangles of others have numbers after it.
    """
    nodes = {properties(state, index).id(): index for index in of_kind(state, "Shape")}
    lamps = [shape for shape in shapes if shape.is_emitter() and shape.id() in nodes]
    by_node = {nodes[shape.id()]: matrices for shape in lamps if (matrices := _rectangles(shape))}
    for index, matrices in by_node.items():
        _write_rectangles(state, index, matrices)
    return bool(by_node)


def _rectangles(shape: mi.Shape) -> list[Array]:
    """Return the transforms from Mitsuba's rectangle to the rectangles of a lamp's mesh, (4, 4)
    each [m]; none where its triangles make no rectangles.
    """
    parameters = mi.traverse(shape)
    if "faces" not in parameters:
        return []
    corners = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    # Vertices with the same coordinates are one: exporters write each triangle's corners apart.
    points, numbers = np.unique(corners[faces.ravel()], axis=0, return_inverse=True)
    halves: dict[tuple[int, int], list[list[int]]] = {}
    for face in numbers.reshape(-1, 3).tolist():
        # The side that both halves of a rectangle share is the longest of each; last is
        # the corner across from it.
        sides = [(face[i], face[(i + 1) % 3], face[(i + 2) % 3]) for i in range(3)]
        first, second, last = max(
            sides, key=lambda side: float(np.linalg.norm(points[side[0]] - points[side[1]]))
        )
        halves.setdefault((min(first, second), max(first, second)), []).append(
            [first, second, last]
        )
    # All triangles must pair into rectangles, and Mitsuba must sample the same surface: otherwise
    # the lamp stays a mesh.
    side = -1.0 if shape.has_flipped_normals() else 1.0
    rectangles = [_rectangle(points, pair, side) for pair in halves.values()]
    matrices = [matrix for matrix in rectangles if matrix is not None]
    most = 64  # rectangles of a lamp
    if len(matrices) < len(rectangles) or len(matrices) > most:
        return []
    return matrices if _shine_alike(shape, matrices) else []


def _rectangle(corners: Array, pair: list[list[int]], side: float) -> Array | None:
    """Return the transform of the rectangle of two triangles, (4, 4); None where they make none.

    `corners`: of the mesh, (points, 3) [m]; `pair`: of each triangle the numbers of its corners,
    both ends of the longest side first; `side`: 1, or -1 where the normals are flipped.
    """
    if len(pair) != 2:
        return None
    first, second, start = corners[pair[0]]
    # counter-clockwise from the side of the normal
    across, up = 0.5 * (first - start), 0.5 * (second - start)
    size = float(np.linalg.norm(first - second))
    # A rectangle: the fourth corner is first + second - start, the sides at `start` are
    # perpendicular, and the second triangle runs along the diagonal the other way.
    closes = np.linalg.norm(first + second - start - corners[pair[1][2]]) <= _FLAT * size
    if not closes or abs(across @ up) > _FLAT * size**2 or pair[0][:2] != pair[1][1::-1]:
        return None
    # Flipped normals: with the axes exchanged the normal of Mitsuba's rectangle points to the other
    # side.
    across, up = (across, up) if side > 0 else (up, across)
    normal = np.cross(across, up)
    matrix = np.eye(4)
    matrix[:3] = np.column_stack(
        [across, up, normal / np.linalg.norm(normal), 0.5 * (first + second)]
    )
    return matrix


def samples(shape: mi.Shape) -> tuple[Array, Array]:
    """Return points of a shape and the normals there, evenly spread, (points, 3) each."""
    number = np.arange(_POINTS)
    # An additive recurrence with the golden ratio: spread evenly over the unit square without
    # random numbers.
    place = mi.Point2f((number + 0.5) / _POINTS, number * 0.6180339887 % 1)
    sample = shape.sample_position(0.0, place)
    points, normals = (
        np.array(value, dtype=np.float64).reshape(3, -1).T for value in (sample.p, sample.n)
    )
    return points, np.broadcast_to(normals, points.shape)


def _shine_alike(shape: mi.Shape, matrices: list[Array]) -> bool:
    """Return whether points that Mitsuba samples on a lamp lie on rectangles and have
    their normals.
    """
    points, normals = samples(shape)
    size = max(float(np.linalg.norm(matrix[:3, :2])) for matrix in matrices)
    covered = np.zeros(_POINTS, dtype=bool)
    for matrix in matrices:
        # Coordinates in the rectangle's own frame, in which it is the square from -1 to 1 at height
        # 0.
        local = np.linalg.solve(matrix[:3, :3], (points - matrix[:3, 3]).T)
        inside = (np.abs(local[:2]) < 1 + 1e-3).all(axis=0) & (np.abs(local[2]) < 1e-3 * size)
        covered |= inside & (normals @ matrix[:3, 2] > 1 - 1e-4)
    return bool(covered.all())


def _write_rectangles(state: mi.parser.ParserState, index: int, matrices: list[Array]) -> None:
    """Replace a lamp by rectangles: the first takes its node, and each has an emitter."""
    name = properties(state, index).id()
    parts = list(references(properties(state, index)))
    for number, matrix in enumerate(matrices):
        rectangle = mi.Properties("rectangle")
        rectangle.set_id(f"{name}-{number + 1}" if len(matrices) > 1 else name)
        rectangle["to_world"] = mi.ScalarAffineTransform4d(matrix)
        for key, at in parts:
            # An emitter belongs to one shape: each further rectangle gets a copy of it.
            if number and kind(state, at) == "Emitter":
                state.nodes.append(mi.parser.SceneNode(state.nodes[at]))
                at = len(state.nodes) - 1
            rectangle[key] = mi.Properties.ResolvedReference(at)
        if number:
            state.nodes.append(mi.parser.SceneNode(state.nodes[index]))
            properties(state, 0)[f"{name}_{number}"] = mi.Properties.ResolvedReference(
                len(state.nodes) - 1
            )
        state.nodes[len(state.nodes) - 1 if number else index].props = rectangle


def rooms_as_boxes(state: mi.parser.ParserState, shapes: Iterable[mi.Shape]) -> list[str]:
    """Replace windows of rooms full of fog by boxes of that fog, and return notes on them.

    A window is a rectangle without a material that bounds a medium on one side, where opaque
    rectangles are the other five faces of a box. The box reaches a little beyond the walls:
    Mitsuba's rays lose a part of a surface that lies in a bound.
    """
    nodes = {properties(state, index).id(): index for index in of_kind(state, "Shape")}
    rectangles = [
        shape for shape in shapes if shape.id() in nodes and shape.class_name() == "Rectangle"
    ]
    walls = [_corners(_matrix(shape)) for shape in rectangles if not _is_null(shape)]
    notes = []
    for shape in rectangles:
        media = [
            medium
            for medium in (shape.interior_medium(), shape.exterior_medium())
            if medium is not None
        ]
        if not _is_null(shape) or len(media) != 1:
            continue
        # The interior medium of a rectangle lies on the side that its normal points away from. A
        # transform that mirrors, and flip_normals, turn the normal against the product of the sides.
        matrix = _matrix(shape)
        facing = np.sign(np.linalg.det(matrix[:3, :3])) * (-1 if shape.has_flipped_normals() else 1)
        room = _room(matrix, float(-facing if shape.interior_medium() else facing), walls)
        if room is None:
            continue
        box = mi.Properties("cube")
        box.set_id(shape.id())
        box["to_world"] = mi.ScalarAffineTransform4d(room)
        # A box has its medium inside, whichever side of the window it was on.
        for key, at in references(properties(state, nodes[shape.id()])):
            box["interior" if kind(state, at) == "Medium" else key] = (
                mi.Properties.ResolvedReference(at)
            )
        state.nodes[nodes[shape.id()]].props = box
        notes.append(
            f"shape '{shape.id()}' and the walls about its medium are read as a box of that medium"
        )
    return notes


def _is_null(shape: mi.Shape) -> bool:
    return bool(int(shape.bsdf().flags()) & int(mi.BSDFFlags.Null))


def _matrix(shape: mi.Shape) -> Array:
    return matrix_of(mi.traverse(shape)["to_world"])


def _corners(matrix: Array) -> Array:
    """Return the corners of a rectangle, (4, 3), one after the other."""
    signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
    return np.asarray(matrix[:3, 3] + signs @ matrix[:3, :2].T)


def _room(window: Array, side: float, walls: list[Array]) -> Array | None:
    """Return the transform from Mitsuba's cube to the room behind a window, (4, 4) [m]; None
    where walls are missing.

    `window`: the transform of its rectangle; `side`: 1 where the room lies on the side to which the
    cross product of the rectangle's sides points, else -1; `walls`: corners, (4, 3) each [m].
    """
    front = _corners(window)
    normal = np.cross(window[:3, 0], window[:3, 1])
    if not np.any(normal):  # it has no area, which its reader refuses
        return None
    inward = side * normal / np.linalg.norm(normal)
    size = float(np.linalg.norm(front[0] - front[2]))

    def stands(face: Array) -> bool:
        # The largest distance of a corner of the face from the nearest corner of a wall: the two
        # are one rectangle if it is about 0.
        gaps = (np.linalg.norm(face[:, None] - wall, axis=2).min(axis=1).max() for wall in walls)
        return any(gap <= _FLAT * size for gap in gaps)

    # The back wall is a wall at some depth behind the window; each wall's middle proposes a depth.
    depths = {float((wall.mean(axis=0) - window[:3, 3]) @ inward) for wall in walls}
    depth = next(
        (each for each in depths if each > _FLAT * size and stands(front + each * inward)), None
    )
    if depth is None:
        return None
    back = front + depth * inward
    # The other four faces join an edge of the window to the same edge of the back wall.
    ends = [[number, (number + 1) % 4] for number in range(4)]
    if not all(stands(np.concatenate([front[pair], back[pair]])) for pair in ends):
        return None
    # Mitsuba's cube goes from -1 to 1: half sides as columns. The axes are ordered so that the
    # matrix has a positive determinant.
    beyond = 1e-4  # of the room's size: how far its box of fog reaches beyond the walls
    across, up = ((1 + beyond) * window[:3, axis] for axis in ((0, 1) if side > 0 else (1, 0)))
    half = 0.5 * (depth + beyond * size) * inward
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([across, up, half, window[:3, 3] + half])
    return matrix
