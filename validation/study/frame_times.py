# SPDX-License-Identifier: BSD-3-Clause
"""The times of a frame and of its stages, and of frames after light, objects or colours changed."""

from collections.abc import Callable
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from analytic.clock import Spent
from realtime.frame.incremental import FrameCache, next_frame, next_parts
from realtime.frame.light_on_ray import check_radiance
from realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    frame_with_part,
    parts,
    run_cast_and_shade,
    run_method,
    run_shade,
    run_stages,
)
from realtime.frame.surface import cast_rays
from realtime.methods.shader.method import drawn_again
from realtime.numerics.recorded import Frozen
from realtime.scene.animate import Objects, read_objects, turned_objects
from realtime.scene.camera import ray_directions
from realtime.scene.read_scene import Scene
from validation.clock import time_repeated, timed, timing_of
from validation.timing import FrameTimes, Timing

#: A frame that takes longer is timed stage by stage, in few frames [s]. Its spread matters little, and the usual thirty
#: or more frames would take minutes.
SLOW = 8.0
_BRIEF = 0.1  # on frames that are timed briefly, and as much on the airlight alone [s]
_BRIEF_MOST = 9  # of these frames
_BRIEF_SLOW = 500.0  # a slower one is timed once, without a warm-up of its own [ms]
_TURNS = 1.5  # approximate time for the one to five frames that are timed stage by stage [s]


def timed_image(renderer: FrameRenderer, scene: Scene, caches: tuple[FrameCache, ...] | None, **moved: bool):
    """Render the next frame by `realtime.frame.incremental.next_parts`.

    Return the image on the host, what its parts leave to the next frame, and what it took without bringing it to
    the host [ms].
    """
    in_turn, frame, kept, took = next_parts(renderer, scene, caches, **moved), None, [], 0.0
    while True:
        found, spent = timed(lambda: next(in_turn, None))
        took += spent.ms
        if found is None:
            assert frame is not None
            check_radiance(scene, renderer.method.name, frame.airlight, frame.surface, frame.distance)
            return frame, tuple(kept), took
        part, stages, cache = found
        frame = frame_with_part(frame, part, stages, cache.extra)
        kept.append(cache)
        del found, stages, cache


def moved_light(renderer: FrameRenderer) -> Callable[[], Any]:
    """Return the work of a frame after the light moved: all stages run again, camera rays too, in the same geometry."""
    return _step(renderer, None, light_moved=True)


def camera_rays(renderer: FrameRenderer) -> Callable[[], Any]:
    """Return the work of casting the camera rays without shading, the least time of a frame that casts them."""
    scene = renderer.scene

    @Frozen
    def cast(geometry, facets, pixel, camera):
        return cast_rays(geometry, facets, camera.origin, ray_directions(camera, pixel)[0]).distance

    return lambda: dr.eval(cast(scene.geometry, scene.facets, renderer.pixel, scene.camera))


def _step(renderer: FrameRenderer, cache: FrameCache | None, *, light_moved: bool) -> Callable[[], Any]:
    """Return the work of the next frame, which reuses what a cache has; without one camera rays are cast too."""
    moved = {"camera_moved": cache is None, "geometry_moved": False, "light_moved": light_moved}
    return lambda: next_frame(renderer, renderer.scene, cache, **moved)


def first_frame(renderer: FrameRenderer) -> FrameCache:
    """Render the frame of the renderer's scene and return its cache for the next frame."""
    return next_frame(renderer, renderer.scene, None, camera_moved=True, geometry_moved=True, light_moved=True)[1]


def time_frame(
    renderer: FrameRenderer, *, seconds: float = 0.6, slow: float | None = None, took: float | None = None
) -> FrameTimes:
    """Time the stages of a frame, the whole frame, and frames after light, objects or only colours changed.

    `seconds` are spent on each of the first three, and half as long on each of the others. If a frame takes longer than
    `slow` with its preparation [s], `SLOW` by default, frames are run stage by stage and the seven times are added up
    from the stages: up to five frames in place of some forty. The same holds for images that are rendered in parts.
    `took` is the time of the last frame with its preparation, if one was rendered just before [s]; else two are.
    """
    if len(parts(renderer)) > 1:
        return _slow_frame(renderer, turns=3)
    scene = renderer.scene
    if took is None:
        first_frame(renderer)  # compiles and records
        took = timed(lambda: first_frame(renderer))[1].seconds
    if took > (SLOW if slow is None else slow):
        return _slow_frame(renderer, turns=int(np.clip(_TURNS / took, 1, 5)))
    cache = first_frame(renderer)
    state, cast = cache.state, cache.cast
    by_light = run_shade(renderer, cast)
    dr.eval(cast, by_light)

    objects = _objects(scene)

    def objects_moved():
        # Where they stand: the work is that of any other place.
        there = turned_objects(scene, objects, np.eye(3)) if objects else scene
        next_frame(renderer, there, None, camera_moved=False, geometry_moved=True, light_moved=True)

    def few(work: Callable[[], Any]) -> Timing:
        return time_repeated(work, seconds=0.5 * seconds, least=3)

    return FrameTimes(
        frame=time_repeated(lambda: run_stages(renderer, state), seconds=seconds),
        surface=time_repeated(partial(_ready, run_cast_and_shade, renderer), seconds=seconds),
        airlight=time_repeated(partial(_ready, run_method, renderer, state, cast, by_light), seconds=seconds),
        light_moved=few(moved_light(renderer)),
        objects_moved=few(objects_moved),
        light_moved_camera_cached=few(_step(renderer, cache, light_moved=True)),
        colours_changed=few(_step(renderer, cache, light_moved=False)),
    )


def brief_times(renderer: FrameRenderer) -> tuple[FrameTimes, float]:
    """Time frames for a tenth of a second, and as long their airlight alone; return what a preparation takes too [ms].

    The renderer has made a frame before, so that its kernels are compiled.
    """
    state, preparation = timed(lambda: renderer.prepare(renderer.scene))
    frame = _brief(lambda: run_stages(renderer, state))
    if frame.median_ms >= _BRIEF_SLOW:  # camera rays and surfaces take little of it, and it takes too long to ask
        return FrameTimes(frame, frame), preparation.ms
    cast, by_light = run_cast_and_shade(renderer)
    dr.eval(cast, by_light)

    def airlight():
        return evaluated(cast, run_method(renderer, state, cast, by_light))

    return FrameTimes(frame, _brief(airlight)), preparation.ms


def shader_times(renderer: FrameRenderer, seconds: float | None = None) -> tuple[str, FrameTimes]:
    """Return the device that draws a shader, and the times of all its passes there for so many seconds, by default few.

    Transfers from and to the host are left out: an engine has its rays and its maps.
    """
    state = renderer.prepare(renderer.scene)
    run_stages(renderer, state)
    device, times = drawn_again(state[0], _BRIEF if seconds is None else seconds)
    timing = timing_of(times)
    return device, FrameTimes(timing, timing)


def _brief(work: Callable[[], Any]) -> Timing:
    """Time some runs after one of warm-up; a slow one is not repeated."""
    _, first = timed(work)
    if first.ms >= _BRIEF_SLOW:
        return timing_of([first.ms], cpu_ms=first.cpu_ms)
    return time_repeated(work, seconds=_BRIEF, least=1, most=_BRIEF_MOST, warm_up=0)


def _slow_frame(renderer: FrameRenderer, *, turns: int) -> FrameTimes:
    """Time the stages of some frames; objects are moved once, after a warm-up: no method changes what that takes."""
    there, in_parts, move = renderer.scene, parts(renderer), Spent()
    objects = _objects(there)
    if objects:
        for _ in range(2):
            there, move = timed(lambda: turned_objects(renderer.scene, objects, np.eye(3)))
    steps = []
    for _ in range(turns):
        state, prepare = timed(partial(renderer.prepare, there))
        of_parts = np.zeros(3)
        for part in in_parts:
            (cast, by_light), surface = timed(partial(_ready, run_cast_and_shade, part))
            shade = timed(partial(_ready, run_shade, part, cast))[1]
            airlight = timed(partial(_ready, run_method, part, state, cast, by_light))[1]
            of_parts += surface.ms, shade.ms, airlight.ms
        steps.append([prepare.ms, *of_parts])
    prepares, surfaces, shades, airlights = np.array(steps).T
    needed = renderer.method.prepared_from
    light_moved = prepares + surfaces + airlights
    return FrameTimes(
        frame=timing_of(surfaces + airlights),
        surface=timing_of(surfaces),
        airlight=timing_of(airlights),
        light_moved=timing_of(light_moved),
        objects_moved=timing_of(move.ms + light_moved),
        light_moved_camera_cached=timing_of(shades + airlights + prepares * bool(needed & {"light", "look"})),
        colours_changed=timing_of(shades + airlights + prepares * ("look" in needed)),
    )


def _ready(stage: Callable[..., Any], *given: Any) -> Any:
    """Return what a stage gives, evaluated."""
    result = stage(*given)
    dr.eval(result)
    return result


def _objects(scene: Scene) -> Objects | None:
    """Read all meshes of a scene whose vertices can be moved; None where there are none."""
    if not scene.geometry.shapes():
        return None
    keys = list(mi.traverse(scene.geometry).keys())
    names = [key.rsplit(".", 1)[0] for key in keys if key.endswith(".vertex_positions")]
    return read_objects(scene, names) if names else None
