# SPDX-License-Identifier: BSD-3-Clause
"""The step cloud of I3RC as closed boxes: optical thickness 2 and 18 by turns, 250 m wide each.

The published case repeats itself without end in x and reaches to infinity in y. Here nine periods lie side by side,
with gaps of 2 mm so that the boxes are apart, and reach 8 km in y: light that the middle period gets from beyond is
below 1e-5.
"""

from typing import Any

from validation.scenes.cloud_parts import sun
from validation.scenes.parts import camera, fog, medium_boundary, placed
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box

WIDTH, THICKNESS = 500.0, 250.0  #: of a period and of the layer [m]
THIN, THICK = 2.0, 18.0  #: optical thickness of both halves
PERIODS = 9
_GAP = 0.002  #: between boxes [m]


def step_cloud() -> dict[str, Any]:
    """Return the cloud from above; its base is at z = 0, its middle period at 0 < x < 500 m, the sun at the zenith."""
    cases = {"thin": THIN, "thick": THICK}
    boxes = {}
    for period in range(PERIODS):
        for half, (name, optical) in enumerate(cases.items()):
            slab = box((0.5 * WIDTH - _GAP, 8000.0, THICKNESS))
            x = WIDTH * (period - PERIODS // 2 + 0.25 + 0.5 * half)
            medium = fog(optical / THICKNESS, (_ALBEDO,) * 3, {"type": "hg", "g": 0.85})
            key = f"{name}-{period + 1}"
            boxes[key] = medium_boundary(key, placed(slab, (x, 0.0, 0.5 * THICKNESS)), medium)
    return {
        "type": "scene",
        "sensor": camera((291.3, -1387.0, 1193.0), (263.7, 11.0, 131.0), fov=53.9, size=(800, 600), in_fog=False),
        "sun": sun((0.0, 0.0, -1.0), (3.17, 3.05, 2.83)),
        **boxes,
    }


_ALBEDO = 1 - 2.0**-22  #: the published one is 1

SCENE = SceneRecord(
    "step-cloud",
    step_cloud,
    "The step cloud of I3RC, case 1: optical thickness 2 and 18 by turns, whose reflectance many codes agree on.",
    "Cahalan et al. 2005, The I3RC, case 1",
    Animation(("light",)),
    clouds=True,
)
