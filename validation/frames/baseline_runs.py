# SPDX-License-Identifier: BSD-3-Clause
"""Measures what a baseline holds: the standard configurations of a scene, and every kernel in `open-fog`."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from realtime.errors import InputError
from realtime.frame.renderer import FrameRenderer, render_frame, run_stages
from realtime.kernels.registry import KERNELS
from realtime.scene.features import SceneFeatures
from realtime.scene.read_scene import Scene, read_scene
from reference.quadrature.ray_values import TruthImage
from validation.configurations.methods import STANDARD, Configuration, prepared
from validation.estimates.quadrature import truth_image
from validation.frames.baseline_files import ERRORS, SCHEMA, SIZE, SLOWER, Baseline
from validation.frames.benchmark import configurations_for
from validation.metrics.errors import error_metrics, plain
from validation.scenes.loading import load_scene

Progress = Callable[[float, str], None]

YARDSTICK = Configuration("unshadowed", "exact")  #: the unit of times: frames of this configuration
FOG = "open-fog"  #: the scene in which every kernel is measured

_SURFACE = ("relative_rmse", "max", "nonfinite")  # methods change the surface only by their shadows
_SLOW = 1.0  # a slower frame is not timed: timing such frames would take half of the whole run [s]
_LEAST = 7  # turns, each of one frame and one frame of the yardstick
_TRIES = (0.4, 1.0, 2.0)  # durations of the timings; the longer ones follow only if the frame seems too slow [s]


def baseline_configurations(name: str, features: SceneFeatures) -> tuple[Configuration, ...]:
    """Return what the baseline of a scene holds."""
    kernels = [Configuration("unshadowed", kernel) for kernel in KERNELS] if name == FOG else []
    return tuple(dict.fromkeys((*configurations_for(features, STANDARD), *kernels)))


def measure_baseline(
    name: str, *, kept: Baseline | None = None, times: bool = True, progress: Progress | None = None
) -> dict[str, Any]:
    """Measure what the baseline of a built-in scene holds.

    Parameters
    ----------
    name
        A built-in scene.
    kept
        The baseline to compare with. A frame that seems too slow beside it is timed again, for longer.
    times
        Whether to time a frame of each configuration beside one of the yardstick; only on a CPU.
    progress
        Callback with the share done and a description of the next step, or None.

    Returns
    -------
    dict
        A `validation.frames.baseline_files.Baseline` without revision and reason.
    """
    loaded = load_scene(name, SIZE)
    scene = read_scene(loaded.scene)
    truth = truth_image(loaded.scene)
    timed = times and "llvm" in mi.variant()
    yardstick = prepared(scene, YARDSTICK) if timed else None
    chosen = baseline_configurations(name, scene.features)
    before = kept["configurations"] if kept else {}
    entries = {}
    for number, configuration in enumerate(chosen):
        label = configuration.label
        if progress is not None:
            progress(number / len(chosen), f"{name}: {label}")
        ratio = before.get(label, {}).get("frame_ratio", np.inf)
        entries[label] = _entry(scene, configuration, truth, yardstick, enough=SLOWER * ratio)
    return {
        "schema": SCHEMA,
        "scene": name,
        "size": list(SIZE),
        "truth": {layer: _kept({"mean": getattr(truth, layer).mean()}) for layer in ("airlight", "surface")},
        "configurations": entries,
    }


def _entry(
    scene: Scene, chosen: Configuration, truth: TruthImage, yardstick: FrameRenderer | None, *, enough: float
) -> dict[str, Any]:
    """Render one configuration and return its errors, or why it was refused."""
    try:
        renderer = prepared(scene, chosen)
        frame = render_frame(renderer)
    except InputError as error:
        return {"refused": str(error)}
    numbers = error_metrics(truth.airlight, frame.airlight).to_json()
    numbers["mean"] = float(np.mean(np.asarray(frame.airlight, dtype=np.float64)))
    entry: dict[str, Any] = {"airlight": _kept({name: numbers[name] for name in ERRORS})}
    if scene.features.surfaces:
        surface = error_metrics(truth.surface, frame.surface).to_json()
        entry["surface"] = _kept({name: surface[name] for name in _SURFACE})
    if yardstick is not None and chosen != YARDSTICK:
        entry |= _frame_ratio(renderer, yardstick, enough)
    return entry


def _frame_ratio(renderer: FrameRenderer, yardstick: FrameRenderer, enough: float) -> dict[str, float]:
    """Time a frame and one of the yardstick in turns; return an empty dict if the frame takes too long."""
    works = [_frame(renderer), _frame(yardstick)]
    if _processor_time(works[0]) > _SLOW:
        return {}
    shortest, ratio = np.full(2, np.inf), np.inf
    for seconds in _TRIES:
        for _ in range(2):  # the first call compiles and records, the second is the first replay
            for work in works:
                work()
        stop, turns = time.perf_counter() + seconds, 0
        while turns < _LEAST or time.perf_counter() < stop:
            shortest = np.minimum(shortest, [_processor_time(work) for work in works])
            turns += 1
        ratio = float(shortest[0] / shortest[1])
        if ratio <= enough:
            break
    return {"frame_ratio": float(f"{ratio:.2g}")}  # two digits: more would be noise


def _processor_time(work: Callable[[], Any]) -> float:
    """Return the processor time of a piece of work, summed over all threads [s]."""
    begin = time.process_time()
    work()
    dr.sync_thread()
    return time.process_time() - begin


def _frame(renderer: FrameRenderer) -> Callable[[], Any]:
    ready = renderer.prepare(renderer.scene)
    return lambda: run_stages(renderer, ready)


def _kept(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Return numbers rounded to the six digits that a baseline keeps."""
    values = {name: plain(value) for name, value in numbers.items()}
    return {name: float(f"{v:.6g}") if isinstance(v, float) else v for name, v in values.items()}
