# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes with lights with extent, and frames of them."""

from tests.helpers.scenes import tiny_scene


def lamp(shape="rectangle", *, size=0.31, radiance=(5.0, 4.0, 3.0)):
    """Return a black lamp above the sphere of `tests.helpers.scenes.tiny_scene` that shines down on it."""
    import mitsuba as mi

    to_world = mi.ScalarTransform4f().look_at([0.7, -0.3, 2.1], [0.1, 0.1, 0.4], [0, 1, 0]).scale(size)
    black = {"type": "diffuse", "reflectance": {"type": "rgb", "value": 0.0}}
    emitter = {"type": "area", "radiance": {"type": "rgb", "value": list(radiance)}}
    return {"type": shape, "to_world": to_world, "bsdf": black, "emitter": emitter}


def lamp_scene(shape="rectangle", **changes):
    """Return the tiny scene with a lamp with extent for its point light."""
    return tiny_scene(**({"lamp": lamp(shape)} | changes))
