# SPDX-License-Identifier: BSD-3-Clause
"""A cloud of two lobes: light comes to the valley between them by two ways of equal weight."""

from typing import Any

import numpy as np

from validation.scenes.cloud_parts import cloud, sun
from validation.scenes.clouds.lobes import lobes
from validation.scenes.clouds.surfaces import Mesh, star_shaped
from validation.scenes.parts import camera, medium_boundary
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import icosphere


def two_lobes() -> dict[str, Any]:
    """Return the cloud, nearly the same on both sides, under a sun nearly at the zenith."""
    return {
        "type": "scene",
        "sensor": camera((61.0, -1193.0, 797.0), (3.0, 7.0, 911.0), fov=51.3, size=(800, 600), in_fog=False),
        "sun": sun((0.013, 0.171, -0.985), (3.17, 3.05, 2.83)),
        "cloud": medium_boundary("cloud", two_lobes_mesh(), cloud({"type": "hg", "g": 0.8493})),
    }


def two_lobes_mesh() -> Mesh:
    """Return the surface: two balls side by side, both around the point from which the triangles are drawn."""
    centres = np.array([[-251.0, 3.0, 967.0], [257.0, -5.0, 971.0], [7.0, 11.0, 853.0]])
    union = lobes(centres, np.array([269.0, 271.0, 149.0]), 17.3)
    return star_shaped(union, np.array([3.0, 2.0, 893.0]), 811.0, icosphere(4))


SCENE = SceneRecord(
    "two-lobes",
    two_lobes,
    "A cloud of two lobes, 5 120 triangles: to the valley between them light comes by two collectors, not one.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, Fig. 11b",
    Animation(("light",)),
    clouds=True,
)
