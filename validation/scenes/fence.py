# SPDX-License-Identifier: BSD-3-Clause
"""Bars at four distances from a rectangular lamp, whose shadows soften with the distance: Ali 2016, Fig. 4.20.

The lamp shines towards the camera through four groups of upright bars, side by side as the lamp sees them, so that
every group casts its own shadow: that of the nearest to the lamp is all penumbra, that of the farthest has an umbra.
It is above the image, as in `validation.scenes.penumbra_plane`.
"""

from typing import Any

from validation.scenes.parts import Mesh, area_lamp, camera, fog, grid, mitsuba_mesh, placed, rotation
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box

_LAMP = (0.133, 4.171, 4.113)
#: Of each group: how far before the lamp it stands, from where to where it reaches across [m], and its colour.
_GROUPS = (
    (0.917, (-0.571, -0.293), (0.53, 0.29, 0.19)),
    (1.873, (-0.473, -0.031), (0.47, 0.43, 0.23)),
    (2.939, (0.037, 0.731), (0.29, 0.41, 0.31)),
    (4.111, (1.091, 2.207), (0.27, 0.33, 0.49)),
)
_BARS = 5


def fence() -> dict[str, Any]:
    """Return four groups of five bars, 240 triangles, on a floor of 2, before a rectangle lamp of 0.62 m x 0.34 m."""
    groups = {}
    for group, (before, (left, right), colour) in enumerate(_GROUPS):
        step = (right - left) / (_BARS - 1)
        for number in range(_BARS):
            place = (_LAMP[0] + left + step * number, _LAMP[1] - before, 0.0)
            groups[f"bar-{group}-{number}"] = mitsuba_mesh(
                f"bar-{group}-{number}", _bar(0.43 * step, 2.319 + 0.117 * before, place, 7.3 * number + group), colour
            )
    return {
        "type": "scene",
        "fog": fog(0.127, (0.93, 0.91, 0.88), {"type": "hg", "g": 0.41}),
        "sensor": camera((-0.613, -4.737, 2.837), (0.371, 1.219, 0.683), fov=51.7, size=(800, 600)),
        "lamp": area_lamp("rectangle", _LAMP, (0.213, -0.371, 0.419), (0.311, 0.169), (67.3, 61.9, 53.1)),
        **groups,
        "floor": mitsuba_mesh("floor", grid((-6.7, -6.3, 0.0), (13.9, 0, 0), (0, 12.7, 0), (1, 1)), (0.43, 0.41, 0.39)),
    }


def _bar(width: float, height: float, place: tuple[float, float, float], turn: float) -> Mesh:
    """Return an upright bar that reaches a little below the floor; `turn` is about its own axis [degrees]."""
    middle = place[0], place[1], 0.5 * height - 0.019
    return placed(box((width, 0.61 * width, height)), middle, rotation((0, 0, 1), turn))


SCENE = SceneRecord(
    "fence",
    fence,
    "Bars at four distances from a rectangular lamp: shafts and shadows that soften as they go.",
    "Ali 2016, Fig. 4.20 (half-shadows of a fence); another fence, as the source prints no sizes",
    Animation(about=(0.211, 1.313, 4.113)),
)
