# SPDX-License-Identifier: BSD-3-Clause
"""Whether an image is right, from the reference of its scene.

The noise of a path tracer is independent from pixel to pixel, and near a light its
variance is infinite: no bound on the error of single pixels tells noise from a fault. Means over
blocks of pixels do: noise falls as the root of their number, an error of light, medium or shadow
stays. An image is right if the relative error of the block means,

    |sum(t) - sum(r)| / max(sum(r), 0.05 n mean(r))    over the n pixels of a block, by channel,

is at most `RIGHT` in the root mean square without the worst hundredth of the blocks, which are
beside the light; if the best factor is as close to one; and if nothing is suspected of the image as
a whole.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from airlight.validation.arrays import Array, Bools
from airlight.validation.engine.hints import OUTLIERS, Hints, find_hints
from airlight.validation.engine.observation import relative_errors
from airlight.validation.metrics.errors import FLOOR
from airlight.validation.statistics.comparison import block_side, block_sums

RIGHT = 0.01  #: largest relative error of an image that is called right


@dataclass(frozen=True)
class Verdict:
    """Whether an image is right."""

    right: bool
    reasons: tuple[str, ...]  #: why it is not; empty if it is
    block: int  #: side of a block [pixels]
    block_error: float  #: relative error of block means; NaN where no block is lit
    #: the relative error of block means that scatter of pixels alone makes; NaN where single pixels
    #: are blocks, whose scatter nobody sees
    block_noise: float

    @property
    def noise_alone(self) -> bool:
        """Whether the scatter within blocks explains the error of their means, and
        nothing else is in the way.
        """
        return len(self.reasons) <= 1 and self.block_noise > self.block_error / math.sqrt(2)

    @property
    def words(self) -> str:
        """Return a sentence."""
        if not self.right:
            return f"not right: {'; '.join(self.reasons)}"
        size = (
            "single pixels" if self.block == 1 else f"means over {self.block} x {self.block} pixels"
        )
        within = f"right: {size} are within {100 * self.block_error:.2g} %"
        if math.isnan(self.block_noise):
            return within
        scatter = f"the scatter of single pixels alone makes {100 * self.block_noise:.2g} %"
        return f"{within} ({scatter})"


def judge(reference: Array, image: Array, hints: Hints, failures: Sequence[str]) -> Verdict:
    """Decide whether an image is right.

    `reference`, `image`: radiance, (height, width, 3) [W/(m^2 sr)]; `hints`: what is suspected of
    the image as a whole; `failures`: why it must be called wrong anyway: values that are not
    finite, or negative.
    """
    side = block_side(*reference.shape[:2])
    error, noise = block_errors(reference, image, side)
    reasons = [*failures, *hints.words, *([hints.reason] if hints.reason else [])]
    # A factor other than one, or an image without light, counts only where nothing else is wrong.
    if not reasons and abs(hints.factor - 1) > RIGHT:
        reasons.append(f"the best factor is {hints.factor:.4g}")
    if not reasons and math.isnan(error):
        reasons.append("nothing is lit in the pixels that are compared")
    # Light where the reference has none is wrong by no number.
    if not reasons and math.isinf(error):
        reasons.append("the reference is black")
    if RIGHT < error < math.inf:
        size = "single pixels" if side == 1 else f"means over {side} x {side} pixels"
        scatter = ", most of it scatter of single pixels: render more samples, or march more steps"
        most = scatter if noise > error / math.sqrt(2) else ""
        reasons.append(f"{size} are {100 * error:.3g} % off{most}")
    return Verdict(not reasons, tuple(reasons), side, error, noise)


def all_but_few(reference: Array, image: Array, mask: Bools | None = None) -> str:
    """Say which pixels are wrong where these are few and all others are right;
    nothing where that is not so.

    `reference`, `image`: radiance, (height, width, 3) [W/(m^2 sr)]; `mask`: which pixels were
    compared, (height, width); all by default.
    """
    chosen = np.ones(reference.shape[:2], dtype=bool) if mask is None else mask
    finite = np.isfinite(reference) & chosen[..., None]
    floor = FLOOR * float(reference[finite].mean()) if finite.any() else 0.0
    errors = np.abs(relative_errors(reference, image, floor)).max(axis=2)
    # Six median errors: noise of a normal distribution is beyond in 5 pixels of 100 000.
    wrong = chosen & (errors > max(RIGHT, 6.0 * float(np.median(errors[chosen]))))
    count = np.count_nonzero(chosen)
    # A tenth of the pixels may be a mark on the image, or a hole in it; more are another image.
    if not 0 < np.count_nonzero(wrong) <= 0.1 * count:
        return ""
    # All others must be right by the same verdict.
    others = np.where((chosen & ~wrong)[..., None], image, np.nan)
    if not judge(reference, others, find_hints(reference, others), ()).right:
        return ""
    row, column = np.nonzero(wrong)
    return (
        f"all is right but {len(row)} of {count} pixels, in columns {column.min()} to "
        f"{column.max()} and rows "
        f"{row.min()} to {row.max()} from the upper left"
    )


def block_errors(reference: Array, image: Array, side: int) -> tuple[float, float]:
    """Return the relative error of the means of lit blocks, and the error that
    the scatter of pixels within them alone would make; NaN for single pixels.
    """
    # Sums over blocks, of each channel: pixels that count, light of the reference, light of the
    # image, and their difference and its square.
    finite = np.isfinite(reference) & np.isfinite(image)
    correct, test = np.where(finite, reference, 0.0), np.where(finite, image, 0.0)
    difference = test - correct
    count, light, test_light, offset, square = (
        block_sums(values, side)
        for values in (finite.astype(float), correct, test, difference, difference**2)
    )
    # A block that is dimmer in both images than 5 % of the mean says nothing.
    floor = 0.05 * float(correct[finite].mean()) if finite.any() else 0.0
    lit = (count > 0) & (np.maximum(light, test_light) > floor * count)
    if not lit.any():
        return math.nan, math.nan
    # Light where the reference has none at all is wrong by any factor, and that is no noise.
    if floor == 0:
        return math.inf, 0.0
    scale = np.maximum(light, floor * count)[lit]
    error = np.abs(offset[lit]) / scale
    # Noise that is independent from pixel to pixel gives the sum of a block the variance
    # (sum(d^2) - sum(d)^2/n) n/(n - 1).
    scatter = np.maximum(square - offset**2 / np.maximum(count, 1), 0.0)
    scatter = (scatter * count / np.maximum(count - 1, 1))[lit]
    # Without the worst hundredth of the blocks; of less than a hundred, none may be wrong.
    best = np.argsort(error)[: len(error) - int(OUTLIERS * len(error))]
    noise = math.nan if side == 1 else math.sqrt(float(np.mean((scatter / scale**2)[best])))
    return math.sqrt(float(np.mean(error[best] ** 2))), noise
