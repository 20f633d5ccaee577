# SPDX-License-Identifier: BSD-3-Clause
"""The truth of the cells of one image, computed once, with its own error.

It is the quadrature at pixel centres, under lights with extent that of some pixels (`validation.sweep.sampled_truth`).
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.ray_values import TruthImage
from reference.storage.kept import Spent, kept, key_of, stopwatch
from reference.storage.scene_digest import scene_digest
from validation.estimates.quadrature import truth_image
from validation.scenes.changes import parse_changes
from validation.scenes.loading import LoadedScene, load_scene
from validation.sweep.sampled_truth import sampled_truth
from validation.sweep.study import Cell

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CellTruth:
    """What all cells of one image share."""

    estimator: str
    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    bound: Array  #: of its error, three standard errors of lights with extent among it [W/(m^2 sr)]
    surface: Array | None  #: (height, width, 3) [W/(m^2 sr)]; None where lights with extent are left out of it
    mask: NDArray[np.bool_] | None  #: pixels that have a truth, (height, width); None for all
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
    if not any(emitter.get_shape() is not None for emitter in loaded.scene.emitters()):
        spent = stopwatch()
        return _of_all(truth_image(loaded.scene), spent())
    key = key_of("sweep-truth", sampled_truth, scene=scene_digest(loaded.scene))
    result = kept(key, lambda: sampled_truth(loaded.scene))
    return _of_some(result.arrays, result.spent)


def _of_all(image: TruthImage, cost: Spent) -> CellTruth:
    return CellTruth("quadrature", image.airlight, image.airlight_bound, image.surface, None, image.transitions, *cost)


def _of_some(values: Mapping[str, Any], cost: Spent) -> CellTruth:
    return CellTruth("quadrature", values["airlight"], values["bound"], None, values["mask"], None, *cost)
