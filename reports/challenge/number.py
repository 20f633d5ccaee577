# SPDX-License-Identifier: BSD-3-Clause
"""The number of a challenge: its definition, and its interval.

With the reference r of a scene s, and the test image t, over the values of the judged pixels,

    e_s = rms(t - r) / rms(r),        rms(v) = sqrt(mean(v^2)),

which is 1 for a black image and for one twice as bright as it should be, in every scene. The number
is the geometric mean over scenes, with a floor under each error:

    G = exp( 1/K sum over kinds k of  1/n_k sum over scenes s of k of  ln max(e_s, F) ).

A kind counts as much as another one, and a scene at most a factor: where an error of one of 24
scenes is ten times as large, G is 10^(1/24) = 1.10 times as large, wherever it was. Errors below F
count as F, as they are of files and not of a method: half floats alone have up to 2^-11 = 4.9e-4.
Without the floor one scene that a method has exactly, at 1e-8, would outweigh several that it
misses.

A scene that a method cannot have counts as a black image, t = 0. Its error is

    e_s = rms(0 - r) / rms(r) = 1

for every r that is not dark, so that the stated error of the reference moves neither end of it. An
entry could have handed in a black image, so that saying so gains nothing.

The stated error of the reference is d: |r - r'| <= d for the true r'. By the triangle inequality of
the root mean square the true e_s is between

    (rms(t - r) - rms(d)) / (rms(r) + rms(d))   and   (rms(t - r) + rms(d)) / (rms(r) - rms(d)).

The interval of G is for other scenes drawn alike: a bootstrap over scenes within each kind. Out of
n_k scenes n_k - 1 are drawn with replacement, as the variance of a mean of n_k draws would be too
small by (n_k - 1)/n_k (McCarthy and Snowden 1985). The lower end is the 2.5 % quantile with the
lower end of each e_s, the upper end the 97.5 % quantile with the upper ends. The draws are seeded
by the digest of the scenes.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from airlight.validation.arrays import Array

#: least error that counts [1]: twice what half floats may have
FLOOR = 1e-3
RESAMPLES = 10_000  # the quantiles move by 1 % of the interval from one seed to another
_SAME = 1e-9  # relative, far above the rounding of a logarithm and far below a unit
DIGITS = 4  #: significant digits of all results: the fifth may differ on another machine


@dataclass(frozen=True)
class SceneError:
    """The relative error of a scene, and between which ends the stated error has it."""

    error: float
    low: float
    high: float


#: of a black image, whatever the reference is: see the module
BLACK = SceneError(1.0, 1.0, 1.0)


@dataclass(frozen=True)
class Combined:
    """The number, and its 95 % interval."""

    number: float
    low: float
    high: float


def scene_error(reference: Array, stated: Array, test: Array) -> SceneError:
    """Return the error of the judged values of a scene, (values,) each [W/(m^2 sr)], of which the
    stated errors are the smaller part; see the module.
    """
    whole, off, known_to = rms(reference), rms(test - reference), rms(stated)
    return SceneError(
        error=off / whole,
        low=max(off - known_to, 0.0) / (whole + known_to),
        high=(off + known_to) / (whole - known_to),
    )


def rms(values: Array) -> float:
    """Return the root mean square of values."""
    return math.sqrt(float(np.mean(np.square(values))))


def combined(errors: Mapping[str, Sequence[SceneError]], digest: str) -> Combined:
    """Return the number of the errors of each kind, with its interval; `digest` seeds the draws."""
    # Logarithms of errors, with the floor, by kind: (3, scenes) for the error and both ends.
    logs = [
        np.log(np.maximum([[getattr(each, end) for each in kind] for end in ENDS], FLOOR))
        for kind in errors.values()
    ]
    number = math.exp(float(np.mean([kind[0].mean() for kind in logs])))
    bits = np.random.PCG64(int(digest, 16))
    low, high = np.zeros(RESAMPLES), np.zeros(RESAMPLES)
    for kind in logs:
        # NumPy promises the stream of raw numbers; their upper 53 bits are a fraction.
        scenes = kind.shape[1]
        raw = bits.random_raw(RESAMPLES * max(scenes - 1, 1)).reshape(RESAMPLES, -1)
        drawn = ((raw >> np.uint64(11)) * 2.0**-53 * scenes).astype(int)
        low += kind[1][drawn].mean(axis=1) / len(logs)
        high += kind[2][drawn].mean(axis=1) / len(logs)
    return Combined(
        number, math.exp(float(np.quantile(low, 0.025))), math.exp(float(np.quantile(high, 0.975)))
    )


ENDS = ("error", "low", "high")


def rounded(value: float) -> float:
    """Return a number in the digits of results."""
    return float(f"{value:.{DIGITS}g}")


def rounded_out(ends: tuple[float, float]) -> tuple[float, float]:
    """Return an interval in the digits of results, whose ends lie outside of the given ones."""
    low, high = (rounded(end) for end in ends)
    # Rounding may have moved an end inwards: a unit of its last digit brings it back. The
    # rounding of a logarithm and its exponential is no such move.
    if low > ends[0] * (1 + _SAME):
        low -= _unit(low)
    if high < ends[1] * (1 - _SAME):
        high += _unit(high)
    return rounded(low), rounded(high)


def _unit(value: float) -> float:
    """Return a unit of the last digit of a result."""
    return float(10.0 ** (math.floor(math.log10(value)) + 1 - DIGITS)) if value > 0 else 0.0
