# SPDX-License-Identifier: BSD-3-Clause
"""The decision among explanations of an image: the evidence for each, what it leaves, and the two
limits within which a fault is named.

**Evidence.** With e the relative errors of n pixels and s their scale in the best explanation, the
logarithm of Cauchy's likelihood is -sum log(1 + (e/s)^2). Channels of a pixel share their noise, so
that three values count as one. The evidence of an explanation is this logarithm for its errors
minus the logarithm for the unchanged scene.

Neighbouring pixels share their errors where an image was denoised, has fog of a low resolution, or
was accumulated over frames; such pixels are no independent witnesses. Blocks of B x B pixels say
how many count as one: with S the sum of the errors of a block and Q the sum of their squares,

    A = sum over blocks of S^2 / sum over blocks of Q

is 1 in the mean for independent errors, and the number of pixels in a block where all pixels of a
block have one error. The gain over A, less log(n/A)/2 for each number (Schwarz 1978, Ann. Statist.
6, 461), is the evidence. It is a score: its limit is measured by
`docs/tools/calibrate_diagnosis.py`, on right images with the errors that engines have and on faulty
ones.

**Noise.** An explanation leaves noise if A is 1 at most, within two standard errors of it for
independent pixels, sqrt(2/blocks). One image in thirty of normal noise alone is beyond: A is then a
mean over blocks of chi-squares.

**Choice.** The explanation with the most evidence is chosen, or the simplest one of all that are as
good. Where something else is wrong anyway, numbers take away some of that too: a number that takes
away less than a tenth of what is left is none. A pair of faults is chosen if the second is as sure
as the first, in an image that has the first one. The fault is named if its evidence and the
fraction of the error that it leaves are within the limits of `calibration.json`: the diagnosis then
names a fault in at most 5 % of the right images with errors of engines.
"""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

import numpy as np

from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.engine.prediction import Predictor
from airlight.validation.engine.search import Explanation, usual_size
from airlight.validation.statistics.comparison import block_side

#: Relative error of the fog model itself, in most pixels: of pixel centres the error of its
#: quadrature, of means over pixels the error of 3 x 3 rays.
MODEL_ERROR = {"centre": 3e-4, "area": 3e-3}

#: Fraction of the error of an image: less is no second fault, and no other image. The diagnosis
#: of the calibration reads it, which chose the limits with it.
LITTLE = 0.05

_ALIKE = 5.0  #: explanations whose evidence differs by this are as good as one another
_HARDLY = 0.1  #: fraction of what is left that a number takes away by chance, see the module

_LIMITS = json.loads(Path(__file__).with_name("calibration.json").read_text(encoding="utf-8"))
#: Least evidence with which a fault is named, and the largest fraction of the error that it may
#: leave where that is no noise. `docs/tools/calibrate_diagnosis.py` chooses both and writes the
#: file.
LEAST_EVIDENCE, MOST_LEFT = float(_LIMITS["evidence"]), float(_LIMITS["left"])


@dataclass(frozen=True)
class Blocks:
    """The pixels of an image that are looked at, in blocks."""

    number: Index  #: of the block of each pixel, (m,)
    count: int  #: of blocks with pixels

    @classmethod
    def of(cls, predictor: Predictor) -> "Blocks":
        """Return the blocks of what is looked at."""
        # As many pixels a side as in a comparison (`validation.engine.verdict`), but six blocks at
        # least along the shorter side: a few blocks tell no noise from a gradient. Not all pixels
        # are looked at, so that blocks have different numbers of them, or none.
        height, width = predictor.shape
        side = block_side(height, width, fewest=6)
        row, column = np.divmod(predictor.pixels, width)
        used, number = np.unique((row // side) * width + column // side, return_inverse=True)
        return cls(number, len(used))

    def area(self, errors: Array, lit: Bools) -> float:
        """Return how many pixels count as one: A of the module, of errors (m, 3),
        clipped at three usual ones.

        `lit`: which values are not dark, (m, 3): the others have no noise.
        """
        # Three usual errors: beyond, single pixels such as the ones at a light would decide.
        clipped = np.where(lit, errors, 0.0)
        most = 3.0 * usual_size(errors[lit])
        clipped = np.clip(clipped, -most, most)
        sums = sum(np.sum(np.bincount(self.number, channel) ** 2) for channel in clipped.T)
        power = float(np.sum(clipped**2))
        return float(sums) / power if power > 0 else 1.0

    def is_noise(self, explanation: Explanation) -> bool:
        """Return whether what an explanation leaves is independent from pixel to pixel."""
        # Two standard errors of A for independent pixels.
        area = self.area(explanation.errors, explanation.lit)
        return area <= 1 + 2.0 * math.sqrt(2 / self.count)


def scale_of(explanation: Explanation, pixel: str) -> float:
    """Return the scale of the errors that an explanation leaves [1]: the error of the fog model at
    least.
    """
    return max(usual_size(explanation.errors[explanation.lit]), MODEL_ERROR[pixel])


def evidence(explanation: Explanation, right: Explanation, scale: float, area: float) -> float:
    """Return the evidence of an explanation against the unchanged scene; `area`: how
    many pixels count as one.
    """
    # Schwarz's price of a number grows with the count of independent pixels, e at least, so that no
    # number is free.
    gain = _likelihood(explanation.errors, scale) - _likelihood(right.errors, scale)
    independent = max(len(explanation.errors) / area, math.e)
    return gain / area - 0.5 * explanation.parameters * math.log(independent)


def _likelihood(errors: Array, scale: float) -> float:
    # The mean over channels: the three values of a pixel count as one.
    return -float(np.sum(np.mean(np.log1p((errors / scale) ** 2), axis=1)))


@dataclass(frozen=True)
class Candidates:
    """The explanations of an image that were tried, and the choice among them."""

    pixel: str  #: 'centre' or 'area'
    blocks: Blocks  #: of the pixels that are looked at
    right: Explanation  #: the scene as it is
    tried: tuple[Explanation, ...] = ()

    def with_more(self, explanations: Iterable[Explanation]) -> "Candidates":
        """Return the candidates with further explanations."""
        return replace(self, tried=(*self.tried, *explanations))

    # The errors that an explanation leaves.

    def is_little(self, explanation: Explanation) -> bool:
        """Return whether an explanation leaves no more than the error of the fog model itself, or
        little more.
        """
        # A twentieth of the error of the image is little too, up to the model's error of means.
        most = max(MODEL_ERROR[self.pixel], min(MODEL_ERROR["area"], LITTLE * self.right.error))
        return explanation.error <= most

    def is_enough(self, explanation: Explanation) -> bool:
        """Return whether an explanation leaves noise, or little: nothing for another fault."""
        return self.blocks.is_noise(explanation) or self.is_little(explanation)

    def remainder(self, explanation: Explanation) -> str:
        """Return what an explanation leaves in words; nothing where something else is wrong too."""
        if self.blocks.is_noise(explanation):
            return "like noise: neighbouring pixels do not share it"
        return "little" if self.is_little(explanation) else ""

    # The choice.

    @cached_property
    def _least(self) -> tuple[float, float]:
        """The scale of the errors that no fault makes, and how many pixels count as one."""
        # The explanation that leaves least says both, for all explanations.
        least = min([self.right, *self.tried], key=lambda each: scale_of(each, self.pixel))
        area = max(self.blocks.area(least.errors, least.lit), 1.0)
        return scale_of(least, self.pixel), area

    def evidence(self, explanation: Explanation) -> float:
        """Return the evidence of an explanation."""
        return evidence(explanation, self.right, *self._least)

    @cached_property
    def chosen(self) -> Explanation:
        """The explanation with the most evidence, or the simplest of all that are as good; or the
        scene as it is.
        """
        singles = [each for each in self.tried if len(each.faults) == 1]
        pairs = [each for each in self.tried if len(each.faults) > 1]
        best = self._best([self.right, *singles])
        if not pairs:
            return best
        # The second fault must be as sure as the first, in an image that has the first one: it
        # leaves a fraction of what the single fault leaves, or does with as few numbers.
        pair = self._best(pairs)
        is_sure = self.evidence(pair) > self.evidence(best) + LEAST_EVIDENCE
        is_simple = bool(best.faults) and pair.parameters <= best.parameters
        return pair if is_sure and (is_simple or pair.error < MOST_LEFT * best.error) else best

    def _best(self, explanations: Sequence[Explanation]) -> Explanation:
        """Return the explanation with the most evidence, or the simplest of all that are as good.

        A further number is worth its error only where the simpler explanation leaves more than
        little: fog with a scale height of 10 km is an extinction, and so is fog with a scale height
        of 90 m that fits a rest of 0.1 %.
        """
        weighed = [(self.evidence(each), each) for each in explanations]
        weighed.sort(key=lambda each: -each[0])
        most, best = weighed[0]
        alike = [
            each
            for weight, each in weighed
            if weight >= most - _ALIKE
            or self._is_as_good(each, best)
            or self._is_hardly_worse(each, best)
        ]

        def size(each: Explanation) -> tuple[int, int]:
            return each.parameters, len(each.faults)

        # The simplest ones by their evidence. The rank decides between those that leave the same.
        least = min(map(size, alike))
        simplest = [each for each in alike if size(each) == least]
        same = [each for each in simplest if self.is_same_image(each, simplest[0])]
        return min(same, key=lambda each: sum(fault.rank for fault in each.faults))

    def _is_as_good(self, one: Explanation, best: Explanation) -> bool:
        """Return whether an explanation is nearly the image of the best one, and leaves little, or
        hardly more where the best one leaves no noise.
        """
        apart = float(np.abs(one.errors - best.errors).mean())
        leaves_little = bool(one.faults) and self.is_little(one)
        # Errors that are noise are independent, and the evidence weighs them by itself: a medium
        # without its first 0.2 m is nearly an image that is 1.05 times as bright.
        is_noise = self.blocks.is_noise(best)
        hardly_more = not is_noise and one.error <= (1 + LITTLE) * best.error
        return apart <= LITTLE * self.right.error and (leaves_little or hardly_more)

    def _is_hardly_worse(self, one: Explanation, best: Explanation) -> bool:
        """Return whether an explanation of fewer numbers leaves hardly more than the best one,
        where that leaves something which no fault here makes.
        """
        fewer = best.parameters - one.parameters
        if not one.faults or fewer <= 0 or self.is_enough(best):
            return False
        return one.error <= min((1 + _HARDLY) ** fewer * best.error, MOST_LEFT * self.right.error)

    def is_same_image(self, one: Explanation, other: Explanation) -> bool:
        """Return whether two explanations are the same image within noise, or within the error of
        the fog model.
        """
        apart = float(np.abs(one.errors - other.errors).mean())
        difference = abs(self.evidence(one) - self.evidence(other))
        return difference <= _ALIKE or apart <= MODEL_ERROR[self.pixel]

    def is_named(self, explanation: Explanation) -> bool:
        """Return whether an explanation is within the limits of the calibration."""
        leaves_few = explanation.error < MOST_LEFT * self.right.error
        return self.evidence(explanation) > LEAST_EVIDENCE and (
            self.is_enough(explanation) or leaves_few
        )
