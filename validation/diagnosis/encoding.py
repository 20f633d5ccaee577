# SPDX-License-Identifier: BSD-3-Clause
"""Faults of the values: encodings, tone curves, limits, channels. Values below 0 stay as they are."""

from dataclasses import replace
from itertools import permutations
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import PchipInterpolator

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


# Blender's view transforms: a curve of log2(x/0.18) at even places, as Blender 5.0.1 wrote greys into a file.
_STOPS = np.linspace(-10.0, 6.5, 23)
_FILMIC = (
    1.5e-5, 0.003, 0.0074, 0.0136, 0.0224, 0.0348, 0.0522, 0.0764, 0.1095, 0.1538, 0.2113, 0.2833,
    0.3694, 0.4664, 0.5677, 0.6668, 0.7571, 0.8336, 0.8941, 0.9388, 0.9697, 0.9892, 1.0,
)  # fmt: skip
_AGX = (
    0.0, 0.0001, 0.0007, 0.0023, 0.0059, 0.0129, 0.0258, 0.0492, 0.0805, 0.12, 0.171, 0.2369,
    0.3204, 0.4238, 0.5359, 0.6379, 0.7242, 0.7951, 0.8536, 0.9014, 0.9404, 0.9728, 1.0,
)  # fmt: skip
# AgX mixes channels before its curve, and takes that back in linear light after it; fitted to colours, to 2e-3.
_AGX_BEFORE = np.array([[0.5691, 0.3314, 0.0995], [0.1191, 0.7372, 0.1437], [0.0934, 0.198, 0.7086]])
_AGX_AFTER = np.array([[1.8311, -0.7004, -0.1307], [-0.2281, 1.3306, -0.1025], [-0.1837, -0.3038, 1.4875]])


def _by_stops(curve: tuple[float, ...], radiance: Array) -> Array:
    stops = np.log2(np.maximum(radiance, 1e-30) / 0.18)
    return np.asarray(PchipInterpolator(_STOPS, curve)(np.clip(stops, _STOPS[0], _STOPS[-1])))


def blender_filmic(radiance: Array) -> Array:
    """Return Blender's view transform Filmic."""
    return _by_stops(_FILMIC, radiance)


def agx(radiance: Array) -> Array:
    """Return Blender's view transform AgX, which it begins with."""
    encoded = _by_stops(_AGX, radiance @ _AGX_BEFORE.T)
    linear = np.where(encoded <= 0.04045, encoded / 12.92, ((encoded + 0.055) / 1.055) ** 2.4)
    return np.clip(to_srgb(linear @ _AGX_AFTER.T), 0.0, 1.0)


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


def _darkest(predictor: Predictor, guess: Guess) -> tuple[float, ...]:
    """Return what the darker half of the image has more than the guess."""
    predicted, seen = predictor.predicted(guess), predictor.seen(guess)
    more = (seen - predicted)[predicted <= np.median(predicted)]
    return (max(float(np.median(more)), 1e-6 * float(np.abs(seen).mean())),)


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
    Hypothesis(
        "tone-map", "values", "the values went through Blender's view transform Filmic", _values(blender_filmic)
    ),
    Hypothesis("tone-map", "values", "the values went through Blender's view transform AgX", _values(agx)),
    Hypothesis(
        "black-level",
        "values",
        "every value has {0:.3g} added: a black level, a veil or light from elsewhere",
        _values(lambda radiance, level: radiance + level),
        (Parameter("level", 1e-30, 1e30, (1.0,), logarithmic=True),),
        begin=_darkest,
    ),
    *(_order(order) for order in permutations(range(3)) if order != (0, 1, 2)),
)
