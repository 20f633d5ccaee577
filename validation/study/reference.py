# SPDX-License-Identifier: BSD-3-Clause
"""The truth of the cells of one image, computed once, with its own error.

It is the quadrature at pixel centres. An area light needs many light samples, each as costly as a point light: it has
fewer here than in `airlight reference`, and their standard error is part of the bound. A sixteenth of the pixels has a
truth there, chosen by chance once for all: quantiles of errors need no more.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import TruthImage, ray_values
from reference.quadrature.replicates import standard_error
from reference.quadrature.surface import surface_hits
from reference.scene.read import read_truth
from reference.storage.kept import Spent, kept, key_of, stopwatch
from reference.storage.scene_digest import scene_digest
from validation.estimates.light_on_ray import check_camera, check_rays
from validation.estimates.quadrature import truth_image
from validation.scenes.changes import parse_changes
from validation.scenes.loading import LoadedScene, load_scene
from validation.study.study import Cell

Array = NDArray[np.float64]

# Points of lights with extent: a ray has enough at a standard error of 2 %, and has never more than 8 times 4. Each
# point takes as long as a point light does, and surfaces take as long again: these are left out.
_PLAN = PointPlan(error=2e-2, first=2, most=4, surfaces=False)

_SHARE = 16  # one pixel in so many has a truth where lights have an extent

_LEAST = 64  # pixels that have one
_SEED = 20261123  # of their choice
_STANDARD_ERRORS = 3.0  # that a bound has of a light with extent


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


def sampled_truth(scene) -> dict[str, Array]:
    """Return airlight, its bound and the mask of the pixels that have one, of an `mi.Scene`.

    Raises
    ------
    InputError
        As of `validation.estimates.quadrature.truth_image`.
    """
    truth = read_truth(scene)
    check_camera(truth)
    count = truth.height * truth.width
    mask = np.zeros(count, dtype=bool)
    mask[np.random.default_rng(_SEED).permutation(count)[: max(_LEAST, count // _SHARE)]] = True
    some = replace(truth, direction=truth.direction[mask])
    check_rays(some, surface_hits(some).distance)
    rays = ray_values(some, plan=_PLAN)
    airlight, bound = np.zeros((count, 3)), np.zeros((count, 3))
    airlight[mask] = rays.airlight
    bound[mask] = rays.bound + _STANDARD_ERRORS * standard_error(rays.replicates)[:, :3]
    if not (np.isfinite(airlight).all() and np.isfinite(bound).all()):
        raise InputError("the truth is not finite in some pixels: a light may lie on a ray; move it")
    shape = truth.height, truth.width
    return {"airlight": airlight.reshape(*shape, 3), "bound": bound.reshape(*shape, 3), "mask": mask.reshape(shape)}
