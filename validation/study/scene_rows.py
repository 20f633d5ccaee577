# SPDX-License-Identifier: BSD-3-Clause
"""The rows of the configurations of a scene: errors by configuration, times of one run, HDR-FLIP."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np
from numpy.typing import NDArray

from airlight.analytic.clock import Spent
from airlight.reference.quadrature.reference import ReferenceInputs
from airlight.reference.storage.exr import Image
from airlight.reference.storage.store import Content, Inputs, Kept, stored
from airlight.validation.arrays import Array
from airlight.validation.columns import record_of
from airlight.validation.metrics.flip import Flip, flip_hdr
from airlight.validation.study.configuration import Configuration, user_code
from airlight.validation.study.reference import of_image
from airlight.validation.study.row import Row
from airlight.validation.study.run import cell_row, layered_frame, run
from airlight.validation.study.scene import SceneStudy
from airlight.validation.study.study import Cell
from airlight.validation.study.turns import Apart, CellTimes, time_cells

Layer = NDArray[np.floating]  # frames are float32


@dataclass(frozen=True)
class Judged:
    """A row of a scene, and its image.

    A row of one of our methods is stored without the reference that it is compared with.
    """

    row: Row
    image: Image | None = None  #: its layers; None if there is none
    #: the reference of its layer `row.layer`, (height, width, 3) [W/(m^2 sr)]
    expected: Layer | None = None
    #: the reference of all its light for HDR-FLIP, (height, width, 3) [W/(m^2 sr)]; None without
    whole: Layer | None = None
    results: tuple[Kept[Any], ...] = ()  #: the cached results of which it is made

    @property
    def light(self) -> Array:
        """All light, to look at, (height, width, 3) [W/(m^2 sr)]."""
        assert self.image is not None
        shown = [
            self.image.layers[name]
            for name in ("airlight", "surface", "total")
            if name in self.image.layers
        ]
        return np.sum([np.asarray(values, dtype=np.float64) for values in shown], axis=0)


@dataclass(frozen=True)
class CellInputs(Inputs):
    """The inputs of the row and the image of a configuration."""

    kind = "cell"
    reference: ReferenceInputs
    cell: Cell  #: with the identity of its scene
    code: tuple[Content, ...]  #: of the user's in it
    machine: Mapping[str, str]


@dataclass(frozen=True)
class TimesInputs(Inputs):
    """The inputs of the times of all configurations of a scene, which are of one run."""

    kind = "scene-times"
    cells: tuple[Cell, ...]  #: with the identity of their scene, at the size of timed frames
    code: tuple[tuple[Content, ...], ...]  #: of the user's in each
    machine: Mapping[str, str]


@dataclass(frozen=True)
class FlipInputs(Inputs):
    """The inputs of HDR-FLIP."""

    kind = "flip"
    reference: Layer  #: (height, width, 3) [W/(m^2 sr)]
    test: Layer  #: of the same shape
    version: str  #: of its program


def cell_inputs(study: SceneStudy, chosen: Configuration) -> CellInputs:
    """Return the inputs of the row and the image of a configuration, without its times."""
    # How long frames are timed, and at which size, has no effect on errors. Whether all stages
    # are timed has: frames that are not finite are refused then, see `run.render`.
    measure = study.study.measure
    times = "stages" if measure.times == "stages" else "none"
    errors = replace(measure, times=times, seconds=0.0, slow=None, timed_size=None)
    cell = replace(study.cell(chosen), scene=study.identity, measure=errors)
    return CellInputs(study.reference_inputs, cell, user_code(chosen), study.machine)


def times_inputs(study: SceneStudy) -> TimesInputs | None:
    """Return the inputs of the times that are of one run; None where nothing is timed."""
    if study.study.measure.times == "none" or not study.configurations:
        return None
    cells = tuple(study.timed_cell(chosen, study.identity) for chosen in study.configurations)
    return TimesInputs(cells, tuple(map(user_code, study.configurations)), study.machine)


def row_of(
    study: SceneStudy,
    chosen: Configuration,
    apart: Apart | None,
    ended: Mapping[Configuration, str],
) -> Judged:
    """Return the row of a configuration, with its image; `ended`: how configurations ended their
    process before.
    """
    # A method that ended its process is not called again: its row says how it ended.
    if chosen in ended:
        row = cell_row(study.cell(chosen), status="refused", reason=ended[chosen])
        return Judged(row, results=(Kept(row, Spent(), time.time(), False),))
    # The reference is loaded or computed first: its time is no part of that of a configuration.
    reference = study.reference
    result = measured(study, chosen, apart)
    # The same scene may have been measured under another path.
    here = cell_row(study.cell(chosen))
    row = replace(result.value.row, scene=here.scene, command=here.command)
    judged = replace(result.value, row=row, results=(result,))
    if judged.image is None:
        return judged
    whole = reference.airlight + reference.surface if study.study.wants_flip(chosen) else None
    return replace(judged, expected=reference.airlight, whole=whole)


def measured(study: SceneStudy, chosen: Configuration, apart: Apart | None) -> Kept[Judged]:
    """Return the row and the image of a configuration."""
    inputs = cell_inputs(study, chosen)

    def compute() -> Judged:
        # The key has the identity of the scene; a process that renders the cell loads its path.
        reference = of_image(study.kept_reference.value, study.kept_reference.spent)
        row, frame = run(
            replace(inputs.cell, scene=study.path), study.scene, reference, apart=apart
        )
        row = record_of(row, Row)  # without numbers that are not finite
        return Judged(row, None if frame is None else layered_frame(study.name, chosen, frame))

    return stored(inputs, compute, Judged, lambda judged: _is_worth(judged.row))


def _is_worth(row: Row) -> bool:
    """Return whether a row is to be cached: a user may correct a method that failed."""
    return row.kind == "built-in" or row.status == "done"


def scene_times(
    study: SceneStudy, inputs: TimesInputs, rows: Sequence[Row], apart: Apart | None
) -> Kept[list[CellTimes]]:
    """Return the times of all cells of a scene, of one run; `rows`: of the cells, of which only
    those that were done can be timed.
    """
    compute = partial(_scene_times, study, rows, apart)
    return stored(inputs, compute, list[CellTimes], partial(_all_timed, rows))


def _all_timed(rows: Sequence[Row], timings: Sequence[CellTimes]) -> bool:
    """Return whether times are to be cached: a row that is tried again lacks its times."""
    return all(map(_is_worth, rows)) and not any(each.lost for each in timings)


def _scene_times(study: SceneStudy, rows: Sequence[Row], apart: Apart | None) -> list[CellTimes]:
    cells = []
    for chosen, row in zip(study.configurations, rows, strict=True):
        cell = study.timed_cell(chosen, study.path)
        # After a first frame of more than 25 s, compilation included, no larger frame is timed
        # [ms].
        long = row.cost is not None and row.cost.first_ms > 25e3
        cells.append(
            None if row.status != "done" else replace(cell, size=study.size) if long else cell
        )
    timings = time_cells(
        cells,
        lambda cell: study.timed if cell.size == study.timed_size else study.scene,
        apart=apart,
    )
    at = "timed at {} x {}: larger frames take minutes".format(*study.size)
    smaller = [cell is not None and cell.size != study.timed_size for cell in cells]
    return [
        replace(times, note=at) if less else times
        for times, less in zip(timings, smaller, strict=True)
    ]


def with_flip(judged: Judged) -> Judged:
    """Return a row with HDR-FLIP where it is asked for; its map is a grey layer of the image."""
    if judged.whole is None or judged.image is None:
        return judged
    # FLIP is another program: its version is an input beside both images.
    whole, light = judged.whole, judged.light
    inputs = FlipInputs(whole, light, _flip_version())
    result = stored(inputs, lambda: _flip(whole, light), tuple[Flip, Layer | None])
    summary, error_map = result.value
    image = judged.image
    if error_map is not None:
        image = replace(
            image, layers=dict(image.layers) | {"flip": np.repeat(error_map[:, :, None], 3, axis=2)}
        )
    return replace(
        judged,
        row=replace(judged.row, flip=summary),
        image=image,
        results=(*judged.results, result),
    )


def _flip(reference: Layer, test: Layer) -> tuple[Flip, Layer | None]:
    """Return HDR-FLIP and its map."""
    summary, error_map = flip_hdr(reference, test)
    return record_of(summary, Flip), error_map


def _flip_version() -> str:
    try:
        return version("flip-evaluator")
    except PackageNotFoundError:
        return "missing"
