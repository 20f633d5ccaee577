# SPDX-License-Identifier: BSD-3-Clause
"""The truth of some pixels of an image that lights with extent light.

A light with extent needs many points, each as dear as a point light: here it has fewer than in `airlight reference`,
and their standard error is part of the truth's bound. A sixteenth of the pixels has a truth, chosen by chance once for
all: quantiles of errors need no more.
"""

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import ray_values
from reference.quadrature.replicates import standard_error
from reference.quadrature.surface import surface_hits
from reference.scene.read import read_truth
from validation.estimates.light_on_ray import check_camera, check_rays

Array = NDArray[np.float64]

# Points of lights with extent: a ray has enough at a standard error of 2 %, and has never more than 8 times 4. Each
# point takes as long as a point light does, and surfaces take as long again: these are left out.
_PLAN = PointPlan(error=2e-2, first=2, most=4, surfaces=False)

_SHARE = 16  # one pixel in so many has a truth where lights have an extent

_LEAST = 64  # pixels that have one
_SEED = 20261123  # of their choice
_STANDARD_ERRORS = 3.0  # that a bound has of a light with extent


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
