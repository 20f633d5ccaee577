# SPDX-License-Identifier: BSD-3-Clause
"""Frames of small scenes that tests share: a process renders each once, whoever looks at it.

Scenes are read anew for each frame: Dr.Jit's virtual calls go over all shapes that are alive. A scene that holds shapes
of Mitsuba, such as meshes, has no description to find its frame by, and is rendered each time.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

_FRAMES: dict[Any, Any] = {}


def read(scene: dict[str, Any], precision: str = "single") -> Any:
    """Return the scene of a dictionary."""
    import mitsuba as mi

    from realtime.scene.read_scene import read_scene

    return read_scene(mi.load_dict(scene), precision)


def frame(scene: dict[str, Any], method: str, *, kernel: str = "exact", precision: str = "single", **parameters: Any):
    """Return the frame of a method; not for tests that replace a part of the code."""
    from realtime.frame.renderer import frame_renderer, render_frame
    from realtime.kernels.registry import KERNELS
    from realtime.methods.registry import METHODS

    def rendered():
        function = KERNELS[kernel].function
        return render_frame(frame_renderer(read(scene, precision), METHODS[method], kernel=function, **parameters))

    return _once(("frame", scene, method, kernel, precision, parameters), rendered)


def truth(scene: dict[str, Any]):
    """Return the image of the quadrature reference, which shares no code with the methods."""
    import mitsuba as mi

    from reference.quadrature.image import quadrature_image
    from reference.scene.read import read_truth

    return _once(("truth", scene), lambda: quadrature_image(read_truth(mi.load_dict(scene)), edges="geometry"))


def relative_rmse(values: Any, expected: Any) -> float:
    """Return the root of the mean square difference over the mean of what is expected."""
    return float(np.sqrt(np.mean((np.asarray(values, dtype=np.float64) - expected) ** 2)) / np.mean(expected))


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
