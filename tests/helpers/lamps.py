# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes with area lights, and frames of them."""

from typing import Any

import mitsuba as mi

from tests.helpers.scenes import tiny_scene

BLACK = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.0, 0.0, 0.0]}}


def lamp(shape="rectangle", *, size=0.31, radiance=(5.0, 4.0, 3.0)):
    """Return a black lamp above the sphere of
    `tests.helpers.scenes.tiny_scene` that shines down on it.
    """
    to_world = (
        mi.ScalarTransform4f().look_at([0.7, -0.3, 2.1], [0.1, 0.1, 0.4], [0, 1, 0]).scale(size)
    )
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
    return {"type": shape, "to_world": to_world, "bsdf": BLACK, "emitter": emitter}


def lamp_scene(shape="rectangle", **changes):
    """Return the tiny scene with an area light for its point light."""
    return tiny_scene(**({"lamp": lamp(shape)} | changes))


def area_lamp(
    kind: str, *, size: Any = (0.31, 0.17), material: Any = None, **changes: Any
) -> dict[str, Any]:
    """Return a lamp above the sphere of the tiny scene that faces it;
    `material` is black unless given.
    """
    turned = mi.ScalarTransform4f().look_at([0.83, 0.61, 1.97], [0.13, 0.07, 0.31], [0, 0, 1])
    across, up = size if isinstance(size, tuple) else (size, size)
    scale = mi.ScalarTransform4f().scale([across, up, min(across, up)])
    radiance = {"type": "rgb", "value": [5.3, 4.1, 2.9]}
    emitter = {"type": "area", "radiance": radiance}
    return {
        "type": kind,
        "to_world": turned @ scale,
        "bsdf": material or BLACK,
        "emitter": emitter,
    } | changes


def lit_by(
    kind: str = "rectangle", *, size: Any = 0.23, changes: Any = None, **of_lamp: Any
) -> dict[str, Any]:
    """Return the tiny scene with triangles for occluders, under an area light alone."""
    ball = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f()
        .translate([0.1, 0.1, 0.57])
        .rotate([1, 2, 3], 37)
        .scale(0.29),
        "bsdf": tiny_scene()["ball"]["bsdf"],
    }
    return tiny_scene(
        **({"lamp": area_lamp(kind, size=size, **of_lamp), "ball": ball} | (changes or {}))
    )
