# SPDX-License-Identifier: BSD-3-Clause
"""A hall of fluted columns in fog, lit through them: after Billeter 2010, Fig. 7, which shows the Sponza atrium."""

from typing import Any

import numpy as np

from validation.scenes.parts import Mesh, camera, fog, grid, joined, lathe, mitsuba_mesh, placed, point_light, rotation

_SIDES, _RINGS, _COLUMNS = 72, 32, 14


def colonnade() -> dict[str, Any]:
    """Return two rows of seven columns with a floor and three walls, 66 132 triangles, and a lamp beyond one row."""
    columns = [
        placed(_column(), (side * 2.83 + 0.07, 2.47 * number - 6.91, 0.0), rotation((0, 0, 1), 11.0 * number))
        for side in (-1, 1)
        for number in range(_COLUMNS // 2)
    ]
    hall = [
        grid((-6.3, -10.7, 0.0), (12.6, 0, 0), (0, 23.1, 0), (21, 21)),
        grid((-6.3, 12.4, 0.0), (12.6, 0, 0), (0, 0, 6.9), (14, 9)),
        grid((-6.3, -10.7, 0.0), (0, 23.1, 0), (0, 0, 6.9), (14, 9)),
        grid((6.3, 12.4, 0.0), (0, -23.1, 0), (0, 0, 6.9), (13, 9)),
    ]
    return {
        "type": "scene",
        "fog": fog(0.071, (0.94, 0.92, 0.87), {"type": "hg", "g": 0.37}),
        "sensor": camera((-1.37, -9.83, 1.71), (0.83, 1.91, 2.13), fov=63.1, size=(800, 600)),
        "lamp": point_light((5.13, 1.83, 4.37), (173.0, 149.0, 107.0)),
        "columns": mitsuba_mesh("columns", joined(columns), (0.61, 0.57, 0.49)),
        "hall": mitsuba_mesh("hall", joined(hall), (0.53, 0.47, 0.41)),
    }


def _column() -> Mesh:
    """Return a fluted column of 2 * 72 * 32 triangles with a wider foot and head."""
    level = np.linspace(0.0, 1.0, _RINGS)
    radius = 0.37 * (1 - 0.13 * level) + 0.17 * np.exp(-level / 0.031) + 0.19 * np.exp(-(1 - level) / 0.037)
    vertices, faces = lathe(radius, 5.31 * level, _SIDES)
    flutes = 1 - 0.043 * (np.cos(12 * 2 * np.pi * np.arange(_SIDES) / _SIDES) > 0)
    scale = np.concatenate([np.tile(flutes, _RINGS), [1.0, 1.0]])
    return vertices * np.stack([scale, scale, np.ones_like(scale)], axis=1), faces
