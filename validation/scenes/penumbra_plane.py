# SPDX-License-Identifier: BSD-3-Clause
"""A half-plane between a lamp with extent and a floor: the shares of the lamp that the floor sees have a closed form.

The screen reaches so far that its edge alone bounds the shadow on all that the camera sees: seen from a point of the
floor it cuts the disk of the lamp along a straight line.

The lamp is above the image: of the points that stand for it, those next to a camera ray would count as the peak of a
point light.
"""

from typing import Any

from validation.scenes.parts import area_lamp, camera, fog, grid, mitsuba_mesh
from validation.scenes.record import Animation, SceneRecord

#: A point of the screen's edge, the direction of the edge, and how far the screen reaches from it [m].
EDGE, ALONG, ACROSS = (0.137, 0.0, 1.613), (0.173, 1.0, 0.0137), (-1.0, 0.171, 0.0391)
_LENGTH, _DEPTH = 31.3, 17.9


def penumbra_plane() -> dict[str, Any]:
    """Return a disk lamp of 0.43 m radius over the edge of a screen of 2 triangles, over a floor of 2, in grey fog."""
    corner = [point - 0.5 * _LENGTH * along for point, along in zip(EDGE, ALONG)]
    screen = grid(corner, [_LENGTH * along for along in ALONG], [_DEPTH * across for across in ACROSS], (1, 1))
    return {
        "type": "scene",
        "fog": fog(0.193, (0.92, 0.89, 0.84)),
        "sensor": camera((1.37, -5.19, 1.17), (0.23, 0.29, 0.173), fov=53.3, size=(800, 600)),
        "lamp": area_lamp("disk", (0.319, 0.271, 2.717), (0.217, 0.133, 0.0), 0.433, (17.3, 15.1, 12.7)),
        "screen": mitsuba_mesh("screen", screen, (0.37, 0.33, 0.29)),
        "floor": mitsuba_mesh(
            "floor", grid((-8.3, -6.1, -0.027), (17.1, 0, 0), (0, 15.3, 0), (1, 1)), (0.47, 0.44, 0.41)
        ),
    }


SCENE = SceneRecord(
    "penumbra-plane",
    penumbra_plane,
    "A disk lamp over the edge of a half-plane: the penumbra on the floor has a closed form.",
    "none: the light with extent of which most is known; Ali 2016 has half-shadows of lights of this kind",
    Animation(about=(0.137, -0.113, 2.717)),
)
