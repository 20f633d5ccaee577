# SPDX-License-Identifier: BSD-3-Clause
"""The triangles of a black light, for methods that know casters by their triangles.

A disk or sphere has no triangles. A polygon and a sphere of facets stand for it, as large as it in area and in mean
shadow; they matter where the shape shadows other lights, not its own.
"""

import math

import numpy as np
from numpy.typing import NDArray

from realtime.area_lights.shape import AreaLight

Array = NDArray[np.float64]

_SIDES, _RINGS = 64, 32


def caster_vertices(light: AreaLight) -> Array:
    """Return the vertices of the triangles of a light, (vertices, 3) [m]."""
    if light.kind == "rectangle":
        corners = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return np.array([light.middle + u * light.across + v * light.up for u, v in corners])
    angle = 2 * math.pi * (np.arange(_SIDES) + 0.5) / _SIDES
    circle = np.cos(angle)[:, None] * light.across + np.sin(angle)[:, None] * light.up
    # A polygon as large as its circle.
    wide = math.sqrt(2 * math.pi / _SIDES / math.sin(2 * math.pi / _SIDES))
    if light.kind == "disk":
        return np.concatenate([light.middle + wide * circle, light.middle[None]])
    pole = np.cross(light.across, light.up) / light.radius
    polar = math.pi * np.arange(1, _RINGS) / _RINGS
    rings = [light.middle + wide * (math.sin(a) * circle + math.cos(a) * pole) for a in polar]
    return np.concatenate([*rings, [light.middle + wide * pole, light.middle - wide * pole]])


def caster_triangles(light: AreaLight) -> NDArray[np.int64]:
    """Return the numbers of the vertices of its triangles, (triangles, 3)."""
    if light.kind == "rectangle":
        return np.array([[0, 1, 2], [0, 2, 3]])
    i = np.arange(_SIDES)
    j = (i + 1) % _SIDES
    if light.kind == "disk":
        return np.stack([i, j, np.full(_SIDES, _SIDES)], axis=1)
    faces = []
    for ring in range(_RINGS - 2):
        near, far = ring * _SIDES, (ring + 1) * _SIDES
        faces += [np.stack([near + i, far + i, far + j], axis=1), np.stack([near + i, far + j, near + j], axis=1)]
    last, top = (_RINGS - 2) * _SIDES, (_RINGS - 1) * _SIDES
    faces += [
        np.stack([np.full(_SIDES, top), i, j], axis=1),
        np.stack([last + j, last + i, np.full(_SIDES, top + 1)], 1),
    ]
    return np.concatenate(faces)
