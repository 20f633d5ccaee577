# SPDX-License-Identifier: BSD-3-Clause
"""A cell becomes a row: its image is rendered and compared with the reference.

Times of cells that are compared with one another are measured together (`validation.study.turns`).
Only times that need not be compared, as of sweeps whose cells are timed while others run, are
measured here.

A method that refuses a scene gives a row with its reason, and so does one that would take too long.
Other exceptions are faults, and the caller's. Nothing here depends on where it runs.
"""

from __future__ import annotations

import json
import math
import shlex
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import stopwatch
from airlight.errors import InputError
from airlight.realtime.frame.image import Frame, render_frame, unchecked_frame
from airlight.realtime.frame.renderer import FrameRenderer, run_stages
from airlight.realtime.methods.interface.method import method_parameters
from airlight.realtime.methods.registry import find_method
from airlight.realtime.methods.shader.source import is_shader
from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.storage.exr import Image
from airlight.validation.clock import timed
from airlight.validation.metrics.colour import colour_difference
from airlight.validation.metrics.errors import FLOOR, error_metrics
from airlight.validation.metrics.flip import flip_hdr
from airlight.validation.metrics.other_tools import published_errors
from airlight.validation.motion.blocks import parts_of_error
from airlight.validation.statistics.estimate import Answer
from airlight.validation.statistics.samples import first_equal, student
from airlight.validation.study.configuration import Configuration, prepared, rendered_lights
from airlight.validation.study.reference import Reference, load_cell
from airlight.validation.study.row import Cost, Growth, Row, RunsError, StatedError
from airlight.validation.study.stated_errors import stated_bound, worth_of_ends
from airlight.validation.study.study import Cell, map_side, seed_of
from airlight.validation.study.turns import Apart, CellTimes, brief_times

Array = NDArray[np.float64]
#: Makes a picture of reference and image, both (height, width, 3) [W/(m^2 sr)];
#: None where there is none.
Paint = Callable[[Array, Array], bytes | None]

RUNS = 8  #: of a method that draws random numbers
#: size of the frame from which the time of a full-size frame is estimated [pixels]
PROBE = (64, 48)
# fraction of the limit: after a longer preparation, the time of a frame is
# estimated before it begins
_DOUBTFUL = 0.5


def run(
    cell: Cell,
    scene: Scene,
    reference: Reference | None,
    *,
    whole: mi.Scene | None = None,
    paint: Paint | None = None,
    apart: Apart | None = None,
) -> tuple[Row, Frame | None]:
    """Render and compare a cell, and time it where its times are taken 'with' its errors.

    Scene and reference are of the same image, at the size of the cell; without a reference nothing
    is compared. `whole` is the scene that both were read from: without it no error is compared with
    the error that the method states. `paint` makes the picture of the row, and `apart` calls a
    user's method in a separate process.
    """
    # A user's method may crash or hang: it is rendered in a separate process, with its further
    # runs. A refusal is a row as well.
    took = stopwatch()
    runs: list[Array] = []
    try:
        if apart is not None and cell.chosen.own:
            row, frame, runs = apart(render_cell, cell, name=cell.chosen.method)
        else:
            row, frame = render(scene, cell)
            runs = [] if frame is None or reference is None else _other_runs(scene, cell)
    except InputError as error:
        row, frame = cell_row(cell, status="refused", reason=str(error)), None
    if reference is None:
        return row, frame
    row = replace(row, reference=reference.own_error)
    if frame is None:
        return row, None
    row = replace(row, **_errors(cell, frame, scene, reference, whole))
    if runs:
        row = replace(
            row, noise=_runs_error(reference, [np.asarray(frame.airlight, dtype=np.float64), *runs])
        )
    if paint is not None:
        airlight = np.asarray(frame.airlight, dtype=np.float64)
        # Pixels without a reference are shown as if they were right.
        expected = (
            reference.airlight
            if reference.mask is None
            else np.where(reference.mask[..., None], reference.airlight, airlight)
        )
        row = replace(row, picture=paint(expected, airlight))
    # The work of the row is all that it took, comparison and picture included.
    assert row.cost is not None
    lights, spent = rendered_lights(scene, cell.chosen), took()
    cost = replace(row.cost, lights=lights, work_ms=spent.ms, cpu_ms=spent.cpu_ms)
    return replace(row, cost=cost), frame


def cell_row(cell: Cell, **outcome: Any) -> Row:
    """Return the row of a cell with an outcome, by default that it was done, and no numbers."""
    chosen = cell.chosen
    return Row(
        scene=cell.scene,
        label=chosen.label,
        method=chosen.method,
        kernel=chosen.kernel,
        parameters=json.dumps(dict(chosen.parameters)),
        width=cell.size[0],
        height=cell.size[1],
        kind="function" if chosen.own else "built-in",
        map=map_side(chosen),
        seed=seed_of(cell.scene),
        medium=" ".join(cell.medium) or None,
        command=_command(cell),
        **{"status": "done", "work": Growth(*cell.work) if cell.work else None, **outcome},
    )


def render_cell(cell: Cell) -> tuple[Row, Frame | None, list[Array]]:
    """Render a cell in a process that has loaded nothing; return the
    airlight of its other runs too.
    """
    scene = read_scene(load_cell(cell).scene)
    row, frame = render(scene, cell)
    return row, frame, [] if frame is None else _other_runs(scene, cell)


def render(scene: Scene, cell: Cell) -> tuple[Row, Frame | None]:
    """Render a cell; return its row, not yet compared with anything, and
    its frame, if there is one.
    """
    chosen, measure = cell.chosen, cell.measure
    row_of = partial(cell_row, cell, knows_shadows=knows_shadows(chosen))
    # Launches and memory are counted from here: what runs already must have ended.
    dr.sync_thread()
    dr.detail.malloc_clear_statistics()
    before = dr.detail.launch_stats()
    # The first frame is the one that is compared, and its time holds the compilation. A study of
    # stages refuses a frame that is not finite; others count such pixels.
    try:
        renderer, making = timed(partial(prepared, scene, chosen))
        reason = _too_long(renderer, cell, making.seconds)
        if reason:
            return row_of(status="left out", reason=reason), None
        frame, first = timed(
            partial(render_frame if measure.times == "stages" else _unchecked, renderer)
        )
    except InputError as error:
        return row_of(status="refused", reason=str(error)), None
    after = dr.detail.launch_stats()
    backend = dr.JitBackend.CUDA if (mi.variant() or "").startswith("cuda") else dr.JitBackend.LLVM
    watermark = int(dr.detail.malloc_watermark(backend))
    cost = Cost(making.ms + first.ms, None, after[0] - before[0], after[2] - before[2], watermark)
    # A user's method that cannot be recorded has slow frames for another reason than its work.
    note = None
    if (
        measure.times == "stages"
        and chosen.own
        and not is_shader(chosen.method)
        and not find_method(chosen.method).frozen
    ):
        note = "not frozen: its Python runs again for every frame"
    row = row_of(cost=cost, note=note)
    return with_times(row, brief_times(renderer)) if measure.times == "with" else row, frame


def with_times(row: Row, times: CellTimes) -> Row:
    """Return a row with its times."""
    notes = [row.note, times.note, f"not timed: {times.lost}" if times.lost else None]
    cost = row.cost and replace(row.cost, prepare_ms=times.prepare_ms)
    note = "; ".join(filter(None, notes)) or None
    return replace(
        row, times=times.times, memory=times.memory, device=times.device, cost=cost, note=note
    )


def _other_runs(scene: Scene, cell: Cell) -> list[Array]:
    """Return the airlight of further runs of a method that draws random numbers, (height,
    width, 3) each; of others none.
    """
    chosen = cell.chosen
    if not method_parameters(find_method(chosen.method), dict(chosen.parameters))[0].noisy:
        return []
    renderer = prepared(scene, chosen)
    rendered = render_frame if cell.measure.times == "stages" else _unchecked
    frames = (rendered(replace(renderer, run=run)) for run in range(1, RUNS))
    return [np.asarray(frame.airlight, dtype=np.float64) for frame in frames]


def _runs_error(reference: Reference, runs: list[Array]) -> RunsError | None:
    """Return bias and error of runs; None where they are the same, or nothing is
    relative to the reference.

    Runs that are the same bit by bit count once.
    """
    # A pixel counts where it has a reference and every run is finite in it.
    runs = [runs[number] for number in sorted(set(first_equal(runs)))]
    counts = np.isfinite(runs).all(axis=(0, 3))
    counts &= True if reference.mask is None else reference.mask
    expected = reference.airlight[counts]
    mean = float(expected.mean()) if expected.size else 0.0
    errors = np.array([(run[counts] - expected).ravel() for run in runs])
    if not mean > 0 or len(runs) < 2:
        return None
    errors /= mean
    # The squared bias without the noise of the mean, from pairs of runs: see
    # `validation.motion.noise`. Its root is reported only from two errors above the mean square of
    # the reference's own error on.
    products = errors @ errors.T / errors.shape[1]
    squared, _ = parts_of_error(products)
    bias, within = student(errors.mean(axis=1))
    ends = squared.ends()
    # A root mean square is off by that of the errors of the reference at most (Minkowski's
    # inequality).
    off, root = reference.off
    return RunsError(
        len(errors),
        bias,
        within + off,
        *student(np.sqrt(np.diag(products))),
        math.sqrt(squared.value)
        if squared.value and squared.exceeds(root**2) is Answer.YES
        else None,
        None if ends is None else math.sqrt(max(ends[1], 0.0)) + root,
    )


def frame_of(cell: Cell) -> Frame:
    """Render the frame of a cell in a process that has loaded nothing."""
    return render_frame(prepared(read_scene(load_cell(cell).scene), cell.chosen))


def knows_shadows(chosen: Configuration) -> bool:
    """Return whether a configuration renders volumetric shadows."""
    return find_method(chosen.method).shadows and dict(chosen.parameters).get("shadow") != "none"


def layered_frame(name: str, chosen: Configuration, frame: Frame) -> Image:
    """Return a frame of the scene of that name as layers; the header says what rendered it."""
    attributes = {"airlight:scene": name, "airlight:method": chosen.method}
    attributes |= {"airlight:kernel": chosen.kernel} if chosen.kernel else {}
    attributes |= {f"airlight:{key}": str(value) for key, value in chosen.parameters}
    return Image(
        {"airlight": frame.airlight, "surface": frame.surface, **frame.extra},
        frame.distance,
        attributes,
    )


def _unchecked(renderer: FrameRenderer) -> Frame:
    """Render a frame, which may have pixels that are not finite: they are counted."""
    return unchecked_frame(renderer, run_stages(renderer, renderer.prepare(renderer.scene)))


def _errors(
    cell: Cell, frame: Frame, scene: Scene, reference: Reference, whole: mi.Scene | None
) -> dict[str, Any]:
    """Return the errors of a frame by the names of their fields in a row."""
    test, mask = np.asarray(frame.airlight, dtype=np.float64), reference.mask
    # Surfaces are compared where the scene has some and the reference did not leave them out.
    errors: dict[str, Any] = {"error": error_metrics(reference.airlight, test, mask=mask)}
    surface = np.asarray(frame.surface, dtype=np.float64)
    if scene.features.surfaces and reference.surface is not None:
        errors["surface_error"] = error_metrics(reference.surface, surface)
    if cell.measure.flip:
        lit = (
            (reference.airlight, test)
            if reference.surface is None
            else (reference.light, test + surface)
        )
        errors["flip"] = flip_hdr(*lit, mask=mask)[0]
    if not cell.measure.every_metric:
        return errors
    errors["published"] = published_errors(reference.airlight, test, mask=mask)
    errors["normalised"] = published_errors(reference.airlight, test, unit=None, mask=mask)
    errors["colour"] = colour_difference(reference.airlight, test, mask=mask)
    # Pixels whose error exceeds the error that the method states, relative to the pixel with a
    # floor in the dark, and the error of the reference. The ends of lit intervals may explain the
    # excess of some.
    bound = stated_bound(cell.chosen, scene)
    if bound is not None and whole is not None:
        # There is no mask here: scenes in which a method states a bound have no area lights, so
        # that every pixel has a reference.
        floor = FLOOR * reference.airlight.mean()
        allowed = bound * np.maximum(reference.airlight, floor) + reference.error
        excess = np.abs(test - reference.airlight).reshape(-1, 3) - allowed.reshape(-1, 3)
        outside = np.flatnonzero(~(excess <= 0).all(axis=1))
        if len(outside):  # few pixels: the worth of ends takes a while
            outside = outside[~(excess[outside] <= worth_of_ends(whole, outside)).all(axis=1)]
        errors["stated"] = StatedError(bound, len(outside))
    return errors


def _too_long(renderer: FrameRenderer, cell: Cell, took: float) -> str | None:
    """Return in words that a frame would take longer than the limit, or None.

    The time is estimated from the preparation once kernels are compiled. Where that takes long, and
    for a user's method, it is estimated from the second frame of a small image, whose preparation
    takes as long. If there are many groups of lights, only the first are prepared before the frame;
    the others take as long each. Nothing is estimated where there is one group, and the renderer
    was made in so little time (`took` [s]) that a frame is far below the limit.
    """
    chosen, limit = cell.chosen, cell.measure.limit
    # First by the time that making the renderer took, which costs nothing more.
    many = len(renderer.groups) > 1
    if limit is None or not (chosen.own or many or took > _DOUBTFUL * limit):
        return None
    # Then by the preparation. A state of None is a group that is prepared during the frame: it
    # takes as long as the others.
    if many:
        renderer.prepare(renderer.scene)  # compiles
    states, spent = timed(lambda: renderer.prepare(renderer.scene))
    preparation = spent.seconds * len(states) / sum(state is not None for state in states)
    del states
    words = f"more than the limit of {limit:g} s"
    if preparation > limit:
        return f"not measured: what a frame prepares takes {preparation:.2g} s, {words}"
    if not chosen.own and preparation <= _DOUBTFUL * limit:
        return None
    # Last by a small frame: its preparation takes as long as that of a full frame, the rest grows
    # with the pixels.
    small = prepared(read_scene(load_cell(replace(cell, size=PROBE)).scene), chosen)
    large = renderer.scene.camera
    render_frame(small)  # compiles
    took = timed(lambda: render_frame(small))[1].seconds
    fraction = (large.width * large.height) / (PROBE[0] * PROBE[1])
    expected = preparation + max(0.0, took - preparation) * fraction
    if expected <= limit:
        return None
    return (
        f"not measured: by a frame of {PROBE[0]} x {PROBE[1]} pixels that took {took:.2g} s, "
        f"{min(took, preparation):.2g} s of these for what it prepares, a frame of {large.width} x "
        f"{large.height} "
        f"would take {expected:.0f} s, {words}"
    )


def _command(cell: Cell) -> str:
    """Return the command that shows the image of a cell again, as a shell reads it."""
    chosen = cell.chosen
    words = ["airlight", "view", cell.scene, "--method", chosen.method]
    words += ["--set", f"kernel={chosen.kernel}"] if chosen.kernel else []
    for name, value in chosen.parameters:
        words += ["--set", f"{name}={value}"]
    for change in cell.medium:
        words += ["--change", change]
    return shlex.join([*words, "--size", f"{cell.size[0]}x{cell.size[1]}"])
