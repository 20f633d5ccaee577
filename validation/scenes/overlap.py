# SPDX-License-Identifier: BSD-3-Clause
"""Two casters, one above the other, whose penumbrae overlap: where filters of shadow maps bleed, Ali 2016, Fig. 5.3.

On the floor the share of the lamp that both leave is not the product of the shares that either leaves.
"""

from typing import Any

from validation.scenes.parts import area_lamp, camera, fog, grid, mitsuba_mesh, placed, rotation, scaled
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box, icosphere

_LAMP = (0.173, 0.291, 3.217)


def overlap() -> dict[str, Any]:
    """Return a plate and a ball, 92 triangles, on a floor of 2, under a sphere lamp of 0.27 m radius."""
    plate = placed(box((1.317, 0.913, 0.083)), (-0.371, 0.219, 1.731), rotation((0.1, -0.2, 1.0), 21.3))
    ball = placed(scaled(icosphere(1), 0.383), (0.517, 0.413, 0.811), rotation((1.0, 0.3, 0.2), 33.7))
    return {
        "type": "scene",
        "fog": fog(0.157, (0.91, 0.92, 0.87), {"type": "hg", "g": 0.29}),
        "sensor": camera((1.193, -4.937, 1.913), (0.057, 0.311, 1.137), fov=45.7, size=(800, 600)),
        "lamp": area_lamp("sphere", _LAMP, (0.0, 0.0, 0.0), 0.271, (23.3, 20.9, 17.7)),
        "plate": mitsuba_mesh("plate", plate, (0.29, 0.37, 0.43)),
        "ball": mitsuba_mesh("ball", ball, (0.53, 0.37, 0.23)),
        "floor": mitsuba_mesh("floor", grid((-5.9, -5.3, 0.0), (12.1, 0, 0), (0, 11.3, 0), (1, 1)), (0.46, 0.45, 0.42)),
    }


SCENE = SceneRecord(
    "overlap",
    overlap,
    "A plate above a ball under a sphere lamp: two penumbrae overlap on the floor, where shadow-map filters bleed.",
    "Ali 2016, Fig. 5.3 (overlapping soft shadows); other casters, as the source prints no sizes",
    Animation(about=(0.073, 0.191, 3.217)),
)
