# SPDX-License-Identifier: BSD-3-Clause
"""Area lights: their record, their triangles, and how they are read from Mitsuba's `area` emitters.

Every point of the surface sends the same radiance Le into all directions of the half space before
it. An element dA has the intensity Le cos dA in a direction at an angle whose cosine to the normal
is cos, and the power pi Le dA. The shape is a rectangle, disk, sphere or mesh; its material is
`null` or opaque, and without one it is black, as in Mitsuba.

Methods that know occluders by their triangles need the triangles of black lights. A disk and a
sphere have none: a polygon and a sphere of facets stand for them, as large in area and in mean
shadow. They shadow other lights, not their own.
"""

import math
from dataclasses import dataclass, field, replace
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.errors import InputError
from airlight.realtime.transforms import host_matrix, turned_outwards

Array = NDArray[np.float64]

KINDS = ("rectangle", "disk", "sphere", "mesh")


@dataclass(frozen=True)
class AreaLight:
    """An area light, on the host, in float64.

    A point of a rectangle or disk is middle + u across + v up, u and v from -1 to 1, for a disk
    with u^2 + v^2 <= 1. A mesh has the middle and the axes of a ball around it.
    """

    name: str  #: of its shape
    kind: str  #: of `KINDS`
    middle: Array  #: (3,) [m]
    across: Array  #: half of one side, or a radius, (3,) [m]
    up: Array  #: half of the other side, or another radius at a right angle, (3,) [m]
    normal: Array  #: of a rectangle or disk, which shine on this side alone; a unit vector (3,)
    radiance: Array  #: Le, RGB (3,) [W/(m^2 sr)]
    #: whether its shape is black, ends camera rays and shadows other lights;
    #: else it is nothing but light
    opaque: bool
    vertices: Array = field(default_factory=lambda: np.empty((0, 3)))  #: of a mesh [m]
    #: of a mesh: numbers of vertices, counter-clockwise from the side that shines, (triangles, 3)
    triangles: NDArray[np.int64] = field(default_factory=lambda: np.empty((0, 3), dtype=np.int64))
    folded: bool = False  #: whether parts of the shape can stand in the light of others

    @property
    def radius(self) -> float:
        """Radius of a disk or sphere [m]."""
        return float(np.linalg.norm(self.across))

    @property
    def area(self) -> float:
        """Emitting area [m^2]."""
        if self.kind == "mesh":
            return float(0.5 * np.linalg.norm(self.normals, axis=1).sum())
        across, up = float(np.linalg.norm(self.across)), float(np.linalg.norm(self.up))
        return {"rectangle": 4.0, "disk": math.pi, "sphere": 4 * math.pi}[self.kind] * across * up

    @property
    def normals(self) -> Array:
        """Vectors along the normals of the triangles of a mesh, twice as long
        as these are large [m^2].
        """
        first, second, third = (self.vertices[self.triangles[:, corner]] for corner in range(3))
        return np.cross(second - first, third - first)

    @property
    def power(self) -> Array:
        """Radiant flux pi Le A, RGB (3,) [W]."""
        return math.pi * self.area * self.radiance


def turned_area_light(light: AreaLight, about: Array, turn: Array) -> AreaLight:
    """Return a light turned about a point (3,) [m] by a rotation matrix (3, 3)."""
    middle = about + turn @ (light.middle - about)
    axes = {name: turn @ getattr(light, name) for name in ("across", "up", "normal")}
    return replace(light, middle=middle, vertices=about + (light.vertices - about) @ turn.T, **axes)


_SIDES, _RINGS = 64, 32  #: facets around a disk or sphere, and from pole to pole of a sphere


def occluder_vertices(light: AreaLight) -> Array:
    """Return the vertices of the triangles of a light, (vertices, 3) [m]."""
    if light.kind == "mesh":
        return light.vertices
    if light.kind == "rectangle":
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return np.array([light.middle + u * light.across + v * light.up for u, v in corners])
    # Around the axis, for a disk and for each ring of a sphere.
    angle = 2 * math.pi * (np.arange(_SIDES) + 0.5) / _SIDES
    circle = np.cos(angle)[:, None] * light.across + np.sin(angle)[:, None] * light.up
    # A regular polygon in a circle has sin(2 pi/n)/(2 pi/n) of its area: this one is as large.
    wide = math.sqrt(2 * math.pi / _SIDES / math.sin(2 * math.pi / _SIDES))
    if light.kind == "disk":
        return np.concatenate([light.middle + wide * circle, light.middle[None]])
    # A sphere: rings of vertices from pole to pole, and the poles at the end.
    pole = np.cross(light.across, light.up) / light.radius
    polar = math.pi * np.arange(1, _RINGS) / _RINGS
    rings = [light.middle + wide * (math.sin(a) * circle + math.cos(a) * pole) for a in polar]
    return np.concatenate([*rings, [light.middle + wide * pole, light.middle - wide * pole]])


def occluder_triangles(light: AreaLight) -> NDArray[np.int64]:
    """Return the numbers of the vertices of its triangles, (triangles, 3)."""
    if light.kind == "mesh":
        return light.triangles
    if light.kind == "rectangle":
        return np.array([[0, 1, 2], [0, 2, 3]])
    # A vertex of the circle, and the next one around it.
    i = np.arange(_SIDES)
    j = (i + 1) % _SIDES
    if light.kind == "disk":
        return np.stack([i, j, np.full(_SIDES, _SIDES)], axis=1)
    # Two triangles between each pair of neighbours on two rings; below they end at the poles.
    faces = []
    for ring in range(_RINGS - 2):
        near, far = ring * _SIDES, (ring + 1) * _SIDES
        faces += [
            np.stack([near + i, far + i, far + j], axis=1),
            np.stack([near + i, far + j, near + j], axis=1),
        ]
    last_ring, top = (_RINGS - 2) * _SIDES, (_RINGS - 1) * _SIDES
    faces += [
        np.stack([np.full(_SIDES, top), i, j], axis=1),
        np.stack([last_ring + j, last_ring + i, np.full(_SIDES, top + 1)], 1),
    ]
    return np.concatenate(faces)


_KINDS = {"Rectangle": "rectangle", "Disk": "disk", "Sphere": "sphere"}


def read_area_light(shape: Any, camera: Array) -> AreaLight:
    """Read the light of a Mitsuba shape.

    `shape`: a shape with an `area` emitter; `camera`: where the camera is, (3,) [m]. Raises
    InputError for a light that no method can render, with the name of its shape.
    """
    name = shape.id()
    kind = _KINDS.get(shape.class_name())
    if kind is None and not shape.is_mesh():
        raise InputError(
            f"light '{name}': its shape is a {shape.class_name().lower()}; expected a 'rectangle', "
            "'disk', 'sphere' or mesh with an 'area' emitter"
        )
    # A `null` material lets camera rays and the light of others pass.
    radiance = _read_radiance(shape.emitter(), name)
    opaque = shape.bsdf().class_name() != "Null"
    if shape.interior_medium() is not None or shape.exterior_medium() is not None:
        raise InputError(
            f"light '{name}': its shape bounds a medium; expected a light apart from the bounds of "
            "media"
        )
    if kind is None:
        return _read_mesh(shape, radiance, opaque)
    # The columns of to_world are the axes of the shape: u, v, and for a sphere the third radius.
    matrix = host_matrix(mi.traverse(shape)["to_world"])
    if not np.isfinite(matrix).all():
        raise InputError(f"light '{name}': its to_world holds numbers that are not finite")
    across, up, third = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
    sizes = [
        float(np.linalg.norm(axis))
        for axis in ((across, up, third) if kind == "sphere" else (across, up))
    ]
    # The smallest half side or radius [m]; float32 has its square.
    least = 1e-12
    if (
        not min(sizes) > least
        or not np.linalg.norm(np.cross(across, up)) > 1e-12 * sizes[0] * sizes[1]
    ):
        raise InputError(
            f"light '{name}': the {kind} has no area; expected a to_world that leaves it one"
        )
    # How far float32 may bring axes from a right angle, or from another length, of a length.
    sheared = 1e-4
    pairs = [(across, up)] + ([(up, third), (third, across)] if kind == "sphere" else [])
    if any(abs(a @ b) > sheared * np.linalg.norm(a) * np.linalg.norm(b) for a, b in pairs):
        raise InputError(
            f"light '{name}': the {kind} is sheared; expected a to_world of rotations, scales and "
            "shifts"
        )
    if kind != "rectangle" and max(sizes) - min(sizes) > sheared * max(sizes):
        scales = " x ".join(f"{size:g}" for size in sizes)
        raise InputError(
            f"light '{name}': the {kind} is scaled by {scales}; expected one scale for all its axes"
        )
    # A sphere shines outwards. A flat shape shines on the side that Mitsuba's samples on it say:
    # they count a mirrored to_world and flipped normals.
    middle = matrix[:3, 3]
    normal = np.cross(across, up)
    if kind == "sphere":
        # Mitsuba 3.9.1 does not turn the normals that it samples on a sphere with the sphere.
        if shape.has_flipped_normals():
            raise InputError(f"light '{name}': the sphere shines inwards; {turned_outwards(shape)}")
        if np.linalg.norm(camera - middle) <= sizes[0]:
            raise InputError(
                f"light '{name}': the camera is inside of the sphere; move the camera or the light"
            )
    elif (
        np.array(shape.sample_position(0.0, mi.Point2f(0.31, 0.47)).n, dtype=np.float64).ravel()
        @ normal
        < 0
    ):
        normal = -normal
    return AreaLight(
        name, kind, middle, across, up, normal / np.linalg.norm(normal), radiance, opaque
    )


def _read_mesh(shape: Any, radiance: Array, opaque: bool) -> AreaLight:
    """Read a mesh. The order of vertices says which side of a triangle shines, or their
    normals if there are any.
    """
    vertices = _rows(shape.vertex_positions_buffer())
    triangles = _rows(shape.faces_buffer()).astype(np.int64)
    if not np.isfinite(vertices).all():
        raise InputError(f"light '{shape.id()}': its vertices hold numbers that are not finite")
    # Normals by the order of the vertices, twice as long as triangles are large.
    corners = vertices[triangles]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    twice = np.linalg.norm(normals, axis=1)
    if not twice.any():
        raise InputError(
            f"light '{shape.id()}': the mesh has no area; expected triangles that have some"
        )
    # Vertex normals, where there are any, say which side shines; `flip_normals` turns either.
    inverted = shape.has_flipped_normals()
    if shape.has_vertex_normals():
        along = np.einsum("tcx,tx->t", _rows(shape.vertex_normals_buffer())[triangles], normals)
        turned = (along < 0) != inverted
    else:
        turned = np.full(len(triangles), inverted)
    # Counter-clockwise from the side that shines; triangles without area shine nowhere.
    triangles[turned] = triangles[turned][:, [0, 2, 1]]
    normals[turned] *= -1
    triangles, normals = triangles[twice > 0], normals[twice > 0]
    # Middle and axes of a ball around the mesh, for the code that asks how large a light is.
    corners = vertices[triangles].reshape(-1, 3)
    middle = (corners.max(axis=0) + corners.min(axis=0)) / 2
    radius = float(np.linalg.norm(corners - middle, axis=1).max())
    x, y, z = np.eye(3)
    light = AreaLight(
        shape.id(), "mesh", middle, radius * x, radius * y, z, radiance, opaque, vertices, triangles
    )
    return replace(light, folded=opaque and _is_folded(light, normals))


def _rows(buffer: Any) -> Array:
    return np.array(buffer, dtype=np.float64).reshape(-1, 3)


def _is_folded(light: AreaLight, normals: Array) -> bool:
    """Return whether a vertex lies before the plane of a triangle; yes for
    a mesh too large to look.
    """
    # How far before a triangle float32 may bring a vertex that lies in its plane: a millionth of
    # the mesh's size and place [m].
    vertices = light.vertices[np.unique(light.triangles)]
    count, flat = len(vertices), 1e-6 * (light.radius + float(np.abs(light.middle).max()))
    # Every vertex against every triangle: as many pairs as are looked at, in all and at once.
    most, at_once = 1e9, 1 << 22
    if count * len(normals) > most:
        return True
    unit = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    offset = (unit * light.vertices[light.triangles[:, 0]]).sum(axis=1)
    rows = max(1, at_once // count)
    for start in range(0, len(unit), rows):
        height = vertices @ unit[start : start + rows].T - offset[start : start + rows]
        if height.max() > flat:
            return True
    return False


def _read_radiance(emitter, name: str) -> Array:
    # A texture or a spectrum has other parameters.
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise InputError(
            f"light '{name}': its radiance is textured or spectral; expected a constant 'rgb' "
            "radiance"
        )
    value = np.array(parameters["radiance.value"], dtype=np.float64).reshape(-1)
    # A grey radiance has one number.
    value = np.broadcast_to(value, 3).copy() if value.size == 1 else value
    if not np.all(np.isfinite(value)) or np.any(value < 0):
        raise InputError(
            f"light '{name}': its radiance is {value.tolist()}; expected finite values of 0 or "
            "more [W/(m^2 sr)]"
        )
    return value
