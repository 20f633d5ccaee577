# SPDX-License-Identifier: BSD-3-Clause
"""The times of a frame and of its stages, and of frames after light, objects or colours changed.

A *turn* of a method renders its frames once; methods take turns (`validation.study.turns`).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from functools import partial
from typing import TypeVar

import drjit as dr
import mitsuba as mi
import numpy as np

from airlight.analytic.clock import Spent
from airlight.realtime.frame.image import frame_with_part
from airlight.realtime.frame.incremental import FrameCache, next_frame, next_parts
from airlight.realtime.frame.light_on_ray import check_radiance
from airlight.realtime.frame.renderer import (
    FrameRenderer,
    evaluated,
    parts,
    run_cast_and_shade,
    run_method,
    run_shade,
    run_stages,
)
from airlight.realtime.frame.surface import cast_rays
from airlight.realtime.methods.shader.method import drawn_again
from airlight.realtime.numerics.array_types import aligned_array
from airlight.realtime.numerics.recorded import Frozen
from airlight.realtime.scene.animate import Objects, read_objects, turned_objects
from airlight.realtime.scene.camera import ray_directions, tiled_pixels
from airlight.realtime.scene.read_scene import Scene
from airlight.validation.clock import timed, timing_of
from airlight.validation.timing import FrameTimes, TimingRun

_Result = TypeVar("_Result")
#: The work of a frame: its result is the frame's stages and a cache for the next frame.
NextFrame = Callable[[], tuple[tuple[object, object, object], FrameCache]]


def timed_image(
    renderer: FrameRenderer, scene: Scene, caches: tuple[FrameCache, ...] | None, **moved: bool
):
    """Render the next frame by `realtime.frame.incremental.next_parts`.

    Return the image on the host, the caches of its parts for the next frame, and the time without
    the transfer to the host [ms].
    """
    in_turn, frame, took = next_parts(renderer, scene, caches, **moved), None, 0.0
    caches_after: list[FrameCache] = []
    while True:
        # Only rendering a part is timed. Bringing it to the host and putting it in its place
        # happens between two parts.
        result, spent = timed(lambda: next(in_turn, None))
        took += spent.ms
        if result is None:
            assert frame is not None
            check_radiance(
                scene, renderer.method.name, frame.airlight, frame.surface, frame.distance
            )
            return frame, tuple(caches_after), took
        part, stages, cache = result
        frame = frame_with_part(frame, part, stages, cache.extra)
        caches_after.append(cache)
        # The device must not hold the images of two parts at once.
        del result, stages, cache


def moved_light(renderer: FrameRenderer) -> NextFrame:
    """Return the work of a frame after the light moved: all stages run again, camera rays
    too, in the same geometry.
    """
    return _step(renderer, None, light_moved=True)


def camera_rays(scene: Scene) -> Callable[[], None]:
    """Return the work of casting the camera rays without shading, the least time of
    a frame that casts them.
    """
    pixel = aligned_array(mi.UInt32, tiled_pixels(scene.camera.width, scene.camera.height))
    dr.eval(pixel)

    @Frozen
    def cast(geometry, facets, pixel, camera):
        return cast_rays(geometry, facets, camera.origin, ray_directions(camera, pixel)[0]).distance

    return lambda: dr.eval(cast(scene.geometry, scene.facets, pixel, scene.camera))


def _step(renderer: FrameRenderer, cache: FrameCache | None, *, light_moved: bool) -> NextFrame:
    """Return the work of the next frame, which reuses a cache; without one camera rays are cast
    too.
    """
    moved = {"camera_moved": cache is None, "geometry_moved": False, "light_moved": light_moved}
    return lambda: next_frame(renderer, renderer.scene, cache, **moved)


def first_frame(renderer: FrameRenderer) -> FrameCache:
    """Render the frame of the renderer's scene and return its cache for the next frame."""
    return next_frame(
        renderer, renderer.scene, None, camera_moved=True, geometry_moved=True, light_moved=True
    )[1]


@dataclass(frozen=True)
class FrameSpent:
    """The times of the frames of one turn, by the names of `FrameTimes`; None for a frame that was
    not asked for.
    """

    frame: Spent
    airlight: Spent
    surface: Spent | None = None
    light_moved: Spent | None = None
    light_moved_camera_cached: Spent | None = None
    colours_changed: Spent | None = None
    prepare: Spent | None = None  #: for the state of the method, where it is timed by itself


#: A turn of a method: its frames, each once; a shader draws several.
Turn = Callable[[], list[FrameSpent]]


def whole_turn(renderer: FrameRenderer) -> Turn:
    """Return a turn whose frames are timed as wholes, each by itself, with
    their two largest stages.
    """

    def turn() -> list[FrameSpent]:
        # The preparation on the host goes on while the device is busy with the
        # surface: no sum of stages.
        (_, cache), light_moved = timed(moved_light(renderer))
        (cast, lit), surface = timed(partial(_ready, run_cast_and_shade, renderer))
        airlight = timed(partial(_ready, run_method, renderer, cache.state, cast, lit))[1]
        frame = timed(lambda: run_stages(renderer, cache.state))[1]
        camera_cached = timed(_step(renderer, cache, light_moved=True))[1]
        colours = timed(_step(renderer, cache, light_moved=False))[1]
        return [FrameSpent(frame, airlight, surface, light_moved, camera_cached, colours)]

    return turn


def staged_turn(renderer: FrameRenderer) -> Turn:
    """Return a turn of one frame, stage by stage, of which all frames are sums; large
    images are run in parts.
    """
    in_parts, needed = parts(renderer), renderer.method.prepared_from

    def turn() -> list[FrameSpent]:
        state, prepare = timed(partial(renderer.prepare, renderer.scene))
        # `surface` casts the camera rays and shades; `shade` alone is for frames in which the
        # camera stands still.
        surface, shade, airlight = Spent(), Spent(), Spent()
        for part in in_parts:
            (cast, lit), spent = timed(partial(_ready, run_cast_and_shade, part))
            surface += spent
            shade += timed(partial(_ready, run_shade, part, cast))[1]
            airlight += timed(partial(_ready, run_method, part, state, cast, lit))[1]
        # A frame after a change prepares again if the method's state depends on the change.
        frame, nothing = surface + airlight, Spent()
        camera_cached = shade + airlight + (prepare if needed & {"light", "look"} else nothing)
        colours = shade + airlight + (prepare if "look" in needed else nothing)
        return [FrameSpent(frame, airlight, surface, prepare + frame, camera_cached, colours)]

    return turn


def brief_turn(renderer: FrameRenderer) -> Turn:
    """Return a turn of one frame, with its airlight alone; of a long frame that is the frame."""

    def turn() -> list[FrameSpent]:
        state, prepare = timed(lambda: renderer.prepare(renderer.scene))
        frame = timed(lambda: run_stages(renderer, state))[1]
        # Camera rays and surfaces take little of a frame of half a second, and timing them would
        # take too long [ms].
        if frame.ms >= 500.0:
            return [FrameSpent(frame, frame, prepare=prepare)]
        cast, lit = run_cast_and_shade(renderer)
        dr.eval(cast, lit)
        airlight = timed(lambda: evaluated(cast, run_method(renderer, state, cast, lit)))[1]
        return [FrameSpent(frame, airlight, prepare=prepare)]

    return turn


def shader_turn(renderer: FrameRenderer, seconds: float) -> tuple[str, Turn]:
    """Return the device that draws a shader, and a turn of all its passes
    there for so many seconds.

    Transfers from and to the host are left out: an engine has its rays and its maps.
    """
    state = renderer.prepare(renderer.scene)
    run_stages(renderer, state)
    device, _ = drawn_again(state[0], 0.0)  # warms up

    def turn() -> list[FrameSpent]:
        spent = (Spent(1e-3 * ms) for ms in drawn_again(state[0], seconds)[1])
        return [FrameSpent(each, each) for each in spent]

    return device, turn


def object_moves(scene: Scene) -> Callable[[], Scene] | None:
    """Return the work of moving all objects of a scene to the places where they are; None where
    none can be moved.

    A move to any other place takes as long, for all methods.
    """
    objects = _objects(scene)
    return None if objects is None else partial(turned_objects, scene, objects, np.eye(3))


def times_of(spent: Sequence[FrameSpent], moves: Sequence[Spent], run: TimingRun) -> FrameTimes:
    """Return the times of the frames of all turns in a run; `moves`: what moving all
    objects took, if anybody asks.
    """
    timings = {}
    for each in fields(FrameSpent):
        values = [
            value for value in (getattr(one, each.name) for one in spent) if value is not None
        ]
        if values and each.name != "prepare":
            timings[each.name] = timing_of(values)
    # A frame after objects moved is a frame after the light moved, and the move: the median one
    # is added to each. A scene without an object that moves has the frame alone.
    lights = [one.light_moved for one in spent if one.light_moved is not None]
    if lights and moves:
        move = sorted(moves, key=lambda one: one.seconds)[len(moves) // 2]
        timings["objects_moved"] = timing_of([move + one for one in lights])
    elif lights:
        timings["objects_moved"] = timings["light_moved"]
    return FrameTimes(**timings, run=run)


def _ready(stage: Callable[..., _Result], *arguments: object) -> _Result:
    """Return the result of a stage, evaluated."""
    result = stage(*arguments)
    dr.eval(result)
    return result


def _objects(scene: Scene) -> Objects | None:
    """Read all meshes of a scene whose vertices can be moved; None where there are none."""
    if not scene.geometry.shapes():
        return None
    keys = list(mi.traverse(scene.geometry).keys())
    names = [key.rsplit(".", 1)[0] for key in keys if key.endswith(".vertex_positions")]
    return read_objects(scene, names) if names else None
