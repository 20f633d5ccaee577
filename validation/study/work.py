# SPDX-License-Identifier: BSD-3-Clause
"""A cell becomes a row: the method's image against the truth, by all metrics, and what it cost.

A method that refuses a scene gives a row too, with its reason. Nothing here knows where it runs.
"""

import json
import shlex
import time
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError as TruthError
from realtime.errors import InputError
from realtime.frame.renderer import (
    Frame,
    FrameRenderer,
    evaluated,
    run_cast_and_shade,
    run_cull,
    run_method,
    run_stages,
    unchecked_frame,
)
from realtime.scene.read_scene import Scene
from validation.metrics.colour import colour_difference
from validation.metrics.errors import FLOOR, error_metrics
from validation.metrics.flip import flip_hdr
from validation.metrics.other_tools import published_errors
from validation.study.clock import Timing, largest_memory, time_repeated, timed, timing_of
from validation.study.configuration import Configuration, prepared, rendered_lights
from validation.study.reference import CellTruth
from validation.study.row import PROPERTY
from validation.study.stated_errors import stated_bound, worth_of_ends
from validation.study.study import Cell, map_side, seed_of

Array = NDArray[np.float64]
#: Makes a picture of truth and image, both (height, width, 3) [W/(m^2 sr)]; None where there is none.
Paint = Callable[[Array, Array], bytes | None]

_SPENT = 0.1  # on frames that are timed, and as much on the airlight alone [s]
_MOST = 9  # frames that are timed
_SLOW = 500.0  # a slower frame is timed once, without a warm-up of its own [ms]
_OWN_UNITS = ("rae_tev", "rse_tev", "mrse_pbrt", "relmse", "relmse_trim", "mape", "smape", "mrse_jeri")


@dataclass(frozen=True)
class Rendered:
    """An image and what it cost."""

    frame: Frame
    numbers: Mapping[str, Any]  #: columns of the cost


def cell_columns(cell: Cell) -> dict[str, Any]:
    """Return the columns that say which cell a row is of, without its key."""
    chosen = cell.chosen
    return {
        "scene": cell.scene,
        "seed": seed_of(cell.scene),
        "medium": " ".join(cell.medium) or None,
        "method": chosen.method,
        "kernel": chosen.kernel,
        "parameters": json.dumps(dict(chosen.parameters)),
        "label": chosen.label,
        "map": map_side(chosen),
        "width": cell.size[0],
        "height": cell.size[1],
        "command": _command(cell),
    }


def cell_row(
    cell: Cell,
    scene: Scene,
    truth: CellTruth,
    *,
    whole: Any,
    properties: Mapping[str, float],
    paint: Paint | None = None,
) -> dict[str, Any]:
    """Return the columns of a cell: errors, costs, or why there are none; without its key and where it ran.

    Parameters
    ----------
    whole
        The `mi.Scene` that both were read of.

    Notes
    -----
    Exceptions other than a refusal are the caller's: they are faults.
    """
    begin, spent = time.perf_counter(), time.process_time()
    row = cell_columns(cell) | {PROPERTY + name: float(value) for name, value in properties.items()}
    row |= _truth_columns(truth)
    try:
        rendered = _render(scene, cell.chosen, with_times=cell.times == "with")
    except (InputError, TruthError) as error:
        return row | {"status": "refused", "reason": str(error)}
    row |= {"status": "done", **rendered.numbers, **error_columns(truth, rendered.frame, scene, cell, whole=whole)}
    if paint is not None:
        shown = np.asarray(rendered.frame.airlight, dtype=np.float64)
        # Pixels without a truth are shown as if they were right.
        known = truth.airlight if truth.mask is None else np.where(truth.mask[..., None], truth.airlight, shown)
        row["picture"] = paint(known, shown)
    row["rays"] = scene.camera.width * scene.camera.height
    row["lights"] = rendered_lights(scene, cell.chosen)
    row["peak_mib"] = largest_memory()
    row["work_ms"] = 1e3 * (time.perf_counter() - begin)
    row["cpu_ms"] = 1e3 * (time.process_time() - spent)
    return row


def cell_times(cell: Cell, scene: Scene) -> dict[str, Any]:
    """Return the columns of the costs of a cell that can be rendered, its times among them.

    Raises
    ------
    realtime.errors.InputError
        If the method refuses the scene.
    """
    return dict(_render(scene, cell.chosen, with_times=True).numbers)


def error_columns(truth: CellTruth, frame: Frame, scene: Scene, cell: Cell, *, whole: Any) -> dict[str, Any]:
    """Return the errors of a frame against the truth by all metrics."""
    test = np.asarray(frame.airlight, dtype=np.float64)
    mask = truth.mask
    metrics = asdict(error_metrics(truth.airlight, test, mask=mask))
    published = asdict(published_errors(truth.airlight, test, mask=mask))
    normalised = asdict(published_errors(truth.airlight, test, unit=None, mask=mask))
    colour = asdict(colour_difference(truth.airlight, test, mask=mask))
    others = ("mse", "mae", "psnr", "relative", "relative_max", "dark_max", "dark", *_OWN_UNITS)
    finite = np.isfinite(test).all(axis=2)
    row = {
        **metrics,
        "masked": 0 if mask is None else int((~mask).sum()),
        "mean": float(test[finite].mean()) if finite.any() else None,
        **{name: published[name] for name in others},
        **{f"normalised.{name}": normalised[name] for name in _OWN_UNITS},
        **{f"colour.{name}": colour[name] for name in colour if name.startswith(("ciede2000_", "itp_"))},
        "bound": stated_bound(cell.chosen, scene),
    }
    if row["bound"] is not None:
        floor = FLOOR * truth.airlight.mean()  # of all pixels: who states a bound has a truth in each
        allowed = row["bound"] * np.maximum(truth.airlight, floor) + truth.bound
        excess = np.abs(test - truth.airlight).reshape(-1, 3) - allowed.reshape(-1, 3)
        outside = np.flatnonzero(~(excess <= 0).all(axis=1))
        if len(outside):  # few: what the ends of intervals are worth takes a while
            outside = outside[~(excess[outside] <= worth_of_ends(whole, outside)).all(axis=1)]
        row["outside_bound"] = len(outside)
    if scene.features.surfaces and truth.surface is not None:
        surface = error_metrics(truth.surface, np.asarray(frame.surface, dtype=np.float64))
        row |= {f"surface_{name}": getattr(surface, name) for name in ("relative_rmse", "p99", "max", "nonfinite")}
    if cell.flip:
        row["flip"] = flip_hdr(truth.airlight, test, mask=mask).value
    return row


def _truth_columns(truth: CellTruth) -> dict[str, Any]:
    kept = np.ones(truth.airlight.shape[:2], dtype=bool) if truth.mask is None else truth.mask
    airlight, bound = truth.airlight[kept], truth.bound[kept]
    mean = float(airlight.mean())
    known = mean > 0
    return {
        "truth": truth.estimator,
        "truth_mean": mean,
        "truth_error": float(bound.mean()) / mean if known else None,
        "truth_worst": float((bound / np.maximum(airlight, FLOOR * mean)).max()) if known else None,
        "truth_s": truth.seconds,
        "truth_cpu_s": truth.processor_seconds,
        "crossings": truth.crossings,
    }


def _render(scene: Scene, chosen: Configuration, *, with_times: bool) -> Rendered:
    """Render a frame, and time it if asked for.

    Raises
    ------
    InputError
        If the method refuses the scene or its parameters.
    """
    dr.sync_thread()
    dr.detail.malloc_clear_statistics()
    before = dr.detail.launch_stats()
    begin = time.perf_counter()
    renderer = prepared(scene, chosen)
    state = renderer.prepare(scene)
    dr.eval(state)
    frame = unchecked_frame(renderer, run_stages(renderer, state))
    first = time.perf_counter() - begin
    after = dr.detail.launch_stats()
    backend = dr.JitBackend.CUDA if (mi.variant() or "").startswith("cuda") else dr.JitBackend.LLVM
    numbers: dict[str, Any] = {
        "kernels": after[0] - before[0],
        "compiled": after[2] - before[2],
        "bytes": int(dr.detail.malloc_watermark(backend)),
    }
    if with_times:
        numbers |= _times(renderer, state) | {"first_ms": 1e3 * first}
        del state  # maps of many lights fill a gigabyte, and two of these a worker
        numbers["prepare_ms"] = timed(lambda: dr.eval(renderer.prepare(scene))).ms
    return Rendered(frame, numbers)


def _times(renderer: FrameRenderer, state: Any) -> dict[str, Any]:
    """Time frames, and the airlight of a frame; the first run has compiled and recorded all kernels."""
    frame = _repeated(lambda: run_stages(renderer, state))
    airlight = frame  # camera rays and surfaces take little of a frame that is slow, and it takes too long to ask
    if frame.median_ms < _SLOW:
        cast, by_light = run_cast_and_shade(renderer)
        dr.eval(cast, by_light)
        airlight = _repeated(
            lambda: evaluated(
                cast, by_light, run_method(renderer, state, cast, by_light, run_cull(renderer, state, cast.distance))
            )
        )
    return {
        "frame_ms": frame.median_ms,
        "frame_ms_low": frame.low_ms,
        "frame_ms_high": frame.high_ms,
        "frame_cpu_ms": frame.cpu_ms,
        "airlight_ms": airlight.median_ms,
        "frames": frame.repetitions,
    }


def _repeated(work: Callable[[], Any]) -> Timing:
    """Time some runs after one of warm-up; a slow one is not repeated."""
    first = timed(work)
    if first.ms >= _SLOW:
        return timing_of([first.ms], cpu_ms=first.cpu_ms)
    return time_repeated(work, seconds=_SPENT, least=1, most=_MOST, warm_up=0)


def _command(cell: Cell) -> str:
    """Return the command that shows the image of a cell again, as a shell reads it."""
    chosen = cell.chosen
    words = ["airlight", "view", cell.scene, "--method", chosen.method]
    words += ["--kernel", chosen.kernel] if chosen.kernel else []
    for name, value in chosen.parameters:
        words += ["--set", f"{name}={value}"]
    for change in cell.medium:
        words += ["--change", change]
    return shlex.join([*words, "--size", f"{cell.size[0]}x{cell.size[1]}"])
