# SPDX-License-Identifier: BSD-3-Clause
"""How much speaks for an explanation, and whether it leaves anything to explain.

With e the relative errors of n pixels and s their scale in the best explanation, the log-likelihood of Cauchy's
distribution is -sum log(1 + (e/s)^2). The scale is that of values that are not dark: where half of an image is black,
the median of all errors is 0, and noise would be taken for what a fault does. The evidence of an explanation with k
numbers is what it gains over the unchanged scene, less k log(n)/2 (Schwarz 1978, Ann. Statist. 6, 461): a hypothesis
with a number must beat one without. Channels of a pixel share their noise, so that three values count as one.

Errors of neighbours that go together are no noise. An explanation leaves nothing to explain if they do not (a
correlation of 0.25 at most), if it leaves 0.4 %, which no engine need beat (1 % with lights that have extent, which are
points in the fog model), or a tenth of what there was.
"""

import math

import numpy as np

from reference.scene.read import ReferenceScene
from validation.arrays import Array, Index
from validation.engine.search import Explanation, usual_size

_LEAST_EVIDENCE = 20.0  # e^20 to one: what nobody doubts
LEAST_EFFECT = 0.002  #: mean relative change of the image: less is no fault
_LEAST_EXACT, _EXACT = 0.0005, 0.2  # the same of a fault without a number that leaves this fraction of the error
_FOUND = 0.5  # fraction of the error that an explanation leaves at most if anything was found
_LEFT, _LEFT_OF_AREA = 0.004, 0.01  # mean relative error that is no fault
_GAIN = 10.0  # what an explanation that leaves nothing makes of the error
# Correlation of neighbours; noise has 0 +- 1/sqrt(pairs), 0.04 in an image of 32 x 24 pixels. The limit for noise alone
# is low, as no fault may hide in it; where an explanation was found, a pixel filter may correlate neighbours.
_NOISE, _NOISE_ALONE = 0.25, 0.1
_EVEN = 2.0  # mean over median of errors that are noise; 1.2 of a normal distribution
_WORST = 0.02  # fraction of the pixels that may be as wrong as they like
_KNOWN = {"centre": 3e-4, "area": 3e-3}  # relative error of the fog model itself, in most pixels


def no_fault(reference: ReferenceScene) -> float:
    """Return the mean relative error that is no fault in a scene [1]."""
    return _LEFT_OF_AREA if reference.area else _LEFT


def scale_of(explanation: Explanation, pixel: str) -> float:
    """Return the scale of the errors that an explanation leaves [1]."""
    return max(usual_size(explanation.errors[explanation.lit]), _KNOWN[pixel])


def evidence(explanation: Explanation, right: Explanation, scale: float) -> float:
    """Return the evidence of an explanation against the unchanged scene, as a natural logarithm."""
    count = len(explanation.errors)
    gain = _likelihood(explanation.errors, scale) - _likelihood(right.errors, scale)
    return gain - 0.5 * explanation.parameters * math.log(count)


def _likelihood(errors: Array, scale: float) -> float:
    return -float(np.sum(np.mean(np.log1p((errors / scale) ** 2), axis=1)))


def is_enough(explanation: Explanation, right: Explanation, scale: float, pairs: tuple[Index, Index]) -> bool:
    """Return whether a fault is named: its evidence is beyond doubt, and it changes the image by `LEAST_EFFECT`.

    A fault without a number may change less, since nothing was fitted, if it leaves a fifth of the difference, or noise
    alone where the unchanged scene leaves more: shadows that are missing in the fog change a few pixels by a tenth.
    """
    changed = float(np.mean(np.abs(explanation.errors - right.errors)))
    exact = not explanation.parameters and (
        explanation.error < _EXACT * right.error or (is_noise(explanation, pairs) and not is_noise(right, pairs))
    )
    return evidence(explanation, right, scale) > _LEAST_EVIDENCE and changed > (_LEAST_EXACT if exact else LEAST_EFFECT)


def usual_error(explanation: Explanation) -> float:
    """Return the mean error of nearly all pixels: those at lamps may be as wrong as they like."""
    return _usual(np.abs(explanation.errors).mean(axis=1))


def _usual(sizes: Array) -> float:
    return float(np.sort(sizes)[: max(1, int((1 - _WORST) * len(sizes)))].mean())


def is_explained(explanation: Explanation, right: Explanation, pairs: tuple[Index, Index], little: float) -> bool:
    """Return whether what an explanation leaves is noise, or little, see `no_fault`; `pairs`: of `Predictor`.

    Where it leaves about as much as the unchanged scene does, nothing was found, and faults may hide in the rest.
    """
    if usual_error(explanation) <= little:
        return True
    if explanation.error > _FOUND * right.error:
        return is_noise(explanation, pairs)
    return correlation(explanation.errors, pairs) <= _NOISE


def is_noise(explanation: Explanation, pairs: tuple[Index, Index]) -> bool:
    """Return whether what an explanation leaves is noise, all over the image: no fault of some size hides in it.

    Neighbours do not share it, and no part of the image has most of it, as shadows have that are off.
    """
    sizes = np.abs(explanation.errors).mean(axis=1)[explanation.lit.any(axis=1)]
    even = not len(sizes) or _usual(sizes) <= _EVEN * float(np.median(sizes))
    return even and correlation(explanation.errors, pairs) <= _NOISE_ALONE


def leaves_nothing(explanation: Explanation, pixel: str) -> bool:
    """Return whether an explanation leaves no more than the fog model itself does."""
    return scale_of(explanation, pixel) <= _KNOWN[pixel] and explanation.error <= _LEFT


def gains(explanation: Explanation, right: Explanation) -> bool:
    """Return whether an explanation leaves a tenth of the errors of the unchanged scene, or less."""
    return bool(explanation.faults) and explanation.error <= right.error / _GAIN


def correlation(errors: Array, pairs: tuple[Index, Index]) -> float:
    """Return the correlation of the errors of neighbours, clipped at three scales, or what is no fault in a pixel."""
    most = max(3 * 1.4826 * float(np.median(np.abs(errors))), _LEFT)
    clipped = np.clip(errors, -most, most)
    power = float(np.mean(clipped**2))
    here, there = pairs
    return float(np.mean(clipped[here] * clipped[there])) / power if power > 0 and len(here) else 0.0
