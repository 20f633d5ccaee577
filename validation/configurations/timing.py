# SPDX-License-Identifier: BSD-3-Clause
"""Timing: medians after warm-up, with their spread.

A timing runs from the call until the arrays are ready on the device (`drjit.sync_thread`), after kernels have been
compiled and recorded. It uses the wall clock on purpose: a user also waits for launch and replay.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from realtime.frame.incremental import FrameCache, next_frame, next_parts
from realtime.frame.light_on_ray import check_radiance
from realtime.frame.renderer import (
    FrameRenderer,
    frame_with_part,
    parts,
    run_cast_and_shade,
    run_cull,
    run_method,
    run_shade,
    run_stages,
)
from realtime.frame.surface import cast_rays
from realtime.numerics.recorded import Frozen
from realtime.scene.animate import Objects, read_objects, turned_objects
from realtime.scene.camera import ray_directions
from realtime.scene.read_scene import Scene

#: A frame that takes longer is timed stage by stage, in few frames [s]. Its spread matters little, and the usual thirty
#: or more frames would take minutes.
SLOW = 8.0
_TURNS = 1.5  # approximate time for the one to five frames that are timed stage by stage [s]


@dataclass(frozen=True)
class Timing:
    """Repeated measurements of one piece of work [ms]."""

    median_ms: float  #: median
    low_ms: float  #: first quartile
    high_ms: float  #: third quartile
    repetitions: int  #: number of measurements


def time_repeated(work: Callable[[], Any], *, seconds: float = 0.6, least: int = 5, most: int = 200) -> Timing:
    """Time a piece of work repeatedly.

    Parameters
    ----------
    work
        A function without arguments that evaluates its results.
    seconds
        Stop after about this long [s], but not before `least` repetitions.
    least, most
        Bounds of the number of repetitions.

    Returns
    -------
    Timing
        Median and quartiles [ms].
    """
    (timing,) = time_in_turns([work], seconds=seconds, least=least, most=most)
    return timing


def run_times(work: Callable[[], Any]) -> tuple[float, float]:
    """Return what `work` takes until its arrays are ready, by the clock and of the processors of all threads [ms]."""
    begin, spent = time.perf_counter(), time.process_time()
    work()
    dr.sync_thread()
    return 1e3 * (time.perf_counter() - begin), 1e3 * (time.process_time() - spent)


def time_in_turns(
    works: Sequence[Callable[[], Any]], *, seconds: float = 3.0, least: int = 5, most: int = 200
) -> list[Timing]:
    """Time several pieces of work in turns, so that other load on the machine affects all of them alike.

    Parameters
    ----------
    works
        Functions without arguments that evaluate their results.
    seconds
        Stop after about this long [s], but not before `least` turns.

    Returns
    -------
    list of Timing
        Median and quartiles [ms] of each, after two turns of warm-up.
    """
    for _ in range(2):  # the first call compiles and records, the second is the first replay
        for work in works:
            work()
            dr.sync_thread()
    times: list[list[float]] = []
    stop = time.perf_counter() + seconds
    while len(times) < least or (time.perf_counter() < stop and len(times) < most):
        turn = []
        for work in works:
            start = time.perf_counter()
            work()
            dr.sync_thread()
            turn.append(1e3 * (time.perf_counter() - start))
        times.append(turn)
    quartiles = np.percentile(times, [25, 50, 75], axis=0).T
    return [Timing(float(median), float(low), float(high), len(times)) for low, median, high in quartiles]


def timed_image(renderer: FrameRenderer, scene: Scene, caches: tuple[FrameCache, ...] | None, **moved: bool):
    """Render the next frame by `realtime.frame.incremental.next_parts`.

    Returns
    -------
    frame, caches
        The image on the host, and what its parts leave to the next frame.
    milliseconds
        What it took without bringing it to the host [ms].
    """
    in_turn, frame, kept, took = next_parts(renderer, scene, caches, **moved), None, [], 0.0
    while True:
        begin = time.perf_counter()
        found = next(in_turn, None)
        dr.sync_thread()
        took += 1e3 * (time.perf_counter() - begin)
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


def moved_light_alone(renderer: FrameRenderer, cache: FrameCache) -> Callable[[], Any]:
    """Return the work of a frame after the light alone moved, which reuses the camera rays of the cache."""
    return _step(renderer, cache, light_moved=True)


def changed_look(renderer: FrameRenderer, cache: FrameCache) -> Callable[[], Any]:
    """Return the work of a frame after only the medium or colours changed: surface and airlight are computed."""
    return _step(renderer, cache, light_moved=False)


def camera_rays(renderer: FrameRenderer) -> Callable[[], Any]:
    """Return the work of casting the camera rays without shading, the least time of a frame that casts them."""
    scene = renderer.scene

    @Frozen
    def cast(geometry, facets, pixel, camera):
        return cast_rays(geometry, facets, camera.origin, ray_directions(camera, pixel)[0]).distance

    return lambda: dr.eval(cast(scene.geometry, scene.facets, renderer.pixel, scene.camera))


def _step(renderer: FrameRenderer, cache: FrameCache | None, *, light_moved: bool) -> Callable[[], Any]:
    moved = {"camera_moved": cache is None, "geometry_moved": False, "light_moved": light_moved}
    return lambda: next_frame(renderer, renderer.scene, cache, **moved)


def first_frame(renderer: FrameRenderer) -> FrameCache:
    """Render the frame of the renderer's scene and return its cache for the next frame."""
    return next_frame(renderer, renderer.scene, None, camera_moved=True, geometry_moved=True, light_moved=True)[1]


@dataclass(frozen=True)
class FrameTimes:
    """The times of a frame and of its stages [ms]."""

    frame: Timing  #: camera rays, lit surface, tiles and airlight; shadow maps or planes are there
    surface: Timing  #: camera rays and lit surface
    airlight: Timing  #: tiles and airlight: the kernel with its ray set-up, or the marching
    light_moved: Timing  #: a frame after the light moved: shadow maps or silhouettes and planes, all stages
    objects_moved: Timing  #: a frame after the objects moved too: acceleration structure, adjacent planes, all stages
    light_moved_camera_kept: Timing  #: a frame after the light moved, with the camera rays of the last frame
    colours_changed: Timing  #: a frame after only medium or colours changed: surface and airlight from what is there


def time_frame(
    renderer: FrameRenderer, *, seconds: float = 0.6, slow: float | None = None, took: float | None = None
) -> FrameTimes:
    """Time the stages of a frame, the whole frame, and frames after light, objects or only colours changed.

    Parameters
    ----------
    seconds
        Time to spend on each of the first three, and half of it on each of the others.
    slow
        If a frame takes longer than this with its preparation, frames are run stage by stage and the seven are added up
        from them: up to five frames in place of some forty; `SLOW` by default [s]. So are images that are rendered in
        parts.
    took
        What the last frame took with its preparation, if one was rendered just before [s]; else two are.
    """
    if len(parts(renderer)) > 1:
        return _slow_frame(renderer, turns=3)
    scene = renderer.scene
    if took is None:
        first_frame(renderer)  # compiles and records
        begin = time.perf_counter()
        first_frame(renderer)
        dr.sync_thread()
        took = time.perf_counter() - begin
    if took > (SLOW if slow is None else slow):
        return _slow_frame(renderer, turns=int(np.clip(_TURNS / took, 1, 5)))
    cache = first_frame(renderer)
    state, cast = cache.state, cache.cast
    by_light = run_shade(renderer, cast)
    dr.eval(cast, by_light)

    def airlight():
        dr.eval(run_method(renderer, state, cast, by_light))

    def surface():
        dr.eval(run_cast_and_shade(renderer))

    objects = _objects(scene)

    def objects_moved():
        # Where they stand: the work is that of any other place.
        there = turned_objects(scene, objects, np.eye(3)) if objects else scene
        next_frame(renderer, there, None, camera_moved=False, geometry_moved=True, light_moved=True)

    def few(work: Callable[[], Any]) -> Timing:
        return time_repeated(work, seconds=0.5 * seconds, least=3)

    return FrameTimes(
        frame=time_repeated(lambda: run_stages(renderer, state), seconds=seconds),
        surface=time_repeated(surface, seconds=seconds),
        airlight=time_repeated(airlight, seconds=seconds),
        light_moved=few(moved_light(renderer)),
        objects_moved=few(objects_moved),
        light_moved_camera_kept=few(moved_light_alone(renderer, cache)),
        colours_changed=few(changed_look(renderer, cache)),
    )


def _slow_frame(renderer: FrameRenderer, *, turns: int) -> FrameTimes:
    """Time the stages of some frames."""
    scene, in_parts = renderer.scene, parts(renderer)
    objects = _objects(scene)
    steps = []
    for _ in range(turns):
        times = [time.perf_counter()]

        def done(times: list[float] = times) -> None:
            dr.sync_thread()
            times.append(time.perf_counter())

        there = turned_objects(scene, objects, np.eye(3)) if objects else scene
        done()
        state = renderer.prepare(there)
        done()
        of_parts = np.zeros(4)
        for part in in_parts:
            cast, by_light = run_cast_and_shade(part)
            dr.eval(cast, by_light)
            done()
            dr.eval(run_shade(part, cast))
            done()
            # Of many groups of lights in a large image, the lists would take most of the memory.
            apart = part.groups is None or len(in_parts) == 1
            lists = run_cull(part, state, cast.distance) if apart else None
            done()
            dr.eval(run_method(part, state, cast, by_light, lists))
            done()
            of_parts += np.diff(times[-5:])
        steps.append([*np.diff(times[:3]), *of_parts])
    move, prepare, surface, shade, in_tiles, rest = 1e3 * np.array(steps).T
    needed = renderer.method.prepared_from

    def timing(milliseconds: NDArray[np.float64]) -> Timing:
        low, median, high = (float(value) for value in np.percentile(milliseconds, [25, 50, 75]))
        return Timing(median, low, high, turns)

    airlight = in_tiles + rest
    light_moved = prepare + surface + airlight
    return FrameTimes(
        frame=timing(surface + airlight),
        surface=timing(surface),
        airlight=timing(airlight),
        light_moved=timing(light_moved),
        objects_moved=timing(move + light_moved),
        light_moved_camera_kept=timing(shade + airlight + prepare * bool(needed & {"light", "look"})),
        colours_changed=timing(shade + rest + prepare * ("look" in needed)),
    )


def _objects(scene: Scene) -> Objects | None:
    """Read all meshes of a scene whose vertices can be moved; None where there are none."""
    if not scene.geometry.shapes():
        return None
    keys = list(mi.traverse(scene.geometry).keys())
    names = [key.rsplit(".", 1)[0] for key in keys if key.endswith(".vertex_positions")]
    return read_objects(scene, names) if names else None
