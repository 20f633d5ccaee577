# SPDX-License-Identifier: BSD-3-Clause
"""Suspected faults of a whole image: a constant factor, another way up, a gamma,
values that stop at one.

Such a fault of set-up hides everything else. For each combination of suspects this module takes the
faults back, computes the root mean square error again, and names the combinations that make it ten
times smaller, the fewest first. One that is more than a factor must also leave less than a fifth of
the mean in means over blocks: an image of another brightness and shape would be called encoded
where a curve happens to make it less wrong. Noise, which blocks do not have, may remain.

The radiance grows without bound towards a point light, so that one pixel next to it can have most
of the error, whatever the others are like. The error that decides therefore leaves out the worst
hundredth of the lit values. The factor that fits best is k = exp(median(log(r/t))) over the values
that are lit in both images, with t the test image and r the reference.
"""

import math
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from airlight.validation.arrays import Array
from airlight.validation.engine.faults import BRIGHTNESS, FAULTS
from airlight.validation.engine.observation import stopped
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.statistics.comparison import block_side, block_sums

GAIN = 10.0  #: how many times smaller the error must become for a suspect to be named
#: fraction of the mean that the inverse of a curve may leave; `omni-box` by Godot's equation leaves
#: 0.28 where it is judged by that of three.js
MOST_LEFT = 0.2
OUTLIERS = 0.01  #: fraction of the lit values that may be as wrong as they like

#: The faults that are taken back from an image, by name: none, or one of each.
_UNDONE = [
    [None, *(fault for fault in FAULTS if fault.name == name and fault.undo is not None)]
    for name in ("flip", "channels", "transfer")
]


@dataclass(frozen=True)
class Hints:
    """The suspected faults of a whole image."""

    factor: float  #: times which the image fits the reference best; NaN if there is none
    factor_rmse: float  #: the relative rmse that is left then
    words: tuple[str, ...]  #: a sentence for each suspect
    corrected: Array = field(repr=False, compare=False)  #: the image without what was suspected
    reason: str = ""  #: why there is no factor
    stops: bool = False  #: whether values stop at the largest one where they should be larger


def find_hints(reference: ArrayLike, test: ArrayLike) -> Hints:
    """Look for faults of an image as a whole.

    `reference`, `test`: radiance, (height, width, 3) [W/(m^2 sr)].

    Values that are not finite in either are left out.
    """
    # Values that are not finite become NaN, which the means below leave out.
    ref, tst = (np.asarray(values, dtype=np.float64) for values in (reference, test))
    ref = np.where(np.isfinite(ref), ref, np.nan)
    tst = np.where(np.isfinite(tst), tst, np.nan)
    if np.isnan(tst).all():
        return Hints(math.nan, math.nan, (), tst, "the image has no finite value")
    mean = _mean(ref, tst)
    if not mean > 0:
        return Hints(math.nan, math.nan, (), tst, "the reference is black")
    factor = _fitted(ref, tst)
    if math.isnan(factor):
        dark = "wherever the reference is lit" if np.any(np.nan_to_num(tst)) else "everywhere"
        return Hints(math.nan, math.nan, (), tst, f"the image is black {dark}")
    corrected, words = _suspects(ref, tst, mean)
    clipped = _clipped(ref, tst)
    left = _rmse(ref, factor * tst) / mean
    return Hints(factor, left, (*words, *clipped), corrected, stops=bool(clipped))


def _mean(ref: Array, tst: Array) -> float:
    """Return the mean of the reference over the values that are finite in both images; NaN for
    none.
    """
    both = np.isfinite(ref) & np.isfinite(tst)
    return float(ref[both].mean()) if both.any() else math.nan


def _suspects(ref: Array, tst: Array, mean: float) -> tuple[Array, tuple[str, ...]]:
    """Return the image without the faults that make the error ten times
    smaller, and their names.
    """
    first = smallest = _usual_error(ref, tst)
    hints: tuple[str, ...] = ()
    corrected, rmse = tst, math.nan
    # An error of less than 1 % is no fault of the whole image.
    if first < 0.01 * mean:
        return corrected, ()
    # The combinations of fewest faults come first; a factor counts as one. A later combination
    # replaces an earlier one only if it makes the error ten times smaller again.
    combinations = product(product(*_UNDONE), (False, True))
    for faults, scaled in sorted(combinations, key=lambda each: sum(map(bool, each[0])) + each[1]):
        changed, words = tst, list[str]()
        for fault in faults:
            if fault is not None and fault.undo is not None:
                changed, words = fault.undo(changed), [*words, fault.words]
        factor = _fitted(ref, changed) if scaled else 1.0
        error = _usual_error(ref, factor * changed)
        if not error * GAIN < smallest:  # NaN where no factor fits
            continue
        if words and not _usual_block_error(ref, factor * changed) < MOST_LEFT * mean:
            continue
        smallest, corrected, rmse = error, factor * changed, _rmse(ref, factor * changed)
        hints = (*words, _brightness(factor)) if scaled else tuple(words)
    if not hints:
        return corrected, ()
    fall = (
        f"; without {'it' if len(hints) == 1 else 'all that'} the relative rmse is "
        f"{rmse / mean:.3g} instead of "
    )
    return corrected, (*hints[:-1], hints[-1] + fall + f"{_rmse(ref, tst) / mean:.3g}")


def _fitted(ref: Array, tst: Array) -> float:
    """Return the factor that fits best; NaN if no value is lit in both."""
    lit = (ref > FLOOR * _mean(ref, tst)) & (np.abs(tst) > 0)
    if not lit.any():
        return math.nan
    sign = float(np.sign(np.median(tst[lit])))
    # A difference of logarithms: the ratio may be out of range. e^700 is a number that a float can
    # hold.
    power = float(np.median(np.log(ref[lit]) - np.log(np.abs(tst[lit]))))
    return sign * math.exp(power) if power < 700.0 else math.nan


def _usual_error(ref: Array, tst: Array) -> float:
    """Return the rmse without the worst hundredth of the values that are lit in either image."""
    squared = _squared_errors(ref, tst)
    floor = FLOOR * _mean(ref, tst)
    # A hundredth of the lit values, not of all: in a dark image all lit values could be outliers.
    both = np.isfinite(ref) & np.isfinite(tst)
    lit = int(np.count_nonzero(both & ((ref > floor) | (tst > floor))))
    count = max(len(squared) - int(OUTLIERS * lit), 1)
    return (
        math.sqrt(float(np.mean(np.partition(squared, count - 1)[:count])))
        if len(squared)
        else math.nan
    )


def _usual_block_error(ref: Array, tst: Array) -> float:
    """Return the same of means over blocks of the values that are finite in both images."""
    both = np.isfinite(ref) & np.isfinite(tst)
    side = block_side(*ref.shape[:2])
    count = block_sums(both.astype(float), side)
    with np.errstate(invalid="ignore"):
        means = [block_sums(np.where(both, each, 0.0), side) / count for each in (ref, tst)]
    return _usual_error(means[0], means[1])


def _rmse(ref: Array, tst: Array) -> float:
    squared = _squared_errors(ref, tst)
    return math.sqrt(float(np.mean(squared))) if len(squared) else math.nan


def _squared_errors(ref: Array, tst: Array) -> Array:
    """Return the squared errors of the values that are finite in both images, (n,)."""
    difference = tst - ref
    with np.errstate(over="ignore"):
        return difference[np.isfinite(difference)] ** 2


def _brightness(factor: float) -> str:
    """Say how bright an image is that fits when it is multiplied by a factor."""
    if factor <= 0:
        return "the image is negative"
    return f"{BRIGHTNESS.sentence((1 / factor,))}, {-math.log2(factor):+.2f} stops"


def _clipped(ref: Array, tst: Array) -> tuple[str, ...]:
    """Say where values stop at their largest while the reference goes on."""
    # Equal values are cut off only if most of them should be larger, by 2 % at least.
    values, correct = tst[stopped(tst)], ref[stopped(tst)]
    if not len(values) or not (correct > 1.02 * values[0]).mean() > 0.5:
        return ()
    return (
        f"{len(values)} values stop at {values[0]:.4g} where the reference goes up to "
        f"{np.nanmax(correct):.4g}: write "
        "floats, without a tone curve",
    )
