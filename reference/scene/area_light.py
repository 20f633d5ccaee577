# SPDX-License-Identifier: BSD-3-Clause
"""Area lights: Mitsuba's `area` emitters of constant radiance on rectangles,
disks, spheres and meshes.

A rectangle, a disk and a triangle emit from the side of their normal, a sphere outwards. Normals at
vertices, which only smooth the look of a mesh, say which side of its triangles that is, and nothing
more. The material is opaque (the shape is a surface like others, most often a black one) or `null`
(the shape is nothing but its emission).
"""

from dataclasses import dataclass, field, replace

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.reference.scene.colours import colour
from airlight.reference.scene.transforms import SAME, matrix_of, outwards

Array = NDArray[np.float64]

_KINDS = {"Rectangle": "rectangle", "Disk": "disk", "Sphere": "sphere"}


@dataclass(frozen=True)
class ReferenceAreaLight:
    """A rectangle, disk, sphere or mesh of constant radiance."""

    kind: str  #: "rectangle", "disk", "sphere" or "mesh"
    centre: Array  #: [m], (3,)
    #: unit vectors as rows, (3, 3): along both sides, and the normal of the side that emits
    frame: Array
    #: half of both sides, (2,) [m]; of a disk and a sphere twice the radius, of a
    #: mesh of a ball around it
    half: Array
    radiance: Array  #: [W/(m^2 sr)], RGB
    #: whether the shape is a surface too; else it is `null`, and neither shadows nor ends rays
    opaque: bool
    shape: "mi.Shape"
    #: of a mesh, each moved a hair along its normal, counter-clockwise from the side that emits,
    #: (triangles, 3, 3) [m]
    triangles: Array = field(default_factory=lambda: np.empty((0, 3, 3)))
    #: whether the shape is opaque, and parts of it can stand in the light of other parts
    shadows_itself: bool = False

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
        """Radius of a disk or sphere, or of the circle around a rectangle [m]."""
        return float(np.hypot(*self.half)) if self.kind == "rectangle" else float(self.half[0])

    @property
    def area(self) -> float:
        """Emitting area [m^2]."""
        if self.kind == "mesh":
            return float(triangle_areas(self.triangles).sum())
        if self.kind == "rectangle":
            return float(4 * self.half[0] * self.half[1])
        return float((np.pi if self.kind == "disk" else 4 * np.pi) * self.radius**2)

    @property
    def corners(self) -> Array:
        """Corners of a rectangle, in order, (4, 3) [m]."""
        signs = np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
        return self.centre + (signs * self.half) @ self.frame[:2]

    @property
    def power(self) -> Array:
        """Radiant flux [W], RGB: pi times radiance times area."""
        return np.pi * self.area * self.radiance


def triangle_normals(triangles: Array) -> Array:
    """Return vectors along the normals of triangles, whose lengths are twice the areas,
    (triangles, 3) [m^2].
    """
    return np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])


def triangle_areas(triangles: Array) -> Array:
    """Return the areas of triangles, (triangles,) [m^2]."""
    return 0.5 * np.linalg.norm(triangle_normals(triangles), axis=1)


def is_area(emitter: "mi.Emitter") -> bool:
    """Return whether an emitter is an area light."""
    return bool(emitter.class_name() == "AreaLight")


def read_area_light(emitter: "mi.Emitter", camera: Array) -> ReferenceAreaLight:
    """Read an area light.

    `emitter`: an emitter of type `area`; `camera`: position of the camera [m], (3,). Raises
    InputError by the name of the shape: for other shapes, textures, shapes without area or with
    different scales, a sphere that is inside out or holds the camera, and a light that bounds a
    medium.
    """
    shape = emitter.get_shape()
    kind = _KINDS.get(shape.class_name())
    if kind is None and not shape.is_mesh():
        raise _refusal(
            shape, f"is a {shape.class_name().lower()}", "a rectangle, a disk, a sphere, or a mesh"
        )
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise _refusal(shape, "has a texture as radiance", "one radiance: give its mean as 'rgb'")
    if shape.interior_medium() is not None or shape.exterior_medium() is not None:
        raise _refusal(
            shape,
            "bounds a medium",
            "two shapes, one that emits and one of material 'null' for the medium",
        )
    radiance = colour(parameters["radiance.value"], f"light '{shape.id()}': its radiance")
    opaque = shape.bsdf().class_name() != "Null"
    if kind is None:
        return _mesh(shape, radiance, opaque)
    # Rectangles, disks and spheres follow from their transform alone.
    matrix = matrix_of(mi.traverse(shape)["to_world"])
    frame, half = _sides(shape, kind, matrix)
    light = ReferenceAreaLight(kind, matrix[:3, 3], frame, half, radiance, opaque, shape)
    # A sphere emits outwards: a camera inside of it would see no light.
    if kind == "sphere" and np.linalg.norm(camera - light.centre) <= light.radius * (1 + SAME):
        raise _refusal(
            shape,
            "holds the camera",
            "a camera outside of lights: move it, or make the sphere smaller",
        )
    return light


def _mesh(shape: "mi.Shape", radiance: Array, opaque: bool) -> ReferenceAreaLight:
    parameters = mi.traverse(shape)
    corners = np.array(parameters["vertex_positions"], dtype=np.float64).reshape(-1, 3)
    faces = np.array(parameters["faces"], dtype=np.int64).reshape(-1, 3)
    normal = triangle_normals(corners[faces])
    sound = np.linalg.norm(normal, axis=1) > 0
    if not np.isfinite(corners).all() or not sound.any():
        raise _refusal(shape, "has no area", "a mesh with triangles that have one")
    # Triangles without area have no normal and emit nothing.
    faces, normal = faces[sound], normal[sound]
    # Corners are ordered counter-clockwise from the side that emits: the side of the normals at
    # vertices, where there are any, and the opposite side if normals are flipped.
    back = np.full(len(faces), shape.has_flipped_normals())
    smooth = np.array(parameters.get("vertex_normals", ()), dtype=np.float64)
    if smooth.size:
        back ^= np.sum(smooth.reshape(-1, 3)[faces].sum(axis=1) * normal, axis=1) < 0
    faces = np.where(back[:, None], faces[:, ::-1], faces)
    normal = triangle_normals(corners[faces])
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    # The ball around the mesh, about the middle of its bounding box.
    points = corners[np.unique(faces)]
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    radius = float(np.linalg.norm(points - centre, axis=1).max())
    size = radius + float(np.abs(centre).max())
    # Light starts before the triangles by 1e-9 of the mesh's size and place, so that they do not
    # hide it. Corners up to 1e-6 of the same before a triangle are in its plane: float32.
    triangles = corners[faces] + 1e-9 * size * normal[:, None]
    hides = opaque and not _is_convex(corners[faces][:, 0], normal, points, 1e-6 * size)
    light = ReferenceAreaLight(
        "mesh", centre, np.eye(3), np.full(2, radius), radiance, opaque, shape
    )
    return replace(
        light, triangles=triangles[_neighbours(triangles.mean(axis=1))], shadows_itself=hides
    )


def _neighbours(place: Array) -> NDArray[np.int64]:
    """Return an order of points, (n, 3), in which neighbours follow one another: by the bits of all
    coordinates in turn (Morton).
    """
    bits = 16  # of a coordinate, by which triangles are put in order
    low, high = place.min(axis=0), place.max(axis=0)
    cell = (
        (place - low) / max(float((high - low).max()), np.finfo(float).tiny) * ((1 << bits) - 1)
    ).astype(np.int64)
    code = np.zeros(len(place), np.int64)
    for bit in range(bits):
        for axis in range(3):
            code |= (cell[:, axis] >> bit & 1) << (3 * bit + axis)
    return np.argsort(code, kind="stable")


def _is_convex(corner: Array, normal: Array, points: Array, slack: float) -> bool:
    """Return whether no point of a mesh is before one of its triangles; False for a mesh that is
    too large to test.
    """
    # To look at more than 1e9 pairs of a triangle and a point takes too long.
    if float(len(corner)) * len(points) > 1e9:
        return False
    # All points lie behind or in the plane of each triangle, a block of triangles at a time.
    step = max(1, (1 << 22) // len(points))
    blocks = (slice(first, first + step) for first in range(0, len(corner), step))
    level = np.sum(corner * normal, axis=1)
    return all(
        ((normal[block] @ points.T).max(axis=1) <= level[block] + slack).all() for block in blocks
    )


def _sides(shape: "mi.Shape", kind: str, matrix: Array) -> tuple[Array, Array]:
    """Return the frame and half the sides; refuse shapes without area and with different scales."""
    # The columns of the matrix are the images of the axes; half of both sides are their lengths.
    axes = matrix[:3, :3].T
    used = axes if kind == "sphere" else axes[:2]
    length = np.linalg.norm(used, axis=1)
    if not np.all(np.isfinite(matrix)) or length.min() <= SAME**2 * max(1.0, length.max()):
        raise _refusal(shape, "has no area", "scales above zero")
    # A float32 transform is at right angles, and has one scale, up to `SAME`.
    unit = used / length[:, None]
    if np.abs(unit @ unit.T - np.eye(len(unit))).max() > SAME:
        raise _refusal(shape, "is sheared", "axes at right angles to each other")
    if kind != "rectangle" and np.ptp(length) > SAME * length.max():
        raise _refusal(
            shape, "has different scales along its axes", f"one scale: Mitsuba's {kind} is round"
        )
    # Mitsuba says to which side the normal points; in float64 it is at right angles to the sides.
    across = np.cross(unit[0], unit[1])
    if kind == "sphere":
        if shape.has_flipped_normals():
            raise _refusal(shape, "is inside out", outwards(matrix))
        # Mitsuba takes the length of the first axis for the radius, see `reference.scene.shapes`.
        return np.stack([unit[0], unit[1], across]), np.full(2, length[0])
    towards = np.array(shape.sample_position(0.0, mi.Point2f(0.5)).n, dtype=np.float64).reshape(3)
    second = np.cross(across, unit[0])
    half = length if kind == "rectangle" else np.full(2, length[0])
    return np.stack([unit[0], second, across * np.sign(across @ towards)]), half


def _refusal(shape: "mi.Shape", given: str, expected: str) -> InputError:
    return InputError(f"light '{shape.id()}' {given}; expected {expected}")
