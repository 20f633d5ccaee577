# SPDX-License-Identifier: BSD-3-Clause
"""What a baseline holds, measured: every standard configuration of a scene, and every kernel where only fog is."""

import time
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from realtime.errors import InputError
from realtime.frame import FrameRenderer, render_frame, run_stages
from realtime.kernels import KERNELS
from realtime.plan import Plan
from realtime.scene import Scene, read_scene
from reference.quadrature import TruthImage
from validation.baselines import ERRORS, LEFT_OUT, SCHEMA, SIZE, SIZES
from validation.bench import configurations_for
from validation.configurations import STANDARD, Configuration, prepared
from validation.load import load_scene
from validation.metrics import error_metrics, plain
from validation.timing import times_in_turns
from validation.truth import truth_image

Progress = Callable[[float, str], None]

YARDSTICK = Configuration("unshadowed", "exact")  #: what times are told in
FOG = "open-fog"  #: the scene in which every kernel is measured

_SURFACE = ("relative_rmse", "max", "nonfinite")  # it has one cause, the shadows that a method knows
_SLOW = 3.0  # a frame that takes longer is not timed: seven of them in turns would take half of the whole run [s]


def baseline_configurations(name: str, plan: Plan) -> tuple[Configuration, ...]:
    """Return what the baseline of a scene holds, with what is left out for its time."""
    kernels = [Configuration("unshadowed", kernel) for kernel in KERNELS] if name == FOG else []
    return tuple(dict.fromkeys((*configurations_for(plan, STANDARD), *kernels)))


def measure_baseline(name: str, *, times: bool = True, progress: Progress | None = None) -> dict[str, Any]:
    """Measure what the baseline of a built-in scene holds.

    Parameters
    ----------
    name
        A built-in scene.
    times
        Also time a frame of each configuration beside one of the yardstick.
    progress
        Called with (share done, what) now and then.

    Returns
    -------
    dict
        A `validation.baselines.Baseline` without revision and reason.
    """
    import mitsuba as mi

    size = SIZES.get(name, SIZE)
    loaded = load_scene(name, size)
    scene = read_scene(loaded.scene)
    truth = truth_image(loaded.scene)
    yardstick = prepared(scene, YARDSTICK) if times else None
    chosen = baseline_configurations(name, scene.plan)
    reasons = LEFT_OUT.get(name, {})
    entries = {}
    for number, one in enumerate(chosen):
        if progress is not None:
            progress(number / len(chosen), f"{name}: {one.label}")
        if one.method not in reasons:
            entries[one.label] = _entry(scene, one, truth, yardstick)
    return {
        "schema": SCHEMA,
        "scene": name,
        "size": list(size),
        "variant": mi.variant(),
        "truth": {layer: _kept({"mean": getattr(truth, layer).mean()}) for layer in ("airlight", "surface")},
        "left_out": {one.label: reasons[one.method] for one in chosen if one.method in reasons},
        "configurations": entries,
    }


def _entry(scene: Scene, chosen: Configuration, truth: TruthImage, yardstick: FrameRenderer | None) -> dict[str, Any]:
    """Render one configuration and return its errors, or why it was refused."""
    try:
        renderer = prepared(scene, chosen)
        frame = render_frame(renderer)
    except InputError as error:
        return {"refused": str(error)}
    numbers = error_metrics(truth.airlight, frame.airlight).to_json()
    numbers["mean"] = float(np.mean(np.asarray(frame.airlight, dtype=np.float64)))
    found: dict[str, Any] = {"airlight": _kept({name: numbers[name] for name in ERRORS})}
    if scene.plan.surfaces:
        surface = error_metrics(truth.surface, frame.surface).to_json()
        found["surface"] = _kept({name: surface[name] for name in _SURFACE})
    if yardstick is not None and chosen != YARDSTICK:
        found |= _frame_ratio(renderer, yardstick)
    return found


def _frame_ratio(renderer: FrameRenderer, yardstick: FrameRenderer) -> dict[str, float]:
    """Time a frame and one of the yardstick in turns; nothing where it takes too long.

    Whatever else the machine does only adds time: of each, the shortest counts.
    """
    works = [_frame(renderer), _frame(yardstick)]
    begin = time.perf_counter()
    works[0]()
    if time.perf_counter() - begin > _SLOW:
        return {}
    shortest = times_in_turns(works, seconds=0.4, least=7, most=200).min(axis=0)
    ratio = float(shortest[0] / shortest[1])
    return {"frame_ratio": float(f"{ratio:.2g}")}  # two digits: more of them would be noise


def _frame(renderer: FrameRenderer) -> Callable[[], Any]:
    ready = renderer.prepare(renderer.scene)
    return lambda: run_stages(renderer, ready)


def _kept(numbers: Mapping[str, Any]) -> dict[str, Any]:
    """Round to the digits that a baseline keeps."""
    values = {name: plain(value) for name, value in numbers.items()}
    return {name: float(f"{v:.6g}") if isinstance(v, float) else v for name, v in values.items()}
