# SPDX-License-Identifier: BSD-3-Clause
"""A great hall lit through a wheel window: Biri 2006, Fig. 1 and Table 2, 107 514 triangles.

The paper says that its scene is complex, with around 100 000 triangles and a moving light. The hall here is our own.
"""

from typing import Any

import numpy as np

from validation.scenes.parts import (
    Mesh,
    camera,
    fog,
    grid,
    joined,
    lathe,
    mitsuba_mesh,
    placed,
    point_light,
    rotation,
    skin,
)
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import arch, box, pierced, torus

_BAYS = 5
_WINDOW = (0.17, 11.9, 5.23)
_STONE, _DARK, _WOOD = (0.57, 0.53, 0.46), (0.41, 0.38, 0.34), (0.37, 0.27, 0.19)


def hall() -> dict[str, Any]:
    """Return a hall of two arcades with statues, beams and a chandelier, 102 460 triangles of closed casters.

    The floor, the ceiling, the side walls and the end wall with its round window are open, 5054 triangles. The lamp is
    behind the window, so the walls shadow most of what the columns shadow.
    """
    casters = {name: mitsuba_mesh(name, mesh, reflectance) for name, (mesh, reflectance) in _casters().items()}
    shell = {name: mitsuba_mesh(name, mesh, _DARK) for name, mesh in _shell().items()}
    return {
        "type": "scene",
        "fog": fog(0.0433, (0.93, 0.91, 0.88), {"type": "hg", "g": 0.43}),
        "sensor": camera((-1.43, -11.3, 1.93), (0.37, 5.1, 3.37), fov=61.3, size=(800, 600)),
        "lamp": point_light((-0.83, 13.83, 6.47), (439.0, 397.0, 311.0)),
        **casters,
        **shell,
    }


def _casters() -> dict[str, tuple[Mesh, tuple[float, float, float]]]:
    result = {"wheel": (_wheel(), _WOOD), "chandelier": (_chandelier(), _WOOD)}
    for row, side in (("left", -1), ("right", 1)):
        for bay in range(_BAYS + 1):
            where = (side * 3.37 + 0.03, 3.83 * bay - 9.41, -0.017)
            result[f"column-{row}-{bay}"] = placed(_column(), where, rotation((0, 0, 1), 17.0 * bay)), _STONE
        for bay in range(_BAYS):
            along = 3.83 * bay - 9.41 + 0.5 * 3.83
            spring = placed(arch((1.53, 1.87), 0.53, 24), (side * 3.37 + 0.03, along, 4.47), rotation((0, 0, 1), 90))
            result[f"arch-{row}-{bay}"] = spring, _STONE
            result[f"statue-{row}-{bay}"] = placed(_statue(bay), (side * 3.29 + 0.03, along, -0.019)), _STONE
    for bay in range(_BAYS + 1):
        result[f"beam-{bay}"] = placed(box((12.7, 0.31, 0.37)), (0.05, 3.83 * bay - 9.37, 7.13)), _WOOD
    return result


def _column() -> Mesh:
    """Return a fluted column of 2 * 60 * 40 triangles."""
    level = np.linspace(0.0, 1.0, 40)
    radius = 0.31 * (1 - 0.11 * level) + 0.16 * np.exp(-level / 0.027) + 0.17 * np.exp(-(1 - level) / 0.041)
    vertices, faces = lathe(radius, 4.63 * level, 60)
    flutes = 1 - 0.037 * (np.cos(12 * 2 * np.pi * np.arange(60) / 60) > 0)
    scale = np.concatenate([np.tile(flutes, 40), [1.0, 1.0]])
    return vertices * np.stack([scale, scale, np.ones_like(scale)], axis=1), faces


def _statue(number: int) -> Mesh:
    """Return a draped figure on a plinth, with folds that turn with height: 2 * 56 * 32 triangles."""
    level = np.linspace(0.0, 1.0, 32)[:, None]
    angle = 2 * np.pi * np.arange(56)[None] / 56
    stops = [0, 0.2, 0.21, 0.3, 0.55, 0.62, 0.79, 0.83, 0.86, 0.93, 0.98, 1]
    profile = np.interp(level, stops, [0.37, 0.37, 0.29, 0.31, 0.19, 0.2, 0.27, 0.11, 0.08, 0.13, 0.1, 0.03])
    draped = np.clip((level - 0.21) / 0.1, 0, 1) * np.clip((0.8 - level) / 0.2, 0, 1)
    folds = 1 + 0.13 * draped * np.cos(7 * angle + 5.3 * level + 1.7 * number)
    radius = profile * folds * (1 - 0.23 * draped * np.sin(angle) ** 2)
    height = np.broadcast_to(2.37 * level, radius.shape)
    return skin(np.stack([radius * np.cos(angle), radius * np.sin(angle), height], axis=2))


def _wheel() -> Mesh:
    """Return the tracery of the window: two rings and eleven spokes that join them."""
    upright = rotation((1, 0, 0), 90)
    spoke = lathe([0.061, 0.047, 0.063], [0.43, 1.07, 1.83], 12)
    spokes = [placed(spoke, (0, 0, 0), rotation((0, 1, 0), 360 * number / 11 + 20.3)) for number in range(11)]
    sizes = ((0.47, 0.083), (1.79, 0.107))
    rings = [placed(torus(radius, thickness, (72, 14)), (0, 0, 0), upright) for radius, thickness in sizes]
    return placed(joined([*rings, *spokes]), (_WINDOW[0], _WINDOW[1] + 0.023, _WINDOW[2]))


def _chandelier() -> Mesh:
    ring = torus(0.87, 0.053, (64, 12))
    candles = [
        placed(lathe([0.041, 0.047, 0.031], [-0.02, 0.07, 0.39], 10), (0.87 * np.cos(a), 0.87 * np.sin(a), 0.0))
        for a in 2 * np.pi * (np.arange(9) + 0.3) / 9
    ]
    rod = lathe([0.023, 0.029, 0.019], [-0.11, 0.3, 2.13], 8)
    return placed(joined([ring, rod, *candles]), (0.23, 1.37, 4.83), rotation((1, 0.3, 0), 2.3))


def _shell() -> dict[str, Mesh]:
    """Return the open meshes: floor, ceiling, side walls and the end wall with its hole, 5054 triangles."""
    hole = (6.27 / 12.3, _WINDOW[2] / 8.7, 1.77)
    return {
        "floor": grid((-6.1, -12.7, 0.0), (12.3, 0, 0), (0, 24.6, 0), (23, 41)),
        "end-wall": pierced((-6.1, 11.9, 0.0), (12.3, 0, 0), (0, 0, 8.7), hole=hole, cells=(72, 5)),
        "wall-left": grid((-6.1, -12.7, 0.0), (0, 24.6, 0), (0, 0, 8.7), (25, 9)),
        "wall-right": grid((6.2, 11.9, 0.0), (0, -24.6, 0), (0, 0, 8.7), (25, 9)),
        "ceiling": grid((-6.1, 11.9, 8.7), (12.3, 0, 0), (0, -24.6, 0), (18, 43)),
    }


SCENE = SceneRecord(
    "hall",
    hall,
    "A great hall lit through a wheel window: long shafts, columns in the shadow of columns, 107 514 triangles.",
    "Biri, Arques, Michelin 2006, Fig. 1 and Table 2: 12 frames/s; there another room, with a moving light",
    Animation(about=(-0.31, 13.97, 6.47)),
)
