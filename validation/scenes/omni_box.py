# SPDX-License-Identifier: BSD-3-Clause
"""A room about a lamp that shines all round: after Billeter 2010, Fig. 6.

The paper says that its scene is simple and has an omni light source. The room here is our own: its boxes cast shadows
on all six faces of a cube map about the lamp, some across the edges of faces.
"""

from typing import Any

import numpy as np

from validation.scenes.parts import Mesh, camera, fog, grid, joined, mitsuba_mesh, placed, point_light, rotation
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box

_LAMP = (0.13, 0.07, 1.57)
_WOOD, _WALL = (0.43, 0.31, 0.19), (0.17, 0.19, 0.21)
#: For each bar: angle about the lamp [degrees], distance from the lamp and thickness [m].
_BARS = (
    (17.3, 0.71, 0.13),
    (61.9, 0.83, 0.21),
    (113.1, 0.67, 0.17),
    (158.3, 0.91, 0.11),
    (203.7, 0.77, 0.19),
    (249.1, 0.73, 0.15),
    (317.9, 0.87, 0.23),
)
#: For each post and crate: size and position of its middle [m], turn about the vertical [degrees].
_STANDING = (
    ((0.29, 0.24, 3.31), (-1.73, 0.87, 1.643), 13.7),
    ((0.17, 0.14, 3.31), (-1.27, -1.19, 1.643), 41.3),
    ((0.23, 0.19, 3.31), (0.71, 1.43, 1.643), 29.9),
    ((0.21, 0.17, 3.31), (1.83, -0.31, 1.643), 57.1),
    ((0.61, 0.57, 0.53), (-0.93, -0.37, 0.263), 19.3),
    ((0.47, 0.51, 0.37), (1.07, 0.61, 0.183), -33.7),
)


def omni_box() -> dict[str, Any]:
    """Return a lamp amid thirteen boxes, 156 triangles, in a room that is open to the camera, ten triangles."""
    return {
        "type": "scene",
        "fog": fog(0.231, (0.93, 0.91, 0.89)),
        "sensor": camera((0.57, -7.13, 2.03), (0.09, 0.11, 1.53), fov=47.3, size=(800, 600)),
        "lamp": point_light(_LAMP, (23.3, 19.7, 14.9)),
        "boxes": mitsuba_mesh("boxes", joined([*_bars(), *_standing()]), _WOOD),
        "room": mitsuba_mesh("room", _room(), _WALL),
    }


def _bars() -> list[Mesh]:
    """Return the bars about the lamp, nearly parallel to the view, so that camera rays meet their shadows on edge."""
    result = []
    for number, (degrees, distance, thickness) in enumerate(_BARS):
        angle = np.deg2rad(degrees)
        size = (thickness, 1.97 + 0.37 * np.sin(2.3 * number), 0.79 * thickness)
        aside = (distance * np.cos(angle), 0.07 * number - 0.3, distance * np.sin(angle))
        turn = rotation((0.1, 1.0, 0.07 * number - 0.2), 31.0 * number + 7.3)
        result.append(placed(box(size), [a + b for a, b in zip(_LAMP, aside)], turn))
    return result


def _standing() -> list[Mesh]:
    """Return the posts and crates; they reach into the floor, and the posts into the ceiling."""
    return [placed(box(size), where, rotation((0, 0, 1), turn)) for size, where, turn in _STANDING]


def _room() -> Mesh:
    """Return the floor, the ceiling and three walls, with normals that point into the room."""
    left, front, width, depth, height = -2.87, -2.43, 5.71, 4.93, 3.29
    return joined(
        [
            grid((left, front, 0.0), (width, 0, 0), (0, depth, 0), (1, 1)),
            grid((left, front, height), (0, depth, 0), (width, 0, 0), (1, 1)),
            grid((left, front + depth, 0.0), (width, 0, 0), (0, 0, height), (1, 1)),
            grid((left, front, 0.0), (0, depth, 0), (0, 0, height), (1, 1)),
            grid((left + width, front + depth, 0.0), (0, -depth, 0), (0, 0, height), (1, 1)),
        ]
    )


SCENE = SceneRecord(
    "omni-box",
    omni_box,
    "A lamp amid bars and posts in a simple room: shafts all round, on every face of a cube map, 166 triangles.",
    "Billeter, Sintorn, Assarsson 2010, Fig. 6: 230, 165 and 25 frames/s with maps of 32, 128, 512",
    Animation(about=(0.05, 0.19, 1.57)),
)
