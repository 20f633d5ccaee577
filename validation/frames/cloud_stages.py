# SPDX-License-Identifier: BSD-3-Clause
"""What the stages of `cloud-collectors` cost in a scene of clouds, and how far its searches end from fixed points.

A stage is timed by itself: the light maps as the preparation of a frame, order 1 as a frame without the sets of orders
(`realtime.methods.cloud_collectors.scattered_once`), the rest as whole frames. Beside the time on the clock stands the
processor time, the sum over all threads, which other load on the machine moves less. What is compiled and recorded with
the first frame is no part of either.

A search has converged where the collector that its last slab gives lies within 0.05 sigma of the one that the slab was
asked for. It starts from nothing, or with the collectors of the last frame, while the sun turns by one degree a frame.
"""

import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace
from itertools import islice
from typing import Any

import drjit as dr
import numpy as np

from analytic.errors import InputError
from realtime.clouds.canonical.sets import SETS, set_name
from realtime.frame.incremental import FrameCache, next_frame
from realtime.frame.renderer import FrameRenderer, bytes_in, frame_renderer, image_frame, run_cast_and_shade, run_method
from realtime.methods.cloud_collectors import CollectorParameters, missed_collectors, scattered_once
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import Scene
from validation.configurations.timing import Timing, first_frame, run_times
from validation.scenes.animation import animate
from validation.scenes.record import Animation

Progress = Callable[[int, int, str], None]

#: Parameters with which everything is as Bouthors 2008 prints it.
PUBLISHED: Mapping[str, Any] = {
    "transport": "fit",
    "thickness": "light",
    "kappa": "printed",
    "peak": "half",
    "single": "printed",
    "opacity": "printed",
    "start": "cold",
    "iterations": 10,
}
SETTLED = 0.05  #: [sigma]
#: Frames that go on: three steps at most, one where the collector of the last frame still is one.
WARM = {"start": "previous", "iterations": 3, "settled": SETTLED}
_SEARCHES: tuple[dict[str, Any], ...] = (
    {"start": "cold", "iterations": 10},
    *({"start": "previous", "iterations": count} for count in (1, 2, 3)),
)
_SET_HERE = ("start", "iterations", "settled", "tolerance")
_FRAMES, _TURN = 7, 360  # frames of a search that goes on, and how many make a turn of the sun


@dataclass(frozen=True)
class StageTime:
    """What a stage takes."""

    name: str
    goal_ms: float | None  #: None where there is none
    first_ms: float | None  #: until the first frame is there, which compiles and records; None of what is no frame
    time: Timing  #: on the clock
    processor_ms: float  #: the least processor time of a call, the sum over all threads


@dataclass(frozen=True)
class Convergence:
    """How many searches of a frame are further than `SETTLED` from their ends."""

    start: str
    iterations: int
    any_set: float  #: share of the pixels of clouds in which one of the sets is
    by_set: Mapping[str, float]  #: share of the pixels of clouds


@dataclass(frozen=True)
class CloudStages:
    """The stages of a scene."""

    cloud: float  #: share of the pixels that show a cloud
    stages: tuple[StageTime, ...]
    memory: Mapping[str, int]  #: of what a scene keeps from frame to frame, by its name [bytes]
    convergence: tuple[Convergence, ...]


def cloud_stages(
    scene: Scene, parameters: Mapping[str, Any], *, seconds: float = 1.0, progress: Progress | None = None
) -> CloudStages:
    """Time the stages of a scene of clouds, and count searches that have not converged.

    Parameters
    ----------
    scene
        From `realtime.scene.read_scene.read_scene`.
    parameters
        Of `cloud-collectors`; `start`, `iterations`, `settled` and `tolerance` are set here.
    seconds
        To spend on each timing.
    progress
        Called with what is done, how much there is, and what is next.

    Raises
    ------
    InputError
        For a scene without clouds.
    """
    if scene.medium.clouds is None:
        raise InputError("--stages: the scene has no clouds; name scenes of clouds, such as stratocumulus")
    given = {name: value for name, value in parameters.items() if name not in _SET_HERE}
    frames = _timed_frames(given)
    count, done = len(frames) + 1 + len(_SEARCHES), 0

    def tell(what: str) -> None:
        nonlocal done
        if progress is not None:
            progress(done, count, what)
        done += 1

    tell("light maps")
    warm = _renderer(scene, given | WARM)
    stages = [_timed("light maps and MIP, after the light moved", 8.0, None, lambda: warm.prepare(scene), seconds)]
    memory: dict[str, int] = {}
    for name, goal, chosen, once in frames:
        tell(name)
        begin = time.perf_counter()
        renderer = _renderer(scene, chosen, render=scattered_once if once else None)
        cache = first_frame(renderer)
        dr.sync_thread()
        first = 1e3 * (time.perf_counter() - begin)
        stages.append(_timed(name, goal, first, _frame_work(renderer, cache), seconds))
        if cache.carried is not None and not memory:
            memory = {
                "light maps": bytes_in(cache.state.maps),
                "transport": bytes_in(cache.state.fillings),
                "collectors": bytes_in(cache.carried),
            }
    stages.append(_sum_of(stages[0], stages[2]))
    convergence, cloud = [], 0.0
    for search in _SEARCHES:
        tell("searches, start={start} iterations={iterations}".format(**search))
        cloud, found = _convergence(scene, given | search)
        convergence.append(found)
    return CloudStages(cloud, tuple(stages), memory, tuple(convergence))


def time_frames(scene: Scene, *, seconds: float = 1.0) -> dict[str, Timing]:
    """Return the times of a frame with the collectors of the last one: `frame`, and that after the `light_moved`."""
    renderer = _renderer(scene, WARM)
    maps = _timed("maps", None, None, lambda: renderer.prepare(scene), seconds)
    frame = _timed("frame", None, None, _frame_work(renderer, first_frame(renderer)), seconds)
    return {"frame": frame.time, "light_moved": _sum_of(maps, frame).time}


def _timed_frames(given: Mapping[str, Any]) -> list[tuple[str, float | None, dict[str, Any], bool]]:
    """Return name, goal, parameters of frames, and whether they are of order 1 alone."""
    steps = given.get("steps", CollectorParameters().steps)
    return [
        (f"order 1 and opacity, {steps} steps", 40.0 if steps == 16 else None, {**given}, True),
        ("frame, the last frame's collectors", 500.0, {**given, **WARM}, False),
        ("frame, these with tolerance 0.01", 150.0, {**given, **WARM, "tolerance": 0.01}, False),
        ("frame, 10 iterations from the start", None, {**given, "start": "cold", "iterations": 10}, False),
        ("frame, as published", 4000.0, {**given, **PUBLISHED}, False),
    ]


def _renderer(scene: Scene, parameters: Mapping[str, Any], render: Any = None, **options: Any) -> FrameRenderer:
    method = METHODS["cloud-collectors"]
    if render is not None:
        method = replace(method, render=render, carries=method.carries if render is missed_collectors else _nothing)
    return frame_renderer(scene, method, **options, **parameters)


def _nothing(parameters: Any) -> bool:
    return False


def _frame_work(renderer: FrameRenderer, cache: FrameCache) -> Callable[[], Any]:
    """Return the work of a frame whose light maps are there: camera rays, order 1, orders above."""

    def work() -> None:
        cast, by_light = run_cast_and_shade(renderer)
        dr.eval(run_method(renderer, cache.state, cast, by_light, cache.lists, None, cache.carried))

    return work


def _timed(name: str, goal: float | None, first: float | None, work: Callable[[], Any], seconds: float) -> StageTime:
    """Return the times of a stage after two calls of warm-up."""
    clock: list[float] = []
    processor: list[float] = []
    stop = np.inf
    while len(clock) < 7 or time.perf_counter() < stop:
        wall, spent = run_times(work)
        clock.append(wall)
        processor.append(spent)
        if len(clock) == 2:
            stop = time.perf_counter() + seconds
    low, median, high = (float(value) for value in np.percentile(clock[2:], [25, 50, 75]))
    return StageTime(name, goal, first, Timing(median, low, high, len(clock) - 2), min(processor[2:]))


def _sum_of(maps: StageTime, frame: StageTime) -> StageTime:
    """Return a frame after the light moved."""
    median, low, high = (
        getattr(maps.time, name) + getattr(frame.time, name) for name in ("median_ms", "low_ms", "high_ms")
    )
    return StageTime(
        f"{frame.name}, after the light moved",
        None,
        frame.first_ms,
        Timing(median, low, high, min(maps.time.repetitions, frame.time.repetitions)),
        maps.processor_ms + frame.processor_ms,
    )


def _convergence(scene: Scene, parameters: Mapping[str, Any]) -> tuple[float, Convergence]:
    """Return the share of the cloud, and the shares of its pixels whose searches have not ended."""
    renderer = _renderer(scene, parameters, render=missed_collectors, extra_layers=True)
    cache: FrameCache | None = None
    moved = {"camera_moved": False, "geometry_moved": False, "light_moved": True}
    for now in _sunny_days(scene):
        stages, cache = next_frame(renderer, now, cache, **moved)
    assert cache is not None
    frame = image_frame(replace(renderer, scene=now), stages, cache.extra)
    there = frame.airlight[..., 0] > 0
    far = [layer[..., 0][there] > SETTLED for layer in frame.extra.values()]
    by_set = {set_name(number): float(np.mean(own)) for number, own in enumerate(far[: len(SETS)])}
    share = float(np.mean(np.any(far, axis=0)))
    return float(there.mean()), Convergence(parameters["start"], parameters["iterations"], share, by_set)


def _sunny_days(scene: Scene) -> Iterator[Scene]:
    """Yield the scene with its suns one degree further each time."""
    return islice(animate(scene, Animation(("light",)), _TURN), _FRAMES)
