# SPDX-License-Identifier: BSD-3-Clause
"""Timing: medians after warm-up, with their spread.

A frame is timed from the call to the arrays being ready on the device (`drjit.sync_thread`), kernels compiled and
recorded before. The wall clock is used on purpose: launch and replay are part of what a user waits for.
"""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from realtime.frame import FrameRenderer, run_stages


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
    import drjit as dr

    for _ in range(2):  # the first call compiles and records, the second is the first replay
        work()
        dr.sync_thread()
    times: list[float] = []
    stop = time.perf_counter() + seconds
    while len(times) < least or (time.perf_counter() < stop and len(times) < most):
        start = time.perf_counter()
        work()
        dr.sync_thread()
        times.append(1e3 * (time.perf_counter() - start))
    low, median, high = np.percentile(times, [25, 50, 75])
    return Timing(float(median), float(low), float(high), len(times))


@dataclass(frozen=True)
class FrameTimes:
    """What a frame costs [ms]."""

    frame: Timing  #: everything but what is static: camera rays, lit surface, airlight
    surface: Timing  #: camera rays and lit surface
    airlight: Timing  #: the airlight alone: the kernel with its ray set-up, or the marching
    rebuild: Timing  #: a frame after everything moved: acceleration structure, shadow maps, all stages


def time_frame(renderer: FrameRenderer, *, seconds: float = 0.6) -> FrameTimes:
    """Time the stages of a frame, the whole frame and a frame after everything moved."""
    import drjit as dr

    scene = renderer.scene
    prepared = renderer.prepare(scene)
    distance, _, _ = run_stages(renderer, prepared)
    _, by_light = renderer.surface(scene.geometry, renderer.pixel, scene.camera, scene.medium, scene.lights)
    dr.eval(by_light)
    dr.sync_thread()

    def surface():
        dr.eval(renderer.surface(scene.geometry, renderer.pixel, scene.camera, scene.medium, scene.lights))

    def airlight():
        arrays = (renderer.pixel, scene.camera, scene.medium, scene.lights, prepared, distance, by_light)
        dr.eval(renderer.airlight(scene.geometry, *arrays))

    def rebuild():
        _touch_geometry(scene.geometry)
        run_stages(renderer, renderer.prepare(scene))

    return FrameTimes(
        frame=time_repeated(lambda: run_stages(renderer, prepared), seconds=seconds),
        surface=time_repeated(surface, seconds=seconds),
        airlight=time_repeated(airlight, seconds=seconds),
        rebuild=time_repeated(rebuild, seconds=0.5 * seconds, least=3),
    )


def _touch_geometry(scene) -> None:
    """Tell Mitsuba that every shape moved, so that it builds its acceleration structure again."""
    import mitsuba as mi

    if not scene.shapes():
        return
    parameters = mi.traverse(scene)
    for key in list(parameters.keys()):
        if key.rsplit(".", 1)[-1] == "vertex_positions":
            parameters[key] = parameters[key]
    parameters.update()
