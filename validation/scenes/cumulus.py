# SPDX-License-Identifier: BSD-3-Clause
"""A cumulus of about 5 000 triangles: lobes heaped on a flat base, with bumps."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.scenes.cloud_parts import cloud, droplets, sky, sun
from validation.scenes.clouds.lobes import bumps, lobes
from validation.scenes.clouds.surfaces import Mesh, star_shaped
from validation.scenes.parts import camera, medium_boundary
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import icosphere

Array = NDArray[np.float64]

_LOBES = 31
_BASE = 713.0  #: height of the base [m]


def cumulus() -> dict[str, Any]:
    """Return the cloud in clear air before a blue sky, lit by the sun from the left behind the camera."""
    return {
        "type": "scene",
        "sensor": camera((-113.0, -1471.0, 787.0), (17.0, 11.0, 953.0), fov=42.7, size=(800, 600), in_fog=False),
        "sun": sun((0.571, 0.433, -0.697), (3.17, 3.05, 2.83)),
        "sky": sky((0.067, 0.113, 0.211)),
        "cloud": medium_boundary("cloud", cumulus_mesh(), cloud(droplets())),
    }


def cumulus_mesh() -> Mesh:
    """Return the surface of the cloud, 5 120 triangles."""
    return star_shaped(cumulus_distance, np.array([29.0, -13.0, _BASE + 113.0]), 1013.0, icosphere(4))


def cumulus_distance(points: Array) -> Array:
    """Return about the signed distance [m] from the cloud, at points, (n, 3) [m]."""
    number = np.arange(_LOBES)
    share = np.sqrt((number + 0.37) / _LOBES)
    angle = 2.39996 * number + 0.71
    rank = (0.618034 * number + 0.29) % 1.0
    tower = 1 - share**2.3
    centres = np.stack(
        [
            31.0 + 527.0 * share * np.cos(angle),
            -7.0 + 391.0 * share * np.sin(angle),
            _BASE + 53.0 + (83.0 + 337.0 * rank) * tower,
        ],
        axis=1,
    )
    radii = 89.0 + 83.0 * (1 - share) + 47.0 * ((0.754878 * number + 0.13) % 1.0)
    union = lobes(centres, radii, 13.7)(points) + 11.3 - 39.0 * bumps(points, 47.0)
    base = _BASE + 9.7 * np.sin(points[:, 0] / 131.0 + 0.9) * np.sin(points[:, 1] / 113.0) - points[:, 2]
    return np.maximum(union, base)


SCENE = SceneRecord(
    "cumulus",
    cumulus,
    "A cumulus of real droplets in a blue sky, about 5 000 triangles: a cloud of no simple shape.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, section 9 and Fig. 12: 5 000 triangles, 10 frames/s without noise",
    Animation(("light",)),
    clouds=True,
)
