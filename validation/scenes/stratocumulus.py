# SPDX-License-Identifier: BSD-3-Clause
"""A layer of stratocumulus of about 130 000 triangles: cells and bumps on top, nearly flat below."""

from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.scenes.cloud_parts import cloud, droplets, sun
from validation.scenes.clouds.lobes import bumps
from validation.scenes.clouds.surfaces import Mesh, between_heights
from validation.scenes.parts import camera, medium_boundary
from validation.scenes.record import Animation, SceneRecord

Array = NDArray[np.float64]

_BASE = 611.0  #: height of the base [m]
_HALF = (2713.0, 1879.0)  #: half the sides [m]


def stratocumulus() -> dict[str, Any]:
    """Return the layer, 5.4 km by 3.8 km and about 300 m thick, seen from above and lit from the right."""
    return {
        "type": "scene",
        "sensor": camera((-317.0, -1973.0, 1487.0), (-83.0, 113.0, 793.0), fov=63.7, size=(800, 600), in_fog=False),
        "sun": sun((-0.617, 0.283, -0.734), (3.17, 3.05, 2.83)),
        "cloud": medium_boundary("cloud", stratocumulus_mesh(), cloud(droplets())),
    }


def stratocumulus_mesh() -> Mesh:
    """Return the surface of the layer, 129 596 triangles."""
    x, y = (np.linspace(-half, half, count) for half, count in zip(_HALF, (216, 150), strict=True))
    plane = np.stack([*np.meshgrid(x, y, indexing="ij"), np.zeros((216, 150))], axis=-1).reshape(-1, 3)
    rim = np.minimum(*((half - np.abs(plane[:, axis])) / 431.0 for axis, half in enumerate(_HALF)))
    rim = np.clip(rim, 0.0, 1.0)
    full = rim * rim * (3 - 2 * rim)
    cells, hills = bumps(plane, 173.0), bumps(plane + np.array([371.0, 59.0, 0.0]), 61.0)
    top = _BASE + 37.0 + full * (113.0 + 197.0 * cells + 53.0 * hills * cells)
    bottom = _BASE - full * 29.0 * bumps(plane + np.array([97.0, 1013.0, 0.0]), 137.0)
    return between_heights(x, y, bottom.reshape(216, 150), top.reshape(216, 150))


SCENE = SceneRecord(
    "stratocumulus",
    stratocumulus,
    "A layer of stratocumulus of real droplets, 129 596 triangles: a cloud near to a slab, with cells and bumps.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, section 9: 130 000 triangles, 10 frames/s",
    Animation(("light",)),
    clouds=True,
)
