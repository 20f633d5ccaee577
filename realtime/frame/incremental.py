# SPDX-License-Identifier: BSD-3-Clause
"""The next frame of an animation: what did not change since the last one is kept.

| moved | made again |
| --- | --- |
| camera | camera rays, and what was prepared if it depends on the camera |
| geometry | everything |
| light | what was prepared; camera rays too where a black area light is visible |
| medium, colours | nothing of these |

Surface and airlight are computed for every frame. The caller says what moved: nothing is compared,
so what moved without being named stays where it was.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

from airlight.realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    give_memory_back,
    parts,
    run_cast_and_shade,
    run_method,
    run_shade,
)
from airlight.realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class FrameCache:
    """The parts of a frame that the next one can use again, each with its dependencies."""

    cast: Any  #: a `Cast`, of camera and geometry; None where the first frame is yet to cast it
    state: Any  #: lights and geometry, shadow planes also the camera: `Method.prepared_from`
    carried: Any = None  #: arrays that the method handed on from the last frame
    extra: Any = None  #: further layers of the last frame by their names; no frame needs them
    frames: int = 1  #: how many frames there were


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

    `renderer`: the stages of the frame, with the number of the first one. `scene`: the scene as it
    is now: that of the renderer except for camera, positions, lights, colours and medium. `cache`:
    that of the last frame; None for the first, for which everything is made. If nothing is said to
    move in the first frame, it is shaded by the function that later frames use, which then record
    nothing. `camera_moved`, `geometry_moved`, `light_moved`: whether the camera, shapes or the
    bounds of media, or a light moved or turned since the last frame. The medium and the colours of
    lights may have changed in any case. Returns `stages`: bit by bit the result of
    `realtime.frame.renderer.run_stages` for this scene; `cache`: for the next frame.
    """
    moved = {
        "camera_moved": camera_moved,
        "geometry_moved": geometry_moved,
        "light_moved": light_moved,
    }
    return _next_of(replace(renderer, scene=scene), cache, None, **moved)


def next_parts(
    renderer: FrameRenderer, scene: Scene, caches: tuple[FrameCache, ...] | None, **moved: bool
) -> Iterator[tuple[FrameRenderer, tuple[Any, Any, Any], FrameCache]]:
    """Render a scene as `next_frame` does, in parts where a large image can be.

    `renderer`, `scene`, `moved`: see `next_frame`; `caches`: what the parts of the last frame left;
    None for the first. Yields `part`: the stages of one part, with the scene: for
    `realtime.frame.image.frame_with_part`; `stages`, `cache`: as of `next_frame`.
    """
    renderer, state = replace(renderer, scene=scene), None
    for number, part in enumerate(parts(renderer)):
        stages, cache = _next_of(part, None if caches is None else caches[number], state, **moved)
        state = cache.state
        give_memory_back(renderer)  # the host's images need room now
        yield part, stages, cache
        del stages, cache


def _next_of(
    renderer: FrameRenderer,
    cache: FrameCache | None,
    state: Any,
    *,
    camera_moved: bool,
    geometry_moved: bool,
    light_moved: bool,
) -> tuple[tuple[Any, Any, Any], FrameCache]:
    """Do what `next_frame` does for the scene of a renderer; a `state` was made for it
    before, where it is not None.
    """
    frames = cache.frames if cache else 0
    renderer = replace(renderer, frame=renderer.frame + frames)
    geometry_moved |= light_moved and any(light.opaque for light in renderer.scene.area_lights)
    moved = {"camera": camera_moved, "geometry": geometry_moved, "light": light_moved, "look": True}
    if state is None:
        state = cache.state if cache else None
        if state is None or any(moved[what] for what in renderer.method.prepared_from):
            state = renderer.prepare(renderer.scene)
    cast = cache.cast if cache else None
    if camera_moved or geometry_moved:
        cast, lit = run_cast_and_shade(renderer)
    else:
        cast = run_cast_and_shade(renderer)[0] if cast is None else cast
        lit = run_shade(renderer, cast)
    rendered = run_method(renderer, state, cast, lit, cache.carried if cache else None)
    return evaluated(cast, rendered), FrameCache(
        cast, state, rendered.carried, rendered.extra, frames + 1
    )
