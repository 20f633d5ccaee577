# SPDX-License-Identifier: BSD-3-Clause
"""Whether an image of another renderer is right, and where it is not.

The noise of a path tracer is independent from pixel to pixel, and near a lamp its variance is infinite: no bound on the
error of single pixels tells noise from a fault. Means over blocks of pixels do: noise falls as the root of their
number, an error of light, medium or shadow stays. An image is right if the relative error of the block means,

    |sum(t) - sum(r)| / max(sum(r), 0.05 n mean(r))    over the n pixels of a block, channel by channel,

is at most `RIGHT` in the root mean square, the worst hundredth of the blocks left out (that of the lamp), if the best
factor is as close to one, and if nothing is suspected of the image as a whole.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from validation.comparison.engine_hints import OUTLIERS, Hints
from validation.metrics.errors import plain

Array = NDArray[np.float64]

BLOCK = 8  #: side of a block [pixels], less in images of less than ten blocks
RIGHT = 0.01  #: largest relative error of an image that is called right
_DIM = 0.05  # of the mean: a block that is dimmer in both images says nothing
_FEW = 0.01  # share of the pixels that counts as few
_MOST = 0.9  # share of the squared error that is most of it
_BESIDE = 3.0  # pixels from a lamp
_STEP = 1.5  # ratio of neighbours across an edge


@dataclass(frozen=True)
class ErrorPlace:
    """Where most of the squared error of an image lies."""

    pixels: int  #: the fewest that have `share` of it
    share: float
    worst: tuple[int, int]  #: column and row of the pixel with the largest error, from the upper left
    kind: str  #: 'lamp', 'edge' or '' for neither
    relative_rmse_without: float  #: the relative rmse of all other pixels
    few: bool  #: whether they are less than a hundredth of the image

    def to_json(self) -> dict[str, Any]:
        """Return the numbers by name."""
        return plain(self)

    @property
    def words(self) -> str:
        """Return a sentence."""
        if not self.few:
            return f"spread: {100 * self.share:.3g} % of the squared error in {self.pixels} pixels"
        kinds = {"lamp": "beside a lamp", "edge": "at edges of light and shadow"}
        single = self.pixels == 1
        place = f"{kinds[self.kind]}, " if self.kind else ""
        at = "" if single else "the worst "
        return (
            f"{100 * self.share:.3g} % of the squared error in {self.pixels} pixel{'s' * (not single)} ({place}{at}in "
            f"column {self.worst[0]}, row {self.worst[1]}); without {'it' if single else 'them'} the relative rmse is "
            f"{100 * self.relative_rmse_without:.3g} %"
        )


@dataclass(frozen=True)
class Verdict:
    """Whether an image is right."""

    reasons: tuple[str, ...]  #: why it is not; empty if it is
    block: int  #: side of a block [pixels]
    block_error: float  #: relative error of block means; NaN where no block is lit
    block_noise: float  #: what the scatter of the pixels within them explains of it

    @property
    def right(self) -> bool:
        """Whether the image is right."""
        return not self.reasons

    def to_json(self) -> dict[str, Any]:
        """Return the numbers by name."""
        return {"right": self.right, **plain(self)}

    @property
    def words(self) -> str:
        """Return a sentence."""
        if self.reasons:
            return f"not right: {'; '.join(self.reasons)}"
        size = "single pixels" if self.block == 1 else f"means over {self.block} x {self.block} pixels"
        return f"right: {size} are within {100 * self.block_error:.2g} % (noise {100 * self.block_noise:.2g} %)"


def error_place(truth: Array, image: Array, light_pixels: Array) -> ErrorPlace | None:
    """Return where most of the squared error lies; None where there is no error.

    Parameters
    ----------
    truth, image
        Radiance, (height, width, 3) [W/(m^2 sr)].
    light_pixels
        How far a lamp is, (height, width) [pixels].
    """
    difference = np.where(np.isfinite(truth) & np.isfinite(image), image - truth, 0.0)
    squared = (difference**2).sum(axis=2)
    total = float(squared.sum())
    if total == 0:
        return None
    order = np.argsort(squared, axis=None)[::-1]
    below = np.cumsum(squared.reshape(-1)[order]) / total
    count = min(int(np.searchsorted(below, _MOST)) + 1, squared.size)
    chosen = np.zeros(squared.size, dtype=bool)
    chosen[order[:count]] = True
    rest = squared.reshape(-1)[~chosen]
    mean = float(truth[np.isfinite(truth)].mean())
    chosen = chosen.reshape(squared.shape)
    row, column = divmod(int(order[0]), squared.shape[1])
    lamp, edge = (light_pixels[chosen] < _BESIDE).mean() > 0.5, _at_edges(truth)[chosen].mean() > 0.5
    kind = "lamp" if lamp else "edge" if edge else ""
    left = math.sqrt(float(rest.mean()) / truth.shape[2]) / mean if len(rest) and mean > 0 else 0.0
    return ErrorPlace(count, float(below[count - 1]), (column, row), kind, left, count <= max(1, _FEW * squared.size))


def judge(truth: Array, image: Array, hints: Hints, failures: Sequence[str]) -> Verdict:
    """Decide whether an image is right.

    Parameters
    ----------
    truth, image
        Radiance, (height, width, 3) [W/(m^2 sr)].
    hints
        What is suspected of the image as a whole.
    failures
        Why it must be called wrong anyway: values that are not finite, or negative.
    """
    side = min(BLOCK, max(1, min(truth.shape[:2]) // 10))
    error, noise = _block_errors(truth, image, side)
    reasons = [*failures, *hints.words, *([hints.reason] if hints.reason else [])]
    if not reasons and abs(hints.factor - 1) > RIGHT:
        reasons.append(f"the best factor is {hints.factor:.4g}")
    if not reasons and math.isnan(error):
        reasons.append("nothing is lit in the pixels that are compared")
    if error > RIGHT:
        size = "single pixels" if side == 1 else f"means over {side} x {side} pixels"
        most = ", most of it noise: render more samples" if noise > error / math.sqrt(2) else ""
        reasons.append(f"{size} are {100 * error:.3g} % off{most}")
    return Verdict(tuple(reasons), side, error, noise)


def _block_errors(truth: Array, image: Array, side: int) -> tuple[float, float]:
    """Return the relative error of the means of lit blocks, and the share of it that noise explains."""
    finite = np.isfinite(truth) & np.isfinite(image)
    wanted, got = np.where(finite, truth, 0.0), np.where(finite, image, 0.0)
    difference = got - wanted
    count, light, seen, offset, square = (
        _block_sums(values, side) for values in (finite.astype(float), wanted, got, difference, difference**2)
    )
    floor = _DIM * float(wanted.mean())
    lit = (count > 0) & (np.maximum(light, seen) > floor * count)
    if not lit.any():
        return math.nan, math.nan
    scale = np.maximum(light, floor * count)[lit]
    error = np.abs(offset[lit]) / scale
    scatter = np.maximum(square - offset**2 / np.maximum(count, 1), 0.0)[lit]
    kept = np.argsort(error)[: len(error) - int(OUTLIERS * len(error))]  # of few blocks none may be wrong
    return math.sqrt(float(np.mean(error[kept] ** 2))), math.sqrt(float(np.mean((scatter / scale**2)[kept])))


def _block_sums(values: Array, side: int) -> Array:
    """Return the sums over square blocks, those at the ends smaller, channel by channel."""
    rows, columns = (np.arange(0, length, side) for length in values.shape[:2])
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)


def _at_edges(truth: Array) -> NDArray[np.bool_]:
    """Return where a pixel or one beside it is much brighter than another of these."""
    light = np.pad(np.where(np.isfinite(truth), truth, 0.0).sum(axis=2), 1, mode="edge")
    around = np.lib.stride_tricks.sliding_window_view(light, (3, 3))
    return np.asarray(around.max(axis=(2, 3)) > _STEP * around.min(axis=(2, 3)), dtype=np.bool_)
