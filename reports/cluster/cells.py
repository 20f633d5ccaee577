# SPDX-License-Identifier: BSD-3-Clause
"""Cells as tasks: the reference of an image, and the rows of its cells, as workers compute them."""

import io
import platform
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import asdict, replace
from datetime import UTC, datetime
from functools import lru_cache
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
from numpy.typing import NDArray
from PIL import Image

from airlight.realtime.scene.read_scene import Scene, read_scene
from airlight.reference.storage.build import build
from airlight.reports.cluster.run import Group, Outcome, Task, is_alone
from airlight.reports.machine.environment import processor
from airlight.reports.plotting.pictures import error_map, exposure, tone_mapped
from airlight.validation.properties.properties import scene_properties
from airlight.validation.scenes.loading import LoadedScene
from airlight.validation.study.keys import Made, cell_key, row_source
from airlight.validation.study.reference import Reference, cell_reference, load_cell
from airlight.validation.study.row import FRAME_MS, NO_REFERENCE, Origin, row_values
from airlight.validation.study.rows import RowStore
from airlight.validation.study.run import cell_row, run
from airlight.validation.study.study import Cell, Study
from airlight.validation.study.turns import time_cells

_DONE = ("done", "refused", "left out")  #: what is not computed again


def reference_of(cell: Cell) -> Reference:
    """Return the reference of a cell's image, the first task of its group."""
    _forget()
    return cell_reference(_opened(cell.image)[0])


def row_of(reference: Reference, cell: Cell, key: str) -> dict[str, Any]:
    """Return the row of a cell by columns, from the reference of its image."""
    from distributed import get_worker

    # In a worker. The scene, its properties and the origin are cached for the next cell, which is
    # of the same image.
    started = datetime.now(UTC).strftime("%Y-%m-%dT%H:%M:%SZ")
    loaded, scene = _opened(cell.image)
    properties = _properties(cell.image)
    row, _ = run(cell, scene, reference, whole=loaded.scene, paint=_picture)
    row = replace(row, key=key, properties=properties, origin=replace(_origin(), started=started))
    # Only the worker knows whether its host does other work while it measures.
    if row.cost is not None and row.times is not None:
        row = replace(row, cost=replace(row.cost, alone=is_alone(get_worker())))
    return row_values(row)


def times_of(cells: Mapping[str, Cell]) -> dict[str, dict[str, Any]]:
    """Return the columns of the times of cells of one image, by their keys, of a worker
    that is alone on its host.

    They are of one run, in which the cells take turns.
    """
    from distributed import get_worker

    _forget()
    image = next(iter(cells.values())).image
    scene, alone = _opened(image)[1], is_alone(get_worker())
    columns = {}
    # The cells take turns in one run, so that a change of the machine hits all of them alike. Only
    # the columns of times come back; the errors are in the store.
    for (key, cell), timed in zip(
        cells.items(), time_cells(list(cells.values()), lambda cell: scene), strict=True
    ):
        values = row_values(cell_row(cell, times=timed.times))
        columns[key] = {name: value for name, value in values.items() if name.startswith("times.")}
        columns[key] |= {"cost.prepare_ms": timed.prepare_ms, "cost.alone": alone}
    return columns


def timing_groups(
    study: Study, made: Made, *, store: RowStore, scenes: dict[str, str]
) -> Iterator[Group]:
    """Yield a task for each image of a study that is timed alone, if times are
    missing of rows that were done.

    Then all cells of the image are timed: they are compared with one another.
    """
    # A cell that failed or was refused has no image to time.
    for keyed in _keyed(study.timed_images(), made, scenes):
        wanted = {key: cell for key, cell in keyed.items() if store.status(key) == "done"}
        # One missing time is reason enough to measure the whole image again: times of two runs are
        # not compared. The limit grows with the number of cells, as they share one task.
        if any(store.row(key)[FRAME_MS] is None for key in wanted):
            first = next(iter(wanted))
            yield Group(
                (
                    Task(
                        f"times, {first}",
                        times_of,
                        (wanted,),
                        study.limit * len(wanted),
                        alone=True,
                    ),
                )
            )


def cell_groups(
    study: Study, made: Made, *, store: RowStore, scenes: dict[str, str]
) -> Iterator[Group]:
    """Yield the tasks of every image that lacks rows, or whose cells failed, hung or aborted.

    A task is named by the key of its row and begins its arguments with the cell.
    """
    # Cells that failed, hung or aborted are tried again by each sweep; a refusal is an answer and
    # stays.
    for keyed in _keyed(study.images(), made, scenes):
        missing = {key: cell for key, cell in keyed.items() if store.status(key) not in _DONE}
        # The reference comes first in the group: its value is an argument of all cells, and one
        # worker loads the scene once.
        if missing:
            image = next(iter(missing.values())).image
            words = " ".join((image.scene, *image.medium, f"{image.size[0]}x{image.size[1]}"))
            tasks = tuple(
                Task(key, row_of, (cell, key), study.limit) for key, cell in missing.items()
            )
            yield Group(tasks, Task(f"{NO_REFERENCE}{words}", reference_of, (image,), study.limit))


def _keyed(
    images: Iterable[Iterable[Cell]], made: Made, scenes: dict[str, str]
) -> Iterator[dict[str, Cell]]:
    """Yield the cells of each image by their keys; `scenes` are digests of files, see
    `validation.study.keys`.
    """
    return ({cell_key(cell, made, scenes): cell for cell in cells} for cells in images)


def row_without_numbers(cell: Cell, key: str, outcome: Outcome) -> dict[str, Any]:
    """Return the row of a cell that came to nothing: the outcome says why."""
    origin = Origin(**asdict(build()), source=row_source()[:12])
    return row_values(
        cell_row(cell, status=outcome.status, reason=outcome.reason, key=key, origin=origin)
    )


def _forget() -> None:
    """Let the next image be loaded from its file: a worker may live for several runs, between which
    a file may change.
    """
    _opened.cache_clear()
    _properties.cache_clear()


@lru_cache(maxsize=1)
def _opened(image: Cell) -> tuple[LoadedScene, Scene]:
    """Return the scene of an image, loaded and as methods read it; that of the
    last cell of the group is there already.
    """
    loaded = load_cell(image)
    return loaded, read_scene(loaded.scene)


@lru_cache(maxsize=1)
def _properties(image: Cell) -> dict[str, float]:
    return scene_properties(_opened(image)[1])


@lru_cache(maxsize=1)
def _origin() -> Origin:
    from importlib.metadata import version

    return Origin(
        **asdict(build()),
        source=row_source()[:12],
        host=platform.node(),
        device=processor(),
        variant=mi.variant(),
        threads=dr.thread_count(),
        mitsuba=version("mitsuba"),
        drjit=version("drjit"),
        python=platform.python_version(),
    )


def _picture(reference: NDArray[np.float64], test: NDArray[np.float64]) -> bytes:
    """Return reference, image and error side by side as WebP."""
    # Both images in the exposure of the reference, and their error, so that a row of the sweep can
    # be looked at.
    factor = exposure(reference)
    parts = [tone_mapped(reference, factor), tone_mapped(test, factor), error_map(reference, test)]
    shown = Image.fromarray(np.concatenate(parts, axis=1))
    # The box is three images wide and bounds the height too; the aspect ratio stays.
    widest = 320  # pixels
    if reference.shape[1] > widest:
        shown.thumbnail((3 * widest, 3 * widest))
    file = io.BytesIO()
    shown.save(file, "WEBP", quality=60)
    return file.getvalue()
