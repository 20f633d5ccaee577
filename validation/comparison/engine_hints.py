# SPDX-License-Identifier: BSD-3-Clause
"""What may be wrong with an image as a whole: a constant factor, another way up, a gamma, values that stop at one.

Such a fault of set-up hides everything else. For each combination of suspects this module takes the faults back,
computes the root mean square error again, and names those that make it ten times smaller, the fewest first. The factor
that fits best, in the sense of that same error, is k = sum(t r)/sum(t^2), with t the test image and r the reference.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

GAIN = 10.0  #: how many times smaller the error must become for a suspect to be named
LEAST = 0.01  #: relative rmse below which nothing is suspected

_TURNS: dict[str, Callable[[Array], Array]] = {
    "": lambda image: image,
    "upside down (flip it vertically)": lambda image: image[::-1],
    "mirrored left to right (a left-handed camera or an axis of the scene)": lambda image: image[:, ::-1],
    "turned by 180 degrees": lambda image: image[::-1, ::-1],
}
_ORDERS: dict[str, Callable[[Array], Array]] = {
    "": lambda image: image,
    "in the channel order B, G, R": lambda image: image[..., ::-1],
}
_CURVES: dict[str, Callable[[Array], Array]] = {
    "": lambda image: image,
    "encoded by the sRGB curve (write linear values)": lambda image: _from_srgb(image),
}
_NAMED = {
    "pi": math.pi,
    "2 pi": 2 * math.pi,
    "4 pi": 4 * math.pi,
    "pi^2": math.pi**2,
    "4 pi^2": 4 * math.pi**2,
    "683, lumens a watt": 683.0,
}


@dataclass(frozen=True)
class Hints:
    """What may be wrong with an image as a whole."""

    factor: float  #: times which the image fits the reference best; NaN if it is black or not finite
    factor_rmse: float  #: the relative rmse that is left then
    words: tuple[str, ...]  #: a sentence for each suspect


def find_hints(reference: ArrayLike, test: ArrayLike) -> Hints:
    """Look for faults of an image as a whole.

    Parameters
    ----------
    reference, test
        Radiance, (height, width, 3) [W/(m^2 sr)].

    Notes
    -----
    Pixels that are not finite in either are left out.
    """
    ref, tst = (np.asarray(values, dtype=np.float64) for values in (reference, test))
    mean = float(np.mean(ref[np.isfinite(ref)])) if np.isfinite(ref).any() else 0.0
    if mean <= 0 or not np.isfinite(tst).any():
        return Hints(math.nan, math.nan, ())
    factor, error = _fitted(ref, tst)
    return Hints(factor, error / mean, (*_suspects(ref, tst, mean), *_clipped(ref, tst)))


def _suspects(ref: Array, tst: Array, mean: float) -> tuple[str, ...]:
    """Name the faults without which the error is ten times smaller."""
    first = smallest = _rmse(ref, tst)
    hints: tuple[str, ...] = ()
    if first < LEAST * mean:
        return hints
    combinations = sorted(product(_TURNS, _ORDERS, _CURVES, (False, True)), key=lambda changes: sum(map(bool, changes)))
    for turn, order, curve, scaled in combinations:
        changed = _TURNS[turn](_ORDERS[order](_CURVES[curve](tst)))
        factor, error = _fitted(ref, changed) if scaled else (1.0, _rmse(ref, changed))
        if not error * GAIN < smallest:  # NaN where the image is black
            continue
        smallest = error
        words = [f"the image is {fault}" for fault in (turn, order, curve) if fault]
        hints = (*words, f"the image is {_brightness(factor)}") if scaled else tuple(words)
    fall = f"; without {'it' if len(hints) == 1 else 'all that'} the relative rmse is {smallest / mean:.3g} instead of "
    return (*hints[:-1], hints[-1] + fall + f"{first / mean:.3g}") if hints else ()


def _fitted(ref: Array, tst: Array) -> tuple[float, float]:
    """Return the factor that fits best, and the rmse that it leaves."""
    good = np.isfinite(ref) & np.isfinite(tst)
    power = float(np.sum(tst[good] ** 2))
    if power == 0 or not math.isfinite(power):
        return math.nan, math.nan
    factor = float(np.sum(tst[good] * ref[good])) / power
    return factor, _rmse(ref, factor * tst)


def _rmse(ref: Array, tst: Array) -> float:
    difference = tst - ref
    good = np.isfinite(difference)
    return float(np.sqrt(np.mean(difference[good] ** 2))) if good.any() else math.nan


def _brightness(factor: float) -> str:
    """Return how bright an image is that fits when it is multiplied by a factor, with a name for it if it has one."""
    if factor <= 0:
        return "negative"
    times = 1 / factor
    name = next((word for word, value in _NAMED.items() if abs(times / value - 1) < 0.01), "")
    name = name or next((f"1/({word})" for word, value in _NAMED.items() if abs(factor / value - 1) < 0.01), "")
    return f"{times:.4g} times as bright as it should be ({name + ', ' if name else ''}{math.log2(times):+.2f} stops)"


def _clipped(ref: Array, tst: Array) -> tuple[str, ...]:
    """Say where values stop at their largest while the reference goes on."""
    finite = tst[np.isfinite(tst)]
    top = float(finite.max())
    stopped = tst == top
    count = int(stopped.sum())
    if count < 8 or top <= 0 or not (ref[stopped] > 1.02 * top).mean() > 0.5:
        return ()
    return (
        f"{count} values stop at {top:.4g} where the truth goes up to {ref[stopped].max():.4g}: write floats, "
        "without a tone curve",
    )


def _from_srgb(image: Array) -> Array:
    """Return the linear values of those encoded by IEC 61966-2-1."""
    low = image / 12.92
    with np.errstate(invalid="ignore"):
        return np.where(image <= 0.04045, low, ((np.maximum(image, 0) + 0.055) / 1.055) ** 2.4)
