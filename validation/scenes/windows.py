# SPDX-License-Identifier: BSD-3-Clause
"""Sun through the windows of a hazy room: a directional light, shafts between glazing bars, a box of fog.

The glazing bars cut the light into parallel beams, and objects in the room cut the beams again. A directional light
needs bounded media, so the fog fills a slanted box within the walls. The camera is in clear air before the open side of
the room.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.scenes.parts import (
    Mesh,
    camera,
    fog,
    grid,
    joined,
    lathe,
    medium_boundary,
    mitsuba_mesh,
    placed,
    rotation,
    scaled,
)
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box, gem, icosphere, prism, star, torus

_LEFT, _FRONT, _WIDTH, _DEPTH, _HEIGHT = -2.63, -2.17, 5.37, 5.89, 3.43
_THICKNESS = 0.19
#: Lines that divide the wall, along the room and upwards [m]; the panes lie between an odd line and the next.
_PANES_ALONG = (0.53, 0.97, 1.04, 1.47, 2.39, 2.83, 2.91, 3.37, 4.31, 4.73, 4.81, 5.27)
_PANES_UP = (0.83, 1.51, 1.58, 2.23, 2.29, 2.87)
_STONE, _WOOD, _CLAY, _BRASS = (0.43, 0.41, 0.37), (0.37, 0.23, 0.13), (0.51, 0.29, 0.19), (0.59, 0.49, 0.23)


def windows() -> dict[str, Any]:
    """Return a room of 526 triangles with three windows of six panes, objects of 1210 and fog in a box of 12."""
    return {
        "type": "scene",
        "sensor": camera((0.83, -6.91, 2.03), (-0.17, 0.29, 1.49), fov=47.9, size=(800, 600), in_fog=False),
        "sun": {
            "type": "directional",
            "direction": [0.737, -0.271, -0.419],
            "irradiance": {"type": "rgb", "value": [33.1, 28.7, 22.3]},
        },
        "haze": medium_boundary("haze", _haze(), fog((0.137, 0.149, 0.167), (0.94, 0.93, 0.91), _PHASE)),
        "wall": mitsuba_mesh("wall", _window_wall(), _STONE),
        "room": mitsuba_mesh("room", _room(), (0.33, 0.32, 0.31)),
        **{name: mitsuba_mesh(name, mesh, reflectance) for name, mesh, reflectance in _things()},
    }


_PHASE = {"type": "hg", "g": 0.37}


def _haze() -> Mesh:
    """Return the box of fog; it touches no wall, and none of its faces is parallel to a wall."""
    middle = (_LEFT + 0.5 * _WIDTH + 0.013, _FRONT + 0.5 * _DEPTH + 0.031, 0.5 * _HEIGHT + 0.017)
    return placed(box((_WIDTH - 0.29, _DEPTH - 0.37, _HEIGHT - 0.23)), middle, rotation((0.3, -0.2, 1.0), 1.3))


def _room() -> Mesh:
    """Return the floor, the ceiling, the back wall and the wall opposite the windows, 10 triangles."""
    left, width = _LEFT - _THICKNESS, _WIDTH + _THICKNESS
    back = _FRONT + _DEPTH
    return joined(
        [
            grid((left, _FRONT, 0.0), (width, 0, 0), (0, _DEPTH, 0), (2, 1)),
            grid((left, _FRONT, _HEIGHT), (0, _DEPTH, 0), (width, 0, 0), (1, 1)),
            grid((left, back, 0.0), (width, 0, 0), (0, 0, _HEIGHT), (1, 1)),
            grid((left + width, back, 0.0), (0, -_DEPTH, 0), (0, 0, _HEIGHT), (1, 1)),
        ]
    )


def _window_wall() -> Mesh:
    """Return the wall with the windows as a closed mesh: a slab with eighteen through holes."""
    return pierced_slab(
        np.array([0.0, *_PANES_ALONG, _DEPTH]), np.array([0.0, *_PANES_UP, _HEIGHT]), _THICKNESS, (_LEFT, _FRONT, 0.0)
    )


def pierced_slab(along: NDArray, up: NDArray, thickness: float, corner: Sequence[float]) -> Mesh:
    """Return a closed upright slab in the plane x = corner[0] with a hole in every cell (i, j) with i and j odd.

    Parameters
    ----------
    along, up
        Lines between cells along y and z, from the corner on, ascending, an even number of each, (n,) [m].
    thickness
        Towards -x [m].
    corner
        The lowest corner of the slab, (3,) [m].
    """
    n, m = len(along) - 1, len(up) - 1
    y, z = np.meshgrid(along, up, indexing="ij")
    plane = np.stack([np.zeros(y.size), y.ravel(), z.ravel()], axis=1)
    vertices = np.concatenate([plane, plane - [thickness, 0, 0]]) + np.asarray(corner)
    quads = []

    def solid(i: int, j: int) -> bool:
        return 0 <= i < n and 0 <= j < m and not (i % 2 and j % 2)

    def at(i: int, j: int, layer: int) -> int:
        return layer * (n + 1) * (m + 1) + i * (m + 1) + j

    for i in range(n):
        for j in range(m):
            if not solid(i, j):
                continue
            ring = [(i, j), (i + 1, j), (i + 1, j + 1), (i, j + 1)]
            quads.append([at(*point, 0) for point in ring])
            quads.append([at(*point, 1) for point in reversed(ring)])
            # Where the next cell is open, a wall joins the two layers.
            for a, b, beyond in zip(ring, [*ring[1:], ring[0]], [(i, j - 1), (i + 1, j), (i, j + 1), (i - 1, j)]):
                if not solid(*beyond):
                    quads.append([at(*a, 1), at(*b, 1), at(*b, 0), at(*a, 0)])
    faces = np.array(quads)
    return vertices, np.concatenate([faces[:, [0, 1, 2]], faces[:, [0, 2, 3]]])


def _things() -> list[tuple[str, Mesh, tuple[float, float, float]]]:
    """Return the objects in the room; all are closed, and those that stand reach a little below the floor."""
    level = np.linspace(0.0, 1.0, 15)
    vase = lathe(0.09 + 0.11 * np.sin(2.7 * level + 0.5) ** 2, 0.67 * level, 18)
    return [
        ("table", placed(_table(), (0.37, 0.83, 0.0), rotation((0, 0, 1), 21.7)), _WOOD),
        ("vase", placed(vase, (0.47, 0.91, 0.797)), _CLAY),
        ("ring", placed(torus(0.37, 0.047, (23, 9)), (-0.71, -0.13, 2.03), rotation((1, 0.4, 0.2), 63.1)), _BRASS),
        ("sphere", placed(scaled(icosphere(1), 0.23), (-1.13, 1.37, 1.31)), _BRASS),
        ("stone", placed(scaled(gem(7, 4), (0.41, 0.33, 0.37)), (1.53, -0.71, 0.31)), _STONE),
        ("post", placed(prism(star(0.11, 0.19, 6), 3.37), (-1.57, 2.63, -0.017)), _WOOD),
        ("beam", placed(box((0.17, 5.61, 0.21)), (0.83, _FRONT + 0.5 * _DEPTH, 2.97), rotation((0, 0, 1), 2.3)), _WOOD),
    ]


def _table() -> Mesh:
    legs = [placed(box((0.071, 0.067, 0.79)), (sx * 0.61, sy * 0.37, 0.387)) for sx in (-1, 1) for sy in (-1, 1)]
    return joined([placed(box((1.43, 0.93, 0.057)), (0.0, 0.0, 0.787)), *legs])


SCENE = SceneRecord(
    "windows",
    windows,
    "Sun through three barred windows into a hazy room: parallel shafts of a directional light, bounded fog.",
    "none: the published scenes have lamps; this one tests directional lights",
    Animation(("objects",), objects=("ring",)),
)
