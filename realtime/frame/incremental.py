# SPDX-License-Identifier: BSD-3-Clause
"""The next frame of an animation: what did not change since the last one is kept.

| moved | made anew |
| --- | --- |
| camera | camera rays, lists of tiles, and what was prepared if it depends on the camera |
| geometry | everything |
| light | what was prepared, lists of tiles |
| medium, colours | nothing of these |

Surface and airlight are computed for every frame. Who calls says what moved: nothing is compared, so what moved without
being named stays where it was.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from realtime.frame.renderer import FrameRenderer, evaluated, run_cast_and_shade, run_cull, run_method, run_shade
from realtime.frame.surface import Cast
from realtime.methods.interface.layers import History
from realtime.methods.interface.method import Preparation
from realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class FrameCache:
    """What a frame leaves to the next one, by what it depends on."""

    cast: Cast  #: camera and geometry
    state: Any  #: lights and geometry, shadow planes also the camera: `Method.prepared_from`
    lists: Any  #: camera, geometry and lights
    history: History | None = None  #: the last frame, for passes over the image
    carried: Any = None  #: what the method handed on from the last frame


def next_frame(
    renderer: FrameRenderer,
    scene: Scene,
    cache: FrameCache | None,
    *,
    camera_moved: bool,
    geometry_moved: bool,
    light_moved: bool,
) -> tuple[tuple[Any, Any, Any], FrameCache]:
    """Render a scene, and reuse what the last frame left.

    Parameters
    ----------
    renderer
        The stages of the frame.
    scene
        The scene as it is now: that of the renderer but for camera, positions, lights, colours and medium.
    cache
        What the last frame left; None for the first, for which everything is made. If nothing is said to move in it,
        it is shaded by the function that the next ones will use: then these record nothing.
    camera_moved, geometry_moved, light_moved
        What is elsewhere than in the last frame, or turned: the camera, shapes or the bounds of media, a light. The
        medium and the colours of lights may have changed in any case.

    Returns
    -------
    stages
        As from `realtime.frame.renderer.run_stages`: bit by bit what it returns for this scene.
    cache
        For the next frame.
    """
    renderer = replace(renderer, scene=scene)
    cast_again = camera_moved or geometry_moved
    cull_again = cast_again or light_moved or cache is None
    moved = {"camera": camera_moved, "geometry": geometry_moved, "light": light_moved, "look": True}
    if cache is None or any(moved[what] for what in renderer.method.prepared_from):
        finish = _started(renderer.prepare, scene)
    else:
        finish = partial(getattr, cache, "state")
    if cast_again:
        cast, by_light = run_cast_and_shade(renderer)
    else:
        cast = cache.cast if cache else run_cast_and_shade(renderer)[0]
        by_light = run_shade(renderer, cast)
    state = finish()
    lists = cache.lists if cache and not cull_again else run_cull(renderer, state, cast.distance)
    last = (cache.history, cache.carried) if cache else (None, None)
    *layers, history, carried = run_method(renderer, state, cast, by_light, lists, *last)
    return evaluated(cast, by_light, layers), FrameCache(cast, state, lists, history, carried)


def _started(prepare: Preparation, scene: Scene) -> Callable[[], Any]:
    """Return what finishes the preparation.

    One that works on the host has a method `start`: it reads what it needs of the scene, for which the device must have
    come to rest, and returns the rest of the work, which is done while the device is busy with the surface.
    """
    if hasattr(prepare, "start"):
        return prepare.start(scene)
    prepared = prepare(scene)
    return lambda: prepared
