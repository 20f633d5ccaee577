# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the values: encodings, tone curves, limits, channels. Values below 0 stay as they are."""

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.comparison.whole_image import SRGB, channel_order, to_srgb
from validation.diagnosis.hypothesis import Hypothesis, Parameter
from validation.diagnosis.prediction import Guess, Predictor

Array = NDArray[np.float64]


def _values(change: Any) -> Any:
    def changed(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
        return replace(guess, values=(*guess.values, lambda radiance: change(radiance, *p)))

    return changed


def srgb_in_8_bits(radiance: Array) -> Array:
    """Return what is left of values that were written in 8 bits by that curve, as numbers from 0 to 1."""
    return np.round(255 * np.clip(to_srgb(radiance), 0.0, 1.0)) / 255


def gamma(radiance: Array, exponent: float) -> Array:
    """Return values to the power 1/exponent."""
    return np.asarray(np.maximum(radiance, 0.0) ** (1 / exponent))


def reinhard(radiance: Array) -> Array:
    """Return x/(1 + x) (Reinhard et al. 2002, eq. 3)."""
    return np.asarray(radiance / (1 + np.maximum(radiance, 0.0)))


def exponential(radiance: Array) -> Array:
    """Return 1 - exp(-x), the response of film."""
    return np.asarray(-np.expm1(-np.maximum(radiance, 0.0)))


def filmic(radiance: Array) -> Array:
    """Return Narkowicz's fit of the ACES curve (2015)."""
    x = np.maximum(radiance, 0.0)
    return np.asarray(np.clip(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), 0.0, 1.0))


def _top(predictor: Predictor) -> float:
    values = predictor.task.values
    return float(values[np.isfinite(values)].max())


def _clamp(predictor: Predictor, guess: Guess, p: tuple[float, ...]) -> Guess:
    top = _top(predictor)
    return replace(guess, values=(*guess.values, lambda radiance: np.minimum(radiance, top)))


def _stops(predictor: Predictor) -> bool:
    """Return whether many values stop at the largest one."""
    values = predictor.task.values
    return int(np.count_nonzero(values == _top(predictor))) >= 8


def _coloured(predictor: Predictor) -> bool:
    values = predictor.task.values
    return bool(np.ptp(np.nan_to_num(values), axis=1).max() > 1e-6 * np.nanmax(np.abs(values)))


def _order(order: tuple[int, ...]) -> Hypothesis:
    words, change = channel_order(order)
    return Hypothesis("channels", "values", f"the image is {words}", _values(change), applies=_coloured)


ENCODING = (
    Hypothesis("transfer", "values", f"the image is {SRGB}", _values(to_srgb)),
    Hypothesis("transfer", "values", "the values were written in 8 bits by the sRGB curve", _values(srgb_in_8_bits)),
    Hypothesis(
        "transfer",
        "values",
        "the values are encoded by a gamma of {0:.3g}: write linear ones",
        _values(gamma),
        (Parameter("gamma", 0.2, 5.0, (0.4545, 1.8, 2.2, 2.4), logarithmic=True),),
    ),
    Hypothesis("clamp", "values", "the values are cut off at the largest one: write floats", _clamp, applies=_stops),
    Hypothesis("tone-map", "values", "the values went through the tone curve x/(1 + x)", _values(reinhard)),
    Hypothesis("tone-map", "values", "the values went through the tone curve 1 - exp(-x)", _values(exponential)),
    Hypothesis("tone-map", "values", "the values went through a filmic (ACES) tone curve", _values(filmic)),
    Hypothesis(
        "tone-map",
        "values",
        "the values went through the tone curve x/(1 + x), then the sRGB curve",
        _values(lambda radiance: to_srgb(reinhard(radiance))),
    ),
    Hypothesis(
        "tone-map",
        "values",
        "the values went through a filmic (ACES) tone curve, then the sRGB curve",
        _values(lambda radiance: to_srgb(filmic(radiance))),
    ),
    *(_order(order) for order in permutations(range(3)) if order != (0, 1, 2)),
)
