# SPDX-License-Identifier: BSD-3-Clause
"""Small scenes with lights with extent, and frames of them."""

from tests.helpers import frames
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


def renderer(scene, method="soft-shafts", *, kernel=None, precision="single", **parameters):
    """Return the frame renderer of a method for a dictionary of a scene, and the scene that was read."""
    import mitsuba as mi

    from realtime.frame.renderer import frame_renderer
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene

    read = read_scene(mi.load_dict(scene), precision)
    function = KERNELS[kernel].function if kernel else None
    return frame_renderer(read, METHODS[method], kernel=function, **parameters)


def frame(scene, method="soft-shafts", **options):
    """Return the frame of a method, which all tests share; see `tests.helpers.frames.frame`."""
    return frames.frame(scene, method, **options)
