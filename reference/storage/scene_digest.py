# SPDX-License-Identifier: BSD-3-Clause
"""A digest of a scene as Mitsuba holds it: every parameter of every plugin, every vertex."""

import hashlib
import re
from collections.abc import Iterator
from typing import Any

import mitsuba as mi
import numpy as np

#: Plugins without an id are named by their address, which differs from run to run.
_ADDRESS = re.compile(r"object_\d+|0x[0-9a-f]+")


def scene_digest(scene) -> str:
    """Return a digest of a Mitsuba scene: of every parameter of every plugin in it."""
    digest = hashlib.sha256()
    parameters = mi.traverse(scene)
    for words in _kinds(scene):
        digest.update(_ADDRESS.sub("", words).encode())
    for key in parameters.keys():  # noqa: SIM118 - SceneParameters iterates over items
        digest.update(_ADDRESS.sub("", key).encode())
        digest.update(_value_bytes(parameters[key]))
    return digest.hexdigest()


def _kinds(scene) -> Iterator[str]:
    """Yield what decides the numbers but is no parameter: the kinds of the plugins, and which way surfaces face."""
    for sensor in scene.sensors():
        yield sensor.class_name()
        yield _medium_words(sensor.get_medium())
    for emitter in scene.emitters():
        yield emitter.class_name()
    for shape in scene.shapes():
        yield f"{shape.class_name()} {shape.has_flipped_normals()} {shape.bsdf()}"
        yield f"inside {_medium_words(shape.interior_medium())}, outside {_medium_words(shape.exterior_medium())}"


def _medium_words(medium: Any) -> str:
    # An isotropic and a Rayleigh phase function have no parameters: they differ by their names alone.
    return "no medium" if medium is None else f"{medium} {medium.phase_function()}"


def _value_bytes(value: Any) -> bytes:
    # The name of the type decides: a colour has a `matrix` too, a swizzle that holds its first channel six times.
    matrix = value.matrix if "Transform" in type(value).__name__ else value
    try:
        return np.array(matrix, dtype=np.float64).tobytes()
    except (TypeError, ValueError):
        return repr(value).encode()
