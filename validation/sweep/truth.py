# SPDX-License-Identifier: BSD-3-Clause
"""The truth of the cells of one image, computed once, with its own error.

It is the quadrature at pixel centres. A light with extent needs many points: here it has fewer than in `airlight
reference`, and their standard error is part of the truth's bound.
"""

import time
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import TruthImage
from reference.storage.cache import load_arrays, store_arrays
from reference.storage.scene_digest import cache_key
from validation.estimates.quadrature import truth_image
from validation.scenes.changes import parse_changes
from validation.scenes.loading import LoadedScene, load_scene
from validation.sweep.study import Cell

Array = NDArray[np.float64]

#: Points of lights with extent: a ray has enough at a standard error of 2 %, and has never more than 8 times 4. Each
#: point takes as long as a point light does, and surfaces take as long again: these are left out.
AREA_PLAN = PointPlan(error=2e-2, first=2, most=4, surfaces=False)

_STANDARD_ERRORS = 3.0  # that a bound has of a light with extent


@dataclass(frozen=True)
class CellTruth:
    """What all cells of one image share."""

    estimator: str
    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    bound: Array  #: of its error, three standard errors of lights with extent among it [W/(m^2 sr)]
    surface: Array | None  #: (height, width, 3) [W/(m^2 sr)]; None where lights with extent are left out of it
    crossings: int | None  #: of all camera rays with edges between light and shadow
    seconds: float  #: that it took when it was computed
    processor_seconds: float  #: of all threads, in that time


def load_cell(cell: Cell) -> LoadedScene:
    """Load the scene of a cell at its size, with its medium.

    Raises
    ------
    InputError
        As of `validation.scenes.loading.load_scene`.
    """
    return load_scene(cell.scene, cell.size, parse_changes(cell.medium))


def cell_truth(loaded: LoadedScene) -> CellTruth:
    """Return the truth of a loaded scene, from the cache where it was computed before.

    Raises
    ------
    InputError
        As of `validation.estimates.quadrature.truth_image`.
    """
    key = "sweep-truth-cost/" + cache_key(loaded.scene, "quadrature", {"plan": repr(AREA_PLAN)})
    begin, spent = time.perf_counter(), time.process_time()
    image = truth_image(loaded.scene, plan=AREA_PLAN)
    took = {"seconds": time.perf_counter() - begin, "processor": time.process_time() - spent}
    kept = load_arrays(key)
    if kept is None:
        store_arrays(key, took)
    else:
        took = {name: float(value) for name, value in kept.items()}
    costs = took["seconds"], took["processor"]
    surface = image.surface if image.airlight_se is None else None
    return CellTruth("quadrature", image.airlight, _bound(image), surface, image.transitions, *costs)


def _bound(image: TruthImage) -> Array:
    spread = 0.0 if image.airlight_se is None else _STANDARD_ERRORS * image.airlight_se
    return np.asarray(image.airlight_bound + spread)
