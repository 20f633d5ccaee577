# SPDX-License-Identifier: BSD-3-Clause
"""Frames of small scenes that tests share: a process renders each once, anyone who looks at it.

Scenes are read again for each frame: Dr.Jit's virtual calls go over all shapes that are alive. A
scene that holds shapes of Mitsuba, such as meshes, has no description to find its frame by, and is
rendered each time.
"""

from collections.abc import Mapping
from typing import Any

import mitsuba as mi
import numpy as np

from airlight.realtime.frame.image import render_frame
from airlight.realtime.frame.renderer import frame_renderer
from airlight.realtime.methods.registry import METHODS
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.quadrature.image import quadrature_image
from airlight.reference.scene.read import read_reference
from airlight.validation.study.configuration import find_kernel

_FRAMES: dict[Any, Any] = {}


def read(scene: Any, precision: str = "single") -> Scene:
    """Return the scene of a dictionary or of Mitsuba; one that was read as it is."""
    scene = mi.load_dict(scene) if isinstance(scene, dict) else scene
    return scene if isinstance(scene, Scene) else read_scene(scene, precision)


def renderer(
    scene: Any, method: Any, *, kernel: str = "exact", precision: str = "single", **options: Any
):
    """Return the frame renderer of a method, or of its name, for anything that `read` takes."""
    method = METHODS[method] if isinstance(method, str) else method
    return frame_renderer(read(scene, precision), method, kernel=find_kernel(kernel), **options)


def render(scene: Any, method: Any = "unshadowed", **options: Any):
    """Return a frame; `options` as of `renderer`."""
    return render_frame(renderer(scene, method, **options))


def frame(scene: dict[str, Any], method: str = "unshadowed", **options: Any):
    """Return a frame as `render` does, once in a process; not for tests that
    replace a part of the code.
    """
    return _once(("frame", scene, method, options), lambda: render(scene, method, **options))


def reference_of(scene: dict[str, Any]):
    """Return the image of the quadrature reference, which shares no code with the methods."""
    return _once(
        ("reference", scene), lambda: quadrature_image(read_reference(mi.load_dict(scene)))
    )


def relative_rmse(values: Any, expected: Any) -> float:
    """Return the root of the mean square difference over the mean of what is expected."""
    return float(
        np.sqrt(np.mean((np.asarray(values, dtype=np.float64) - expected) ** 2)) / np.mean(expected)
    )


def _once(description: tuple[Any, ...], make: Any) -> Any:
    try:
        key = _key(description)
    except TypeError:
        return make()
    if key not in _FRAMES:
        _FRAMES[key] = make()
    return _FRAMES[key]


def _key(value: Any) -> Any:
    """Return what tells a description from others: two transforms of one matrix are the same."""
    if isinstance(value, Mapping):
        return tuple((name, _key(entry)) for name, entry in value.items())
    if isinstance(value, list | tuple):
        return tuple(_key(entry) for entry in value)
    if hasattr(value, "matrix"):
        return np.array(value.matrix).tobytes()
    if value is None or isinstance(value, str | int | float):
        return value
    raise TypeError
