# SPDX-License-Identifier: BSD-3-Clause
"""In which order the reference of an image is computed, and what is known of it on the way.

Pixels of a coarse grid come first, then those of grids of half its step. Within a grid the order is random, so that
what is known is a fair sample of the image at any time, and the picture of it grows sharper.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.metrics.errors import error_metrics

Array = NDArray[np.float64]
STEPS = (16, 8, 4, 2, 1)


def pixel_order(width: int, height: int) -> NDArray[np.int64]:
    """Return the numbers of all pixels in their order, (pixels,)."""
    row, column = np.divmod(np.arange(width * height), width)
    level = np.full(width * height, len(STEPS) - 1)
    for number, step in reversed(list(enumerate(STEPS))):
        level[(row % step == 0) & (column % step == 0)] = number
    return np.lexsort([np.random.default_rng(0).random(width * height), level])


@dataclass(frozen=True)
class KnownReference:
    """What is known of the reference of an image; what is not is NaN."""

    airlight: Array  #: (height, width, 3) [W/(m^2 sr)]
    surface: Array  #: [W/(m^2 sr)]
    bound: Array  #: of the error of the airlight; with area lights, and twice its standard error [W/(m^2 sr)]

    @staticmethod
    def of_size(width: int, height: int) -> "KnownReference":
        """Return what is known before there is anything."""
        return KnownReference(*(np.full((height, width, 3), np.nan) for _ in range(3)))

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which pixels are known, (height, width)."""
        return np.isfinite(self.airlight[..., 0])

    def add(self, pixels: NDArray[np.int64], airlight: Array, surface: Array, bound: Array) -> None:
        """Note the reference of some pixels, (pixels, 3) each."""
        for layer, values in ((self.airlight, airlight), (self.surface, surface), (self.bound, bound)):
            layer.reshape(-1, 3)[pixels] = values

    def filled(self, layer: Array) -> Array:
        """Return a layer of the reference, or of a frame; pixels that are not known take a near one that is."""
        known = self.known
        step = next((step for step in reversed(STEPS) if known[::step, ::step].all()), None)
        if step is None:
            return np.where(known[..., None], layer, 0)
        rows, columns = (np.arange(size) // step * step for size in known.shape)
        return np.where(known[..., None], layer, layer[np.ix_(rows, columns)])


@dataclass(frozen=True)
class ViewError:
    """The error of the airlight of a frame against what is known of its reference, over the mean of that."""

    relative_rmse: float | None
    interval: float | None  #: half of the 95 % interval of that, for the pixels that are not known yet
    relative_bias: float | None
    p99: float | None  #: see `validation.metrics.errors`
    bound: float | None  #: root mean square of the reference's own bound: the most by which it changes the error
    known: int  #: pixels
    pixels: int


def view_error(found: KnownReference, airlight: Array) -> ViewError | None:
    """Return the error of the airlight of a frame, (height, width, 3) [W/(m^2 sr)]; None if nothing is known."""
    known = found.known
    count, pixels = int(known.sum()), known.size
    if count == 0:
        return None
    reference, test = found.airlight[known], np.asarray(airlight, dtype=np.float64)[known]
    metrics = error_metrics(reference[None], test[None])
    mean = float(reference.mean())
    square = np.mean((test - reference) ** 2, axis=1)
    spread = float(square.std()) / np.sqrt(count) * np.sqrt(1 - count / pixels)
    rmse = float(np.sqrt(square.mean()))
    interval = 1.96 * spread / (2 * rmse) if rmse > 0 else 0.0
    bound = float(np.sqrt(np.mean(found.bound[known] ** 2)))
    return ViewError(
        metrics.relative_rmse,
        interval / mean if mean > 0 else None,
        metrics.relative_bias,
        metrics.p99,
        bound / mean if mean > 0 else None,
        count,
        pixels,
    )


def motion_error(errors: Sequence[ViewError]) -> tuple[float, float]:
    """Return the root mean square of the errors of frames, and half of its 95 % interval for the pixels left out."""
    rmse, halves = (np.array([getattr(each, name) for each in errors]) for name in ("relative_rmse", "interval"))
    mean = float(np.sqrt(np.mean(rmse**2)))
    return mean, float(np.linalg.norm(rmse * halves)) / (len(errors) * mean) if mean > 0 else 0.0
