# SPDX-License-Identifier: BSD-3-Clause
"""The next frame of an animation: what did not change since the last one is kept.

| moved | made anew |
| --- | --- |
| camera | camera rays, lists of tiles, and what was prepared if it depends on the camera |
| geometry | everything |
| light | what was prepared, lists of tiles; camera rays too where a black light with extent is seen |
| medium, colours | nothing of these |

Surface and airlight are computed for every frame. Who calls says what moved: nothing is compared, so what moved without
being named stays where it was.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import drjit as dr

from realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    give_memory_back,
    kept_groups,
    light_groups,
    no_light,
    parts,
    run_cast_and_shade,
    run_cull,
    run_group,
    run_method,
    run_shade,
)
from realtime.frame.surface import Cast
from realtime.methods.interface.layers import History
from realtime.methods.interface.method import Preparation
from realtime.scene.read_scene import Scene


@dataclass(frozen=True)
class FrameCache:
    """What a frame leaves to the next one, by what it depends on."""

    cast: Any  #: a `Cast`, of camera and geometry; None where the first frame is yet to cast it
    state: Any  #: lights and geometry, shadow planes also the camera: `Method.prepared_from`
    lists: Any  #: camera, geometry and lights; None of a part of a large image, whose frames sort anew
    history: History | None = None  #: the last frame, for passes over the image
    carried: Any = None  #: what the method handed on from the last frame
    extra: Any = None  #: further layers of the last frame by their names; no frame needs them


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
    moved = {"camera_moved": camera_moved, "geometry_moved": geometry_moved, "light_moved": light_moved}
    return _next_of(replace(renderer, scene=scene), cache, None, **moved)


def next_parts(
    renderer: FrameRenderer, scene: Scene, caches: tuple[FrameCache, ...] | None, **moved: bool
) -> Iterator[tuple[FrameRenderer, tuple[Any, Any, Any], FrameCache]]:
    """Render a scene as `next_frame` does, in parts where a large image can be.

    Parameters
    ----------
    renderer, scene, moved
        See `next_frame`.
    caches
        What the parts of the last frame left; None for the first.

    Yields
    ------
    part
        The stages of one part, with the scene: for `realtime.frame.renderer.frame_with_part`.
    stages, cache
        As of `next_frame`.
    """
    renderer, state = replace(renderer, scene=scene), None
    in_parts = parts(renderer)
    for number, part in enumerate(in_parts):
        stages, cache = _next_of(part, None if caches is None else caches[number], state, **moved)
        if len(in_parts) > 1:
            state, cache = cache.state, replace(cache, lists=None)  # the lists of all parts may fill the memory
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
    """Do what `next_frame` does for the scene of a renderer; a `state` was made for it before, where it is not None."""
    scene = renderer.scene
    geometry_moved |= light_moved and any(light.opaque for light in scene.area_lights)
    cast_again = camera_moved or geometry_moved
    cull_again = cast_again or light_moved
    moved = {"camera": camera_moved, "geometry": geometry_moved, "light": light_moved, "look": True}
    prepare_again = cache is None or any(moved[what] for what in renderer.method.prepared_from)
    if state is not None:
        cache = FrameCache(None, state, None) if cache is None else replace(cache, state=state)
    cull_again |= cache is None or cache.lists is None
    made = _Made(not prepare_again or state is not None, not cull_again, cache)
    if renderer.groups is not None:
        return _next_of_groups(renderer, made, cast_again=cast_again)
    state, lists, cast, by_light = _before_method(renderer, made, None, cast_again=cast_again)
    *layers, history, carried = run_method(renderer, state, cast, by_light, lists, *_last(cache))
    return evaluated(cast, by_light, layers), FrameCache(cast, state, lists, history, carried, layers[2])


def _last(cache: FrameCache | None) -> tuple[Any, Any]:
    """Return what the last frame left to passes, and what its method handed on."""
    return (cache.history, cache.carried) if cache else (None, None)


@dataclass(frozen=True)
class _Made:
    """What the last frame left, and whether its states and lists serve again."""

    state: bool
    lists: bool
    cache: FrameCache | None

    def of_group(self, number: int) -> "_Made":
        """Return what it left of one group of lights; states and lists of some are not kept."""
        if self.cache is None:
            return self
        state, lists = self.cache.state[number], self.cache.lists and self.cache.lists[number]
        kept = replace(self.cache, state=state, lists=lists)
        return _Made(self.state and state is not None, self.lists and lists is not None, kept)


def _before_method(renderer: FrameRenderer, made: _Made, cast: Cast | None, *, cast_again: bool):
    """Run the stages before the method's for one group of lights; `cast` is what a group before it cast."""
    cache = made.cache
    if cache is not None and made.state:
        finish: Callable[[], Any] = partial(getattr, cache, "state")
    else:
        finish = _started(renderer.prepare, renderer.scene)
    if cast is None and cast_again:
        cast, by_light = run_cast_and_shade(renderer)
    else:
        if cast is None:
            kept = cache.cast if cache else None
            cast = kept if kept is not None else run_cast_and_shade(renderer)[0]
        by_light = run_shade(renderer, cast)
    state = finish()
    lists = cache.lists if cache is not None and made.lists else run_cull(renderer, state, cast.distance)
    return state, lists, cast, by_light


def _next_of_groups(renderer: FrameRenderer, made: _Made, *, cast_again: bool):
    """Do what `next_frame` does, group of lights after group."""
    assert renderer.groups is not None
    groups = light_groups(renderer)
    history, carried = _last(made.cache)
    sums: Any = None
    beyond: Any = None
    cast: Any = None
    kept: list[tuple[Any, Any]] = []
    for number, group in enumerate(groups):
        state, lists, cast, by_light = _before_method(group, made.of_group(number), cast, cast_again=cast_again)
        first = kept[0][0] if kept else state
        kept.append((state, lists) if number < kept_groups(first) else (None, None))
        if renderer.groups.at_once:
            *layers, history, carried = run_method(group, state, cast, by_light, lists, history, carried)
            stages = evaluated(cast, by_light, layers)
            continue
        sums = sums or no_light(group.scene, dr.width(cast.distance))
        sums, more = run_group(group, sums, state, lists, cast, by_light)
        beyond = more if number == 0 else beyond
    states, all_lists = zip(*kept)
    if sums is not None:
        surface = sums[1] if beyond is None else sums[1] + beyond
        stages = evaluated(cast, (), (sums[0], surface))
    return stages, FrameCache(cast, states, all_lists, history, carried)


def _started(prepare: Preparation, scene: Scene) -> Callable[[], Any]:
    """Return what finishes the preparation.

    One that works on the host has a method `start`: it reads what it needs of the scene, for which the device must have
    come to rest, and returns the rest of the work, which is done while the device is busy with the surface.
    """
    if hasattr(prepare, "start"):
        return prepare.start(scene)
    prepared = prepare(scene)
    return lambda: prepared
