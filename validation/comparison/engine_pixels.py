# SPDX-License-Identifier: BSD-3-Clause
"""What a pixel of another renderer's image is: the radiance at its centre, or the mean over its area.

A renderer that filters its samples by a box writes means, one that traces a ray through each centre does not, and few
say which. The two differ where the radiance changes within a pixel: at edges, and beside a lamp, by 10 % and more. Only
these values can tell the one from the other, so only they are looked at. With r the truth of either kind and t the
image, without the faults of the whole that `engine_hints` finds, the error is the mean of

    min(|t - r| / max(r, 0.001 mean(r)), 1)

which no single value decides, and the kind with the smaller error fits.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.quadrature.ray_values import TruthImage
from validation.comparison.engine_hints import Hints, find_hints
from validation.comparison.engine_layers import JudgedLayer, expected_layer
from validation.metrics.errors import FLOOR

Array = NDArray[np.float64]
TruthOf = Callable[[str], TruthImage]  #: returns the truth for 'centre' or 'area'

PIXELS = ("centre", "area")
APART = 0.01  #: by how much the two truths must differ, relative to the larger, for a value to say which fits
EXACT = 1e-3  #: relative error of an image that fits the centres so well that nothing can fit better


@dataclass(frozen=True)
class PixelFit:
    """The truth that an image is judged by."""

    pixel: str  #: 'centre' or 'area'
    truth: TruthImage
    hints: Hints
    centre_error: float | None  #: where the two truths differ; None where they were not compared
    area_error: float | None

    @property
    def words(self) -> str:
        """Which kind fits, and how well, or why that was not asked."""
        kind = "means over the area" if self.pixel == "area" else "centres"
        if self.centre_error is None or self.area_error is None:
            return f"judged by {kind}"
        ours, other = self.centre_error, self.area_error
        if self.pixel == "area":
            ours, other = other, ours
        another = "centres" if self.pixel == "area" else "means over the area"
        return f"{kind} fit: {100 * ours:.3g} % off where the two differ; {another}: {100 * other:.3g} %"


def fit_pixel(image: JudgedLayer, truth_of: TruthOf, pixel: str | None = None) -> PixelFit:
    """Return the truth that fits an image.

    Parameters
    ----------
    truth_of
        Computes a truth; asked for the means only if the image does not fit the centres to `EXACT`.
    pixel
        'centre' or 'area' where it is known; by default what fits.
    """
    if pixel is not None:
        truth = truth_of(pixel)
        return PixelFit(pixel, truth, find_hints(expected_layer(truth, image), image.values), None, None)
    at_centre = truth_of("centre")
    centre = expected_layer(at_centre, image)
    hints = find_hints(centre, image.values)
    if _fits(centre, hints.corrected):
        return PixelFit("centre", at_centre, hints, None, None)
    over_area = truth_of("area")
    area = expected_layer(over_area, image)
    apart = np.abs(area - centre) > APART * np.maximum(area, centre)  # an infinite centre counts
    area_hints = find_hints(area, image.values)
    errors = _error(centre, hints.corrected, apart), _error(area, area_hints.corrected, apart)
    if errors[1] < errors[0]:
        return PixelFit("area", over_area, area_hints, *errors)
    return PixelFit("centre", at_centre, hints, *errors)


def _fits(truth: Array, image: Array) -> bool:
    finite = np.isfinite(truth)
    difference = (image - truth)[finite]
    power = float(np.mean(truth[finite] ** 2)) if finite.any() else 0.0
    return bool(np.isfinite(difference).all() and np.mean(difference**2) <= EXACT**2 * power)


def _error(truth: Array, image: Array, where: NDArray[np.bool_]) -> float:
    """Return the error over some values; an infinite truth is wrong by all of it."""
    finite = np.isfinite(truth)
    floor = FLOOR * float(truth[finite].mean()) if finite.any() else 0.0
    chosen = where & np.isfinite(image)
    if not chosen.any():
        return 0.0
    wanted, got = truth[chosen], image[chosen]
    with np.errstate(invalid="ignore", divide="ignore"):
        relative = np.abs(got - wanted) / np.maximum(wanted, floor)
    return float(np.mean(np.minimum(np.nan_to_num(relative, nan=1.0), 1.0)))
