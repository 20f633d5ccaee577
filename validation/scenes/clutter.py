# SPDX-License-Identifier: BSD-3-Clause
"""A cluttered table about a lamp: Biri 2006, Fig. 7c and Table 2, 20 747 triangles.

The paper says that its scene has a lot of shadow planes and a moving light that changes colour. The objects here are
our own.
"""

from typing import Any

import numpy as np

from validation.scenes.parts import Mesh, camera, fog, grid, lathe, mitsuba_mesh, placed, point_light, rotation, scaled
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import arch, box, gable, gem, icosphere, prism, star, tetrahedron, torus

_COUNT = 73
_LAMP = (0.13, 0.37, 0.91)


def clutter() -> dict[str, Any]:
    """Return 82 closed objects about a lamp, 18 926 triangles, an open table of 1612 and an open backdrop of 209."""
    objects = {
        f"object-{number}": mitsuba_mesh(f"object-{number}", mesh, reflectance)
        for number, (mesh, reflectance) in enumerate(_objects())
    }
    table = grid((-4.7, -3.9, 0.0), (9.3, 0, 0), (0, 7.7, 0), (31, 26))
    return {
        "type": "scene",
        "fog": fog((0.237, 0.263, 0.301), (0.93, 0.92, 0.89)),
        "sensor": camera((0.53, -5.37, 2.83), (-0.07, 0.13, 0.61), fov=48.7, size=(800, 600)),
        "lamp": point_light(_LAMP, (15.7, 12.9, 8.3)),
        **objects,
        "table": mitsuba_mesh("table", table, (0.37, 0.31, 0.23)),
        "backdrop": mitsuba_mesh("backdrop", _backdrop(), (0.17, 0.19, 0.23)),
    }


def _objects() -> list[tuple[Mesh, tuple[float, float, float]]]:
    """Return objects placed like the seeds of a sunflower, and a cage of nine rods around the lamp.

    Each object reaches a little below the table top, so that no light passes under it.
    """
    colours = [(0.61, 0.29, 0.21), (0.27, 0.43, 0.59), (0.67, 0.59, 0.31), (0.37, 0.53, 0.33), (0.63, 0.61, 0.57)]
    result = []
    for number in range(_COUNT):
        distance, angle = 0.419 * np.sqrt(number + 2.3), np.deg2rad(137.50776 * number + 21.7)
        position = (_LAMP[0] + distance * np.cos(angle), _LAMP[1] + 0.87 * distance * np.sin(angle), -0.011)
        mesh = _KINDS[number % len(_KINDS)](0.87 + 0.31 * np.sin(2.7 * number))
        result.append((placed(mesh, position, rotation((0, 0, 1), 53.0 * number)), colours[number % len(colours)]))
    for number in range(9):
        angle = np.deg2rad(39.3 * number + 13.1)
        foot = (_LAMP[0] + 0.29 * np.cos(angle), _LAMP[1] + 0.29 * np.sin(angle), -0.013)
        result.append((placed(_KINDS[-1](1.37), foot), colours[-1]))
    return result


def _cup(scale: float) -> Mesh:
    """Return a cup of 2 * 18 * 10 triangles: its profile runs up the outside, over the rim and down the inside."""
    radius = np.array([0.13, 0.15, 0.16, 0.19, 0.21, 0.205, 0.195, 0.17, 0.14, 0.11])
    height = np.array([0.0, 0.02, 0.11, 0.27, 0.41, 0.423, 0.41, 0.27, 0.11, 0.047])
    return lathe(scale * radius, scale * height, 18)


def _bottle(scale: float) -> Mesh:
    level = np.linspace(0.0, 1.0, 15)
    radius = np.interp(level, [0, 0.03, 0.45, 0.65, 0.95, 1.0], [0.13, 0.16, 0.157, 0.061, 0.053, 0.067])
    return lathe(scale * radius, 1.07 * scale * level, 20)


def _pawn(scale: float) -> Mesh:
    level = np.linspace(0.0, 1.0, 17)
    radius = np.interp(
        level, [0, 0.1, 0.17, 0.6, 0.64, 0.68, 0.8, 0.95, 1], [0.17, 0.17, 0.11, 0.05, 0.1, 0.06, 0.11, 0.07, 0.02]
    )
    return lathe(scale * radius, 0.71 * scale * level, 18)


def _ring(scale: float) -> Mesh:
    """Return a ring that stands on the table."""
    return placed(torus(0.21 * scale, 0.047 * scale, (26, 10)), (0, 0, 0.257 * scale), rotation((1, 0, 0), 83.0))


_KINDS = (
    _bottle,
    _cup,
    lambda scale: placed(box((0.23 * scale, 0.19 * scale, 0.37 * scale)), (0, 0, 0.185 * scale)),
    _ring,
    lambda scale: placed(tetrahedron(0.31 * scale), (0, 0, 0.31 / 3 * scale), rotation((1, -1, 0), 54.7356)),
    _pawn,
    lambda scale: prism(star(0.11 * scale, 0.23 * scale, 6), 0.53 * scale),
    lambda scale: placed(scaled(icosphere(2), 0.21 * scale), (0, 0, 0.21 * scale)),
    lambda scale: arch((0.17 * scale, 0.24 * scale), 0.13 * scale, 15),
    lambda scale: placed(scaled(gem(7, 4), 0.19 * scale), (0, 0, 0.19 * scale)),
    lambda scale: lathe([0.023 * scale, 0.031 * scale, 0.017 * scale], [0.0, 0.11 * scale, 1.13 * scale], 9),
)


def _backdrop() -> Mesh:
    return gable((-4.7, 3.8, 0.0), (9.3, 0, 0), (0, 0, 2.9), (19, 5))


SCENE = SceneRecord(
    "clutter",
    clutter,
    "A table of small things about a lamp: shadows within shadows all over the image, 20 747 triangles.",
    "Biri, Arques, Michelin 2006, Fig. 7c and Table 2: 25 frames/s; there other objects, about a moving light",
    Animation(("light", "colour"), about=(0.19, 0.29, 0.91)),
)
