# SPDX-License-Identifier: BSD-3-Clause
"""Timing: medians after warm-up, with their spread.

A frame is timed from the call to the arrays being ready on the device (`drjit.sync_thread`), kernels compiled and
recorded before. The wall clock is used on purpose: launch and replay are part of what a user waits for.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from realtime.frame import FrameRenderer, run_airlight, run_stages, run_surface
from realtime.motion import Objects, read_objects, turned_objects
from realtime.scene import Scene

#: Of a frame that takes longer than this the stages are timed once, in one more frame: its spread matters little, and
#: some thirty such frames, as others have, would take minutes [s].
SLOW = 8.0
_TURNS = 1.5  # about so long is spent on frames that are timed stage by stage, one to five of them [s]


@dataclass(frozen=True)
class Timing:
    """Repeated measurements of one piece of work [ms]."""

    median_ms: float
    low_ms: float  #: first quartile
    high_ms: float  #: third quartile
    repetitions: int


def time_repeated(work: Callable[[], Any], *, seconds: float = 0.6, least: int = 5, most: int = 200) -> Timing:
    """Time a piece of work again and again.

    Parameters
    ----------
    work
        Called with nothing; must leave its results evaluated.
    seconds
        Stop after about this long, but not before `least` repetitions.
    least, most
        Bounds of the number of repetitions.
    """
    (timing,) = time_in_turns([work], seconds=seconds, least=least, most=most)
    return timing


def time_in_turns(
    works: Sequence[Callable[[], Any]], *, seconds: float = 3.0, least: int = 5, most: int = 200
) -> list[Timing]:
    """Time several pieces of work in turns; parameters as in `times_in_turns`."""
    times = times_in_turns(works, seconds=seconds, least=least, most=most)
    quartiles = np.percentile(times, [25, 50, 75], axis=0).T
    return [Timing(float(median), float(low), float(high), len(times)) for low, median, high in quartiles]


def times_in_turns(
    works: Sequence[Callable[[], Any]], *, seconds: float, least: int, most: int, alternate: bool = False
) -> NDArray[np.float64]:
    """Time several pieces of work in turns, so that whatever else the machine does hits all of them alike.

    Parameters
    ----------
    works
        Each called with nothing; must leave its results evaluated.
    seconds
        Stop after about this long, but not before `least` turns.
    least, most
        Bounds of the number of turns.
    alternate
        Whether every other turn goes backwards: what comes second may find the caches warm.

    Returns
    -------
    array
        The times after two turns of warm-up [ms], (turns, works).
    """
    import drjit as dr

    for _ in range(2):  # the first call compiles and records, the second is the first replay
        for work in works:
            work()
            dr.sync_thread()
    times: list[list[float]] = []
    stop = time.perf_counter() + seconds
    while len(times) < least or (time.perf_counter() < stop and len(times) < most):
        turn = [0.0] * len(works)
        backwards = alternate and len(times) % 2
        for place in reversed(range(len(works))) if backwards else range(len(works)):
            start = time.perf_counter()
            works[place]()
            dr.sync_thread()
            turn[place] = 1e3 * (time.perf_counter() - start)
        times.append(turn)
    return np.array(times)


def timed_frame(renderer: FrameRenderer, scene: Scene):
    """Render a scene in which something moved, once; return the stages, and the times to prepare and to render [ms]."""
    import drjit as dr

    begin = time.perf_counter()
    prepared = renderer.prepare(scene)
    dr.sync_thread()
    middle = time.perf_counter()
    stages = run_stages(replace(renderer, scene=scene), prepared)
    dr.sync_thread()
    return stages, 1e3 * (middle - begin), 1e3 * (time.perf_counter() - middle)


@dataclass(frozen=True)
class FrameTimes:
    """What a frame costs [ms]."""

    frame: Timing  #: everything but what is static: camera rays, lit surface, airlight
    surface: Timing  #: camera rays and lit surface
    airlight: Timing  #: the airlight alone: the kernel with its ray set-up, or the marching
    rebuild: Timing  #: a frame after the light moved: shadow maps or silhouettes and planes, all stages
    moved: Timing  #: a frame after the objects moved too: acceleration structure, adjacent planes, all of the above


def time_frame(renderer: FrameRenderer, *, seconds: float = 0.6, slow: float | None = None) -> FrameTimes:
    """Time the stages of a frame, the whole frame, a frame after the light moved and one after the objects moved.

    Parameters
    ----------
    renderer
        Of the frame.
    seconds
        Time to spend on each of the five.
    slow
        If the airlight takes longer than this, whole frames are run stage by stage and the five are added up from
        them: up to five frames in place of some thirty; `SLOW` by default [s].
    """
    import drjit as dr

    scene = renderer.scene
    prepared = renderer.prepare(scene)
    distance, by_light = run_surface(renderer)
    dr.eval(distance, by_light)
    dr.sync_thread()
    begin = time.perf_counter()
    dr.eval(run_airlight(renderer, prepared, distance, by_light))
    dr.sync_thread()
    took = time.perf_counter() - begin
    if took > (SLOW if slow is None else slow):
        return _slow_frame(renderer, turns=int(np.clip(_TURNS / took, 1, 5)))

    def surface():
        dr.eval(run_surface(renderer))

    def airlight():
        dr.eval(run_airlight(renderer, prepared, distance, by_light))

    def rebuild():
        run_stages(renderer, renderer.prepare(scene))

    objects = _objects(scene)

    def moved():
        # Where they stand: the work is that of any other place.
        there = turned_objects(scene, objects, np.eye(3)) if objects else scene
        run_stages(renderer, renderer.prepare(there))

    return FrameTimes(
        frame=time_repeated(lambda: run_stages(renderer, prepared), seconds=seconds),
        surface=time_repeated(surface, seconds=seconds),
        airlight=time_repeated(airlight, seconds=seconds),
        rebuild=time_repeated(rebuild, seconds=0.5 * seconds, least=3),
        moved=time_repeated(moved, seconds=0.5 * seconds, least=3),
    )


def _slow_frame(renderer: FrameRenderer, *, turns: int) -> FrameTimes:
    """Time the stages of some frames."""
    import drjit as dr

    scene = renderer.scene
    objects = _objects(scene)
    steps = []
    for _ in range(turns):
        times = [time.perf_counter()]

        def done(times: list[float] = times) -> None:
            dr.sync_thread()
            times.append(time.perf_counter())

        there = turned_objects(scene, objects, np.eye(3)) if objects else scene
        done()
        prepared = renderer.prepare(there)
        done()
        distance, by_light = run_surface(renderer)
        dr.eval(distance, by_light)
        done()
        dr.eval(run_airlight(renderer, prepared, distance, by_light))
        done()
        steps.append(1e3 * np.diff(times))
    move, prepare, surface, airlight = np.array(steps).T

    def timing(milliseconds: NDArray[np.float64]) -> Timing:
        low, median, high = (float(value) for value in np.percentile(milliseconds, [25, 50, 75]))
        return Timing(median, low, high, turns)

    frame = surface + airlight
    rebuild = prepare + frame
    return FrameTimes(timing(frame), timing(surface), timing(airlight), timing(rebuild), timing(move + rebuild))


def _objects(scene: Scene) -> Objects | None:
    """Read all meshes of a scene whose vertices can be moved; None where there are none."""
    import mitsuba as mi

    if not scene.geometry.shapes():
        return None
    keys = list(mi.traverse(scene.geometry).keys())
    names = [key.rsplit(".", 1)[0] for key in keys if key.endswith(".vertex_positions")]
    return read_objects(scene, names) if names else None
