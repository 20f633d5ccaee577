# SPDX-License-Identifier: BSD-3-Clause
"""How much speaks for an explanation of an image, and whether what it leaves is noise.

**Evidence.** With e the relative errors of n pixels and s their scale in the best explanation, the
logarithm of Cauchy's likelihood is -sum log(1 + (e/s)^2). Channels of a pixel share their noise, so
that three values count as one. The evidence of an explanation is this logarithm for its errors
minus the logarithm for the unchanged scene.

Neighbouring pixels share their errors where an image was denoised, has fog of a low resolution, or
was accumulated over frames; such pixels are no independent witnesses. Blocks of B x B pixels say
how many count as one: with S the sum of the errors of a block and Q the sum of their squares,

    A = sum over blocks of S^2 / sum over blocks of Q

is 1 in the mean for independent errors, and the number of pixels in a block where all of these
agree. The gain over A, less log(n/A)/2 for each number (Schwarz 1978, Ann. Statist. 6, 461), is the
evidence. It is a score: its limit is measured by `docs/tools/calibrate_diagnosis.py`, on right
images with the errors that engines have and on faulty ones.

**Noise.** An explanation leaves noise if A is 1 at most, within two standard errors of it for
independent pixels, sqrt(2/blocks). One image in thirty of normal noise alone is beyond: A is then a
mean over blocks of chi-squares.
"""

import json
import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from airlight.validation.arrays import Array, Bools, Index
from airlight.validation.engine.prediction import Predictor
from airlight.validation.engine.search import Explanation, usual_size

#: Relative error of the fog model itself, in most pixels: of pixel centres the error of its
#: quadrature, of means over pixels the error of 3 x 3 rays.
KNOWN = {"centre": 3e-4, "area": 3e-3}

_LIMITS = json.loads(Path(__file__).with_name("calibration.json").read_text(encoding="utf-8"))
#: Least evidence with which a fault is named, and the largest fraction of the error that it may
#: leave where that is no noise. `docs/tools/calibrate_diagnosis.py` chooses both and writes the
#: file.
EVIDENCE, LEFT = float(_LIMITS["evidence"]), float(_LIMITS["left"])


@dataclass(frozen=True)
class Blocks:
    """The pixels of an image that are looked at, in blocks."""

    number: Index  #: of the block of each pixel, (m,)
    count: int  #: of blocks with pixels

    @classmethod
    def of(cls, predictor: Predictor) -> "Blocks":
        """Return the blocks of what is looked at."""
        # Eight pixels a side, as in a comparison (`validation.engine.judge`), but six blocks at
        # least along the shorter side: a few blocks tell no noise from a gradient. Not all pixels
        # are looked at, so that blocks have different numbers of them, or none.
        height, width = predictor.shape
        side = max(1, min(8, min(height, width) // 6))
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
    return max(usual_size(explanation.errors[explanation.lit]), KNOWN[pixel])


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
