# SPDX-License-Identifier: BSD-3-Clause
"""Shapes of files made into shapes that both readers know: instances written out, lamps on flat quads as rectangles."""

from collections.abc import Iterable, Iterator
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from validation.scenes.files.nodes import kind, of_kind, properties, references

Array = NDArray[np.float64]

_FLAT = 1e-5  #: of a quad's size: corners beyond a plane, sides that are no parallelogram, sides off a right angle


def write_out_instances(state: Any) -> None:
    """Put shapes in the place of instances of shape groups: the same image, with shapes that all know.

    A group of one shape gives a shape with the name of the instance, others add the names of the group's shapes.
    """
    written = [copy for _, index in references(properties(state, 0)) for copy in _copies(state, index)]
    for node in written:  # by now nothing holds a node: to append one may move them all
        state.nodes.append(node)
    scene = properties(state, 0)
    for key, index in references(scene):
        if properties(state, index).plugin_name() in ("shapegroup", "instance"):
            del scene[key]
    for number in range(len(state.nodes) - len(written), len(state.nodes)):
        scene[f"_written_out_{number}"] = mi.Properties.ResolvedReference(number)


def _copies(state: Any, index: int) -> Iterator[Any]:
    """Yield the shapes of an instance as nodes of their own; none of what is no instance."""
    instance = properties(state, index)
    if instance.plugin_name() != "instance":
        return
    group = next((at for _, at in references(instance) if properties(state, at).plugin_name() == "shapegroup"), None)
    if group is None:
        raise InputError(f"shape '{instance.id()}' is an instance of no shape group; wanted a reference to one")
    place = instance.get("to_world", mi.ScalarAffineTransform4d())
    parts = [at for _, at in references(properties(state, group)) if kind(state, at) == "Shape"]
    for part in parts:
        node = mi.parser.SceneNode(state.nodes[part])
        node.props["to_world"] = place @ node.props.get("to_world", mi.ScalarAffineTransform4d())
        node.props.set_id(f"{instance.id()}-{node.props.id()}" if len(parts) > 1 else instance.id())
        yield node


def lamps_as_rectangles(state: Any, shapes: Iterable[Any]) -> bool:
    """Make lamps on meshes of two triangles rectangles, where they are; return whether there were any.

    Parameters
    ----------
    state
        The parsed file.
    shapes
        Its shapes as Mitsuba built them.
    """
    nodes = {properties(state, index).id(): index for index in of_kind(state, "Shape")}
    changed = False
    for shape in shapes:
        if not (shape.is_emitter() and shape.id() in nodes):
            continue
        matrix = _rectangle(shape)
        if matrix is None:
            continue
        node = state.nodes[nodes[shape.id()]]
        rectangle = mi.Properties("rectangle")
        rectangle.set_id(shape.id())
        for key, at in references(node.props):
            rectangle[key] = mi.Properties.ResolvedReference(at)
        rectangle["to_world"] = mi.ScalarAffineTransform4d(matrix)
        node.props = rectangle
        changed = True
    return changed


def _rectangle(shape: Any) -> Array | None:
    """Return the transform that makes Mitsuba's rectangle a mesh of two triangles, None where none does."""
    parameters = mi.traverse(shape)
    if "faces" not in parameters:
        return None
    corners = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    used, faces = np.unique(corners[faces.ravel()], axis=0, return_inverse=True)
    faces = faces.reshape(-1, 3)
    if len(faces) != 2 or len(used) != 4:
        return None
    shared = np.intersect1d(*faces)
    if len(shared) != 2:
        return None
    # From a corner that one triangle has alone, the ends of the common side are the ends of both sides.
    alone = [int(np.setdiff1d(face, shared)[0]) for face in faces]
    start, first, second = used[alone[0]], used[shared[0]], used[shared[1]]
    across, up = 0.5 * (first - start), 0.5 * (second - start)
    size = float(np.linalg.norm(used[alone[1]] - start))
    closes = np.linalg.norm(start + 2 * (across + up) - used[alone[1]]) <= _FLAT * size
    if not closes or abs(across @ up) > _FLAT * np.linalg.norm(across) * np.linalg.norm(up):
        return None
    normal = np.cross(across, up)
    normal /= np.linalg.norm(normal)
    towards = np.array(shape.sample_position(0.0, mi.Point2f(0.31, 0.47)).n, dtype=np.float64).ravel()
    if abs(normal @ towards) < 1 - 1e-4:
        return None  # normals of its vertices say otherwise
    if normal @ towards < 0:
        across, up, normal = up, across, -normal
    matrix = np.eye(4)
    matrix[:3] = np.column_stack([across, up, normal, 0.5 * (first + second)])
    return matrix
