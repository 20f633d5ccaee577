# SPDX-License-Identifier: BSD-3-Clause
"""A small hall lit through its windows by a bright rectangle outside, shafts that soften from window to column.

The rectangle stands for the light of a window: `area` with the material `null`, so that nothing is there but what it
sends. The hall of the scene `hall` has 107 514 triangles before one lamp; here the truth takes thousands of lamps, so
there are few.
"""

from typing import Any

import numpy as np

from validation.scenes.parts import Mesh, area_lamp, camera, fog, grid, joined, lathe, mitsuba_mesh, placed, rotation
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box
from validation.scenes.windows import pierced_slab

_LIGHT, _HALF = (-6.117, 1.537, 4.373), (0.613, 0.471)
_STONE, _WOOD, _WALL = (0.53, 0.49, 0.43), (0.37, 0.27, 0.17), (0.43, 0.41, 0.37)
_LEFT, _FRONT, _WIDTH, _DEPTH, _HEIGHT = -3.413, -6.811, 6.877, 13.127, 4.591
#: Lines that divide the wall, along the hall and upwards [m]; openings lie between an odd line and the next.
_ALONG = (5.137, 5.919, 6.341, 7.123, 8.417, 9.213, 9.619, 10.381)
_UP = (1.613, 3.371)
_BAYS = 4


def soft_hall() -> dict[str, Any]:
    """Return columns and beams, 432 triangles, in a shell of 8 and a wall of 172 with four windows."""
    up = np.array([0.0, *_UP, _HEIGHT])
    wall = pierced_slab(np.array([0.0, *_ALONG, _DEPTH]), up, 0.317, (_LEFT, _FRONT, 0.0))
    return {
        "type": "scene",
        "fog": fog(0.0917, (0.94, 0.92, 0.89), {"type": "hg", "g": 0.37}),
        "sensor": camera((1.173, -6.319, 1.831), (-0.673, 1.937, 1.389), fov=59.3, size=(800, 600)),
        "light": area_lamp("rectangle", _LIGHT, (-1.973, 1.171, 1.639), _HALF, (613.0, 659.0, 731.0))
        | {"material": {"type": "null"}},
        "columns": mitsuba_mesh("columns", joined(_columns()), _STONE),
        "beams": mitsuba_mesh("beams", joined(_beams()), _WOOD),
        "wall": mitsuba_mesh("wall", wall, _WALL),
        "shell": mitsuba_mesh("shell", _shell(), _WALL),
    }


def _columns() -> list[Mesh]:
    """Return eight columns of 48 triangles, which reach a little into the floor and the ceiling."""
    column = lathe([0.317, 0.231, 0.197, 0.303], [-0.023, 0.371, 3.913, 4.637], 6)
    return [
        placed(column, (side * 1.873 + 0.041, 2.917 * bay - 4.637, 0.0), rotation((0, 0, 1), 13.7 * bay + 7.9 * side))
        for bay in range(_BAYS)
        for side in (-1, 1)
    ]


def _beams() -> list[Mesh]:
    beam = box((6.943, 0.233, 0.291))
    return [
        placed(beam, (0.057, 2.917 * bay - 3.181, 4.013), rotation((0, 0, 1), 1.3 - 0.7 * bay)) for bay in range(_BAYS)
    ]


def _shell() -> Mesh:
    """Return floor, ceiling, the wall without windows and the end wall, with normals that point into the hall."""
    return joined(
        [
            grid((_LEFT, _FRONT, 0.0), (_WIDTH, 0, 0), (0, _DEPTH, 0), (1, 1)),
            grid((_LEFT, _FRONT, _HEIGHT), (0, _DEPTH, 0), (_WIDTH, 0, 0), (1, 1)),
            grid((_LEFT, _FRONT + _DEPTH, 0.0), (_WIDTH, 0, 0), (0, 0, _HEIGHT), (1, 1)),
            grid((_LEFT + _WIDTH, _FRONT + _DEPTH, 0.0), (0, -_DEPTH, 0), (0, 0, _HEIGHT), (1, 1)),
        ]
    )


SCENE = SceneRecord(
    "soft-hall",
    soft_hall,
    "A hall lit through its windows by a rectangle: shafts that soften on their way, and columns that cut them.",
    "none: Ali 2016 shows lamps; this one stands for the light of a window",
    Animation(about=(-5.931, 1.337, 4.373)),
)
