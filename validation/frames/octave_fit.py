# SPDX-License-Identifier: BSD-3-Clause
"""The constants of `cloud-octaves` that fit a scene best.

Extinction, contribution and anisotropy are searched for the least relative RMSE of the airlight against a truth, by
Nelder and Mead's simplex in x = log(c/(1 - c)), so that each constant c stays between 0 and 1. The search starts at
1/2 for all, as Wrenninge 2013 has them, and again from where light is extinguished less; the better end counts. The
constants are arrays, so that frames are recorded once for all of them.

A truth by random samples has noise, whose relative RMSE no constants can go below; it is told beside the error.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import drjit as dr
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from analytic.errors import InputError
from realtime.frame.renderer import evaluated, frame_renderer, image_frame, run_cast_and_shade, run_method
from realtime.methods.registry import METHODS
from realtime.scene.read_scene import Scene
from validation.metrics.errors import error_metrics

Array = NDArray[np.floating[Any]]

NAMES = ("extinction", "contribution", "anisotropy")
HALVED = (0.5, 0.5, 0.5)
_STARTS = (HALVED, (0.2, 0.7, 0.7))
_CLOSE = 1e-3  # in x, and relative to the error: where the simplex stops
_MOST = 200  # frames of a start


@dataclass(frozen=True)
class Constants:
    """Constants of octaves, and how wrong the airlight is with them."""

    extinction: float
    contribution: float
    anisotropy: float
    relative_rmse: float
    relative_bias: float


@dataclass(frozen=True)
class OctaveFit:
    """The constants that fit a scene best, beside those that halve everything."""

    octaves: int
    steps: int
    halved: Constants
    fitted: Constants
    noise: float | None  #: relative RMSE of the truth itself, from its standard errors; None where it has none
    frames: int  #: that the search rendered


def fit_octaves(
    scene: Scene,
    truth: Array,
    *,
    standard_error: Array | None = None,
    parameters: Mapping[str, Any] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> OctaveFit:
    """Return the constants with the least relative RMSE of the airlight.

    Parameters
    ----------
    scene
        A scene of clouds.
    truth, standard_error
        The airlight of all orders and its standard errors, (height, width, 3) [W/(m^2 sr)].
    parameters
        Others of `cloud-octaves`.
    progress
        Called with frames done, frames at most, and the error so far.

    Raises
    ------
    InputError
        For a truth of another size or without light, and for constants among the `parameters`.
    """
    given = dict(parameters or {})
    for name in NAMES:
        if name in given:
            raise InputError(f"--set: got {name}, which is fitted; leave it out")
    size = scene.camera.height, scene.camera.width
    if truth.shape[:2] != size:
        raise InputError(
            f"the truth has {truth.shape[1]} x {truth.shape[0]} pixels, the scene {size[1]} x {size[0]}; give --size"
        )
    if not truth.mean() > 0:
        raise InputError("the truth has no airlight; wanted an image with the layer 'airlight' of this scene's clouds")
    renderer = frame_renderer(scene, METHODS["cloud-octaves"], **given)
    cast, by_light = run_cast_and_shade(renderer)
    state = renderer.prepare(scene)
    Float = type(scene.camera.origin.x)
    errors: list[float] = []

    def with_constants(values: Any) -> Constants:
        arrays = {name: dr.opaque(Float, float(value)) for name, value in zip(NAMES, values, strict=True)}
        layers = run_method(renderer, replace(state, **arrays), cast, by_light)
        airlight = image_frame(renderer, evaluated(cast, by_light, layers)).airlight
        metrics = error_metrics(truth, airlight)
        extinction, contribution, anisotropy = (float(value) for value in values)
        return Constants(extinction, contribution, anisotropy, metrics.relative_rmse, metrics.relative_bias)

    def error(x: Array) -> float:
        errors.append(with_constants(_constants(x)).relative_rmse)
        if progress is not None:
            progress(min(len(errors), _MOST * len(_STARTS)), _MOST * len(_STARTS), f"error {min(errors):.4g}")
        return errors[-1]

    options = {"xatol": _CLOSE * 10, "fatol": _CLOSE * 0.1, "maxfev": _MOST}
    ends = [minimize(error, _free(start), method="Nelder-Mead", options=options) for start in _STARTS]
    best = min(ends, key=lambda end: end.fun)
    noise = None
    if standard_error is not None:
        noise = float(np.sqrt(np.mean(standard_error**2)) / truth.mean())
    chosen = {**METHODS["cloud-octaves"].defaults, **given}
    return OctaveFit(
        octaves=int(chosen["octaves"]),
        steps=int(chosen["steps"]),
        halved=with_constants(HALVED),
        fitted=with_constants(_constants(best.x)),
        noise=noise,
        frames=len(errors) + 2,
    )


def _free(constants: Any) -> Array:
    values = np.asarray(constants)
    return np.log(values / (1 - values))


def _constants(x: Array) -> Array:
    return 1 / (1 + np.exp(-x))
