# SPDX-License-Identifier: BSD-3-Clause
"""The numbers of a scene: each is refused by name where no float32 arithmetic can
give a finite image with it.

Mitsuba takes NaN, infinity and 1e30 nearly everywhere. The methods square lengths, and the area of
a triangle and the planes of a silhouette need the fourth power of a coordinate: of 1e9 m that is
1e36, below the largest float32 number, 3.4e38. An intensity is divided by a square and multiplied
by coefficients, so its limit is lower than the type's.
"""

from __future__ import annotations

from collections.abc import Iterator

import mitsuba as mi
import numpy as np

from airlight.errors import InputError
from airlight.realtime.scene.rounding import check_rounding
from airlight.validation.arrays import Array

LARGEST_LENGTH = 1e9  #: of a coordinate or a radius [m], also of an extinction [1/m]
LARGEST_LIGHT = 1e18  #: of an intensity [W/sr] or an irradiance [W/m^2]

_LIGHT = ("intensity", "irradiance", "radiance")
_NOT_NEGATIVE = (*_LIGHT, "sigma_t", "albedo", "scale")
_PLACES = ("z_1", "z_2", "floor", "cap", "up")  # of height fog
_CUTOFF = "cutoff_angle"  # of spots, half of the cone [degrees]

_CLIP = ("near_clip", "far_clip")  # no method uses them, see `validation.scenes.files.camera`
_UNUSED = ("vertex_texcoords",)


def check_numbers(scene: mi.Scene) -> None:
    """Refuse a scene with a number that no image can be computed from, by the name of its part.

    A scene whose lengths are lost in its coordinates is refused too (`realtime.scene.rounding`).
    """
    for name, plugin in _plugins(scene):
        parameters = mi.traverse(plugin)
        for key in parameters.keys():  # noqa: SIM118 - SceneParameters iterates over items
            values = _numbers(_parameter(parameters, key))
            if values is not None:
                _check(name, key, values)
        if "faces" in parameters:
            _check_faces(name, parameters)
    check_rounding(scene)


def _plugins(scene: mi.Scene) -> Iterator[tuple[str, mi.Object]]:
    """Yield the parts of a scene with names that a user knows; media first, which are parts of
    others too.
    """
    # Media are checked under their own names before the shapes and cameras that hold them.
    media = [sensor.get_medium() for sensor in scene.sensors()]
    for shape in scene.shapes():
        media += [shape.interior_medium(), shape.exterior_medium()]
    parts = (
        ("medium", media),
        ("camera", scene.sensors()),
        ("light", scene.emitters()),
        ("shape", scene.shapes()),
    )
    for kind, plugins in parts:
        for number, plugin in enumerate(plugins, 1):
            if plugin is not None:
                yield _name(kind, plugin, number), plugin


def _name(kind: str, plugin: mi.Object, number: int) -> str:
    return f"{kind} '{plugin.id()}'" if plugin.id() else f"{kind} {number}"


def _parameter(parameters: mi.SceneParameters, key: str) -> object:
    """Return a parameter; None where a plugin has no value for it, on which Mitsuba's look-up
    fails.
    """
    try:
        return parameters[key]
    except TypeError:
        return None


def _numbers(value: object) -> Array | None:
    """Return the numbers of a parameter; None where it has none."""
    if value is None:
        return None
    # By the name of the type: a colour has a `matrix` too, a swizzle that holds its
    # first channel six times.
    matrix = getattr(value, "matrix", value) if "Transform" in type(value).__name__ else value
    try:
        return np.array(matrix, dtype=np.float64)
    except (TypeError, ValueError):
        return None


def _check(name: str, key: str, values: Array) -> None:
    words = key.split(".")
    if words[-1] in _UNUSED:
        return
    if words[-1] == _CUTOFF and not np.all((values > 0) & (values < 90)):
        raise InputError(
            f"{name}: {key} has {values.ravel()[0]:g} degrees; expected more than 0 and less than "
            "90: a wider light is "
            "a 'point' light"
        )
    # The limit depends on the quantity: lights to 1e18, lengths and extinctions to 1e9, clip planes
    # unlimited, since no method reads them.
    light = any(word in _LIGHT for word in words)
    largest = np.inf if words[-1] in _CLIP else LARGEST_LIGHT if light else LARGEST_LENGTH
    if "albedo" in words:
        largest = 1 + 1e-6  # an albedo of 1 with its rounding
    least = (
        0.0
        if any(word in _NOT_NEGATIVE for word in words) and words[-1] not in _PLACES
        else -largest
    )
    # The comparison is negated so that NaN counts as wrong.
    wrong = ~((values >= least) & (values <= largest))
    if wrong.any():
        # The message names the number of bad places: a mesh has thousands of coordinates.
        advice = (
            "a medium scatters no more than arrives"
            if "albedo" in words
            else "use other units, or the right sign"
        )
        given = f"{values[wrong].ravel()[0]:g}"
        given += f" in {int(wrong.sum())} of {values.size} places" if values.size > 1 else ""
        wanted = f"finite numbers {'from 0 to' if least == 0 else 'of at most'} {largest:.3g}"
        raise InputError(
            f"{name}: {key.removesuffix('.value').removesuffix('.value')} has {given}; expected "
            f"{wanted}: {advice}"
        )
    if words[-1] == "to_world":
        _check_transform(name, key, values.reshape(4, 4))


def _check_transform(name: str, key: str, matrix: Array) -> None:
    # Singular values are the half axes of the ellipsoid that the transform makes of the unit ball.
    scale = np.linalg.svd(matrix[:3, :3], compute_uv=False)
    least = 1e-15  # of an axis of a transform [m]
    flattest = 1e-9  # of one axis beside another
    if scale[-1] < least or scale[-1] < flattest * scale[0]:
        raise InputError(
            f"{name}: {key} scales an axis by {scale[-1]:.3g} and another by {scale[0]:.3g}; "
            "expected at least "
            f"{least:g} m, and {flattest:g} of the other: give it a size"
        )


def _check_faces(name: str, parameters: mi.SceneParameters) -> None:
    """Refuse triangles with vertices that the mesh does not have."""
    faces = np.array(parameters["faces"], dtype=np.int64)
    count = len(np.array(parameters["vertex_positions"])) // 3
    if faces.size and faces.max() >= count:
        raise InputError(
            f"{name}: a face has vertex {faces.max()} of {count}, counted from 0; repair the mesh"
        )
