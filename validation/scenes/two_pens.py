# SPDX-License-Identifier: BSD-3-Clause
"""Two pens standing on a sheet before a lamp: Biri 2006, Fig. 7a and Table 2, 34 549 triangles."""

from typing import Any

import numpy as np

from validation.scenes.parts import Mesh, camera, fog, grid, joined, lathe, mitsuba_mesh, placed, point_light, rotation

_SIDES, _RINGS = 96, 89


def two_pens() -> dict[str, Any]:
    """Return two closed pens of 17 088 triangles each, a table of 372 and a single triangular flag: 34 549."""
    first = placed(_pen(1.83), (-0.31, 0.17, 0.02), rotation((0.3, 1.0, 0.1), 9.7))
    second = placed(_pen(1.59), (0.43, -0.11, 0.02), rotation((1.0, -0.4, 0.0), 7.3))
    flag: Mesh = (np.array([[0.71, 0.53, 0.03], [1.13, 0.67, 0.03], [0.87, 0.59, 0.61]]), np.array([[0, 1, 2]]))
    return {
        "type": "scene",
        "fog": fog((0.331, 0.349, 0.373), (0.83, 0.87, 0.91), {"type": "rayleigh"}),
        "sensor": camera((0.47, -3.71, 1.37), (0.03, 0.07, 0.89), fov=43.9, size=(800, 600)),
        "lamp": point_light((-1.43, 1.31, 1.97), (11.3, 10.7, 9.9)),
        "pens": mitsuba_mesh("pens", joined([first, second]), (0.19, 0.27, 0.59)),
        "table": mitsuba_mesh("table", grid((-3.1, -1.7, 0.0), (6.1, 0, 0), (0, 4.9, 0), (31, 6)), (0.57, 0.51, 0.43)),
        "flag": mitsuba_mesh("flag", flag, (0.71, 0.23, 0.19)),
    }


def _pen(length: float) -> Mesh:
    """Return a pen of a length [m] with point, barrel, ring and cap, which stands on its point."""
    level = np.linspace(0.0, 1.0, _RINGS)
    profile = np.interp(level, [0, 0.013, 0.11, 0.19, 0.55, 0.57, 0.59, 0.97, 1.0], [3, 9, 37, 53, 59, 71, 61, 55, 23])
    return lathe(profile / 700, length * level, _SIDES)
