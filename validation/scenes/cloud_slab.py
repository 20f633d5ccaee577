# SPDX-License-Identifier: BSD-3-Clause
"""A slab of cloud: a closed box so wide that the light of its middle knows nothing of its sides."""

from typing import Any

from validation.scenes.cloud_parts import cloud, sun
from validation.scenes.parts import camera, medium_boundary, placed
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import box

#: Thickness and width [m]; about 10.6 and 860 mean free paths.
_THICKNESS, _WIDTH = 291.7, 23_713.0


def cloud_slab() -> dict[str, Any]:
    """Return a slab seen from above, by a sun at 34 degrees from the zenith.

    The rows of the image see it at cosines from about 0.9 to 0.1 from its normal.
    """
    slab = placed(box((_WIDTH, _WIDTH, _THICKNESS)), (11.3, -17.9, 0.5 * _THICKNESS))
    return {
        "type": "scene",
        "sensor": camera((-373.0, 29.0, 603.7), (0.0, 47.0, 337.0), fov=71.3, size=(800, 600), in_fog=False),
        "sun": sun((0.517, 0.211, -0.829), (3.17, 3.05, 2.83)),
        "cloud": medium_boundary("cloud", slab, cloud({"type": "hg", "g": 0.8493})),
    }


SCENE = SceneRecord(
    "cloud-slab",
    cloud_slab,
    "A wide slab of cloud, 10.6 mean free paths thick: the case that DISORT knows exactly.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, section 9 and Fig. 12",
    Animation(("light",)),
    clouds=True,
)
