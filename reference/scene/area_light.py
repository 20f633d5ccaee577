# SPDX-License-Identifier: BSD-3-Clause
"""Lights with extent: Mitsuba's `area` emitters of constant radiance on rectangles, disks and spheres.

A rectangle and a disk emit from the side of their normal, a sphere outwards. The material is opaque (the shape is a
surface like others, most often a black one) or `null` (the shape is nothing but its emission).
"""

from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError

Array = NDArray[np.float64]

_KINDS = {"Rectangle": "rectangle", "Disk": "disk", "Sphere": "sphere"}
_SQUARE = 1e-5  # scales and angles of a float32 transform that differ by less are meant to be equal


@dataclass(frozen=True)
class TruthAreaLight:
    """A rectangle, disk or sphere of constant radiance."""

    kind: str  #: "rectangle", "disk" or "sphere"
    centre: Array  #: [m], (3,)
    frame: Array  #: unit vectors as rows, (3, 3): along both sides, and the normal of the side that emits
    half: Array  #: half of both sides, (2,) [m]; of a disk and a sphere twice the radius
    radiance: Array  #: [W/(m^2 sr)], RGB
    opaque: bool  #: whether the shape is a surface too; else it is `null`, and neither shadows nor ends rays
    shape: Any  #: Mitsuba's shape

    @property
    def name(self) -> str:
        """The id of the shape."""
        return str(self.shape.id())

    @property
    def normal(self) -> Array:
        """The normal of the side that emits, of a rectangle or a disk, (3,)."""
        return self.frame[2]

    @property
    def radius(self) -> float:
        """Of a disk or a sphere; of a rectangle that of the circle around it [m]."""
        return float(np.hypot(*self.half)) if self.kind == "rectangle" else float(self.half[0])

    @property
    def area(self) -> float:
        """Of the surface that emits [m^2]."""
        if self.kind == "rectangle":
            return float(4 * self.half[0] * self.half[1])
        return float((np.pi if self.kind == "disk" else 4 * np.pi) * self.radius**2)

    @property
    def corners(self) -> Array:
        """Of a rectangle, in order, (4, 3) [m]."""
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return self.centre + (signs * self.half) @ self.frame[:2]

    @property
    def power(self) -> Array:
        """Radiant flux [W], RGB: pi times radiance times area."""
        return np.pi * self.area * self.radiance


def is_area(emitter: Any) -> bool:
    """Return whether an emitter of Mitsuba is an area light."""
    return bool(emitter.class_name() == "AreaLight")


def read_area_light(emitter: Any, camera: Array) -> TruthAreaLight:
    """Read an area light.

    `emitter`: Mitsuba's; `camera`: position of the camera [m], (3,). Raises InputError by the name of the shape: for
    other shapes, textures, shapes without area or with different scales, a sphere that is inside out or holds the
    camera, and a light that bounds a medium.
    """
    shape = emitter.get_shape()
    kind = _KINDS.get(shape.class_name())
    if kind is None:
        what = "a mesh" if shape.is_mesh() else f"a {shape.class_name()}"
        raise _refusal(
            shape,
            f"is {what}",
            "a rectangle, a disk, a sphere, or in a file a mesh whose triangles are halves of rectangles",
        )
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise _refusal(shape, "has a texture as radiance", "one radiance: give its mean as 'rgb'")
    if shape.interior_medium() is not None or shape.exterior_medium() is not None:
        raise _refusal(shape, "bounds a medium", "two shapes, one that emits and one of material 'null' for the medium")
    flat = np.array(parameters["radiance.value"], dtype=np.float64).reshape(-1)
    matrix = np.array(mi.traverse(shape)["to_world"].matrix, dtype=np.float64).reshape(4, 4)
    frame, half = _sides(shape, kind, matrix)
    opaque = shape.bsdf().class_name() != "Null"
    light = TruthAreaLight(kind, matrix[:3, 3], frame, half, np.resize(flat, 3), opaque, shape)
    if kind == "sphere" and np.linalg.norm(camera - light.centre) <= light.radius * (1 + _SQUARE):
        raise _refusal(shape, "holds the camera", "a camera outside of lights: move it, or make the sphere smaller")
    return light


def _sides(shape: Any, kind: str, matrix: Array) -> tuple[Array, Array]:
    """Return the frame and half the sides; refuse shapes without area and with different scales."""
    axes = matrix[:3, :3].T
    used = axes if kind == "sphere" else axes[:2]
    length = np.linalg.norm(used, axis=1)
    if not np.all(np.isfinite(matrix)) or length.min() <= _SQUARE**2 * max(1.0, length.max()):
        raise _refusal(shape, "has no area", "scales above zero")
    unit = used / length[:, None]
    if np.abs(unit @ unit.T - np.eye(len(unit))).max() > _SQUARE:
        raise _refusal(shape, "is sheared", "axes at right angles to each other")
    if kind != "rectangle" and np.ptp(length) > _SQUARE * length.max():
        raise _refusal(shape, "has different scales along its axes", f"one scale: Mitsuba's {kind} is round")
    # Mitsuba says to which side the normal points; in float64 it is at right angles to the sides.
    across = np.cross(unit[0], unit[1])
    if kind == "sphere":
        if shape.has_flipped_normals():
            raise _refusal(shape, "is inside out", "a sphere that emits outwards: remove flip_normals")
        # Mitsuba takes the length of the first axis for the radius, see `reference.scene.shapes`.
        return np.stack([unit[0], unit[1], across]), np.full(2, length[0])
    towards = np.array(shape.sample_position(0.0, mi.Point2f(0.5)).n, dtype=np.float64).reshape(3)
    second = np.cross(across, unit[0])
    half = length if kind == "rectangle" else np.full(2, length[0])
    return np.stack([unit[0], second, across * np.sign(across @ towards)]), half


def _refusal(shape: Any, given: str, wanted: str) -> InputError:
    return InputError(f"light '{shape.id()}' {given}; wanted {wanted}")
