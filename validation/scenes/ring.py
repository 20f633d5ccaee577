# SPDX-License-Identifier: BSD-3-Clause
"""A ring of cloud: sunlight goes through its upper part, a gap of clear air and its lower part."""

from typing import Any

from validation.scenes.cloud_parts import cloud, sun
from validation.scenes.clouds.surfaces import Mesh
from validation.scenes.parts import camera, medium_boundary, placed, rotation
from validation.scenes.record import Animation, SceneRecord
from validation.scenes.solids import torus


def ring() -> dict[str, Any]:
    """Return a torus on edge, lit from above: depth maps take the gap in it for cloud."""
    return {
        "type": "scene",
        "sensor": camera((-97.0, -1279.0, 883.0), (7.0, 3.0, 903.0), fov=48.7, size=(800, 600), in_fog=False),
        "sun": sun((0.173, 0.241, -0.955), (3.17, 3.05, 2.83)),
        "cloud": medium_boundary("cloud", ring_mesh(), cloud({"type": "hg", "g": 0.8493})),
    }


def ring_mesh() -> Mesh:
    """Return the surface of the ring."""
    return placed(torus(307.0, 113.0, (89, 43)), (13.0, -19.0, 907.0), rotation((1, 0.07, 0.03), 83.0))


SCENE = SceneRecord(
    "ring",
    ring,
    "A ring of cloud on edge, 7 654 triangles: a gap of clear air that depth maps take for cloud.",
    "Bouthors, Neyret, Max, Bruneton, Crassin 2008, Fig. 11a",
    Animation(("light",)),
    clouds=True,
)
