# SPDX-License-Identifier: BSD-3-Clause
"""Reading a light with extent from a Mitsuba shape with an `area` emitter.

The shape is a `rectangle`, `disk` or `sphere` of constant radiance. Its material is opaque (black as Mitsuba's is for
an emitter that has none, else the shape is a surface like others too) or `null`.
"""

from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.area_lights.shape import AreaLight
from realtime.errors import InputError

Array = NDArray[np.float64]

_KINDS = {"Rectangle": "rectangle", "Disk": "disk", "Sphere": "sphere"}
_LEAST = 1e-12  #: half a side or a radius, of which float32 knows the square [m]
_SHEARED = 1e-4  #: of a length: how far from a right angle or from another length, after float32


def is_area_light(emitter) -> bool:
    """Return whether a Mitsuba emitter is the light of a shape."""
    return emitter.class_name() == "AreaLight"


def read_area_light(shape: Any, camera: Array) -> AreaLight:
    """Read the light of a Mitsuba shape.

    `shape`: a shape with an `area` emitter; `camera`: where the camera is, (3,) [m]. Raises InputError for a light that
    no method can render, with the name of its shape.
    """
    name = shape.id()
    kind = _KINDS.get(shape.class_name())
    if kind is None:
        raise InputError(
            f"light '{name}': its shape is a {shape.class_name()}; wanted a 'rectangle', 'disk' or 'sphere' with an "
            "'area' emitter, or in a file a mesh whose triangles are halves of rectangles"
        )
    radiance = _read_radiance(shape.emitter(), name)
    opaque = shape.bsdf().class_name() != "Null"
    if shape.interior_medium() is not None or shape.exterior_medium() is not None:
        raise InputError(f"light '{name}': its shape bounds a medium; wanted a light apart from the bounds of media")
    matrix = np.array(mi.traverse(shape)["to_world"].matrix, dtype=np.float64).reshape(4, 4)
    if not np.isfinite(matrix).all():
        raise InputError(f"light '{name}': its to_world holds numbers that are not finite")
    across, up, third = matrix[:3, 0], matrix[:3, 1], matrix[:3, 2]
    sizes = [float(np.linalg.norm(axis)) for axis in ((across, up, third) if kind == "sphere" else (across, up))]
    if not min(sizes) > _LEAST or not np.linalg.norm(np.cross(across, up)) > 1e-12 * sizes[0] * sizes[1]:
        raise InputError(f"light '{name}': the {kind} has no area; wanted a to_world that leaves it one")
    pairs = [(across, up)] + ([(up, third), (third, across)] if kind == "sphere" else [])
    if any(abs(a @ b) > _SHEARED * np.linalg.norm(a) * np.linalg.norm(b) for a, b in pairs):
        raise InputError(f"light '{name}': the {kind} is sheared; wanted a to_world of rotations, scales and shifts")
    if kind != "rectangle" and max(sizes) - min(sizes) > _SHEARED * max(sizes):
        scales = " x ".join(f"{size:g}" for size in sizes)
        raise InputError(f"light '{name}': the {kind} is scaled by {scales}; wanted one scale for all its axes")
    middle = matrix[:3, 3]
    normal = np.cross(across, up)
    if kind == "sphere":
        # Mitsuba 3.9.1 does not turn the normals that it samples on a sphere with the sphere.
        if shape.has_flipped_normals():
            raise InputError(f"light '{name}': the sphere shines inwards; remove flip_normals")
        if np.linalg.norm(camera - middle) <= sizes[0]:
            raise InputError(f"light '{name}': the camera is inside of the sphere; move the camera or the light")
    elif np.array(shape.sample_position(0.0, mi.Point2f(0.31, 0.47)).n, dtype=np.float64).ravel() @ normal < 0:
        normal = -normal
    return AreaLight(name, kind, middle, across, up, normal / np.linalg.norm(normal), radiance, opaque)


def _read_radiance(emitter, name: str) -> Array:
    parameters = mi.traverse(emitter)
    if "radiance.value" not in parameters:
        raise InputError(f"light '{name}': its radiance is textured or spectral; wanted a constant 'rgb' radiance")
    value = np.array(parameters["radiance.value"], dtype=np.float64).reshape(-1)
    value = np.broadcast_to(value, 3).copy() if value.size == 1 else value
    if not np.all(np.isfinite(value)) or np.any(value < 0):
        raise InputError(
            f"light '{name}': its radiance is {value.tolist()}; wanted finite values of 0 or more [W/(m^2 sr)]"
        )
    return value
