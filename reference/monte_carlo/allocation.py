# SPDX-License-Identifier: BSD-3-Clause
r"""Where the samples of a path tracer go: more to the pixels whose radiance spreads more.

A pooled bias compares sums over all pixels. With n_p samples of standard deviation s_p in pixel p its variance is

    sum_p s_p^2 / n_p,    for a given sum of n_p least where n_p is proportional to s_p:    (sum_p s_p)^2 / sum_p n_p

(Neyman 1934; Cochran 1977, *Sampling Techniques*, eq. 5.26). In fog a few pixels hold nearly all of the variance, those
that look at or past what is next to a light: equal numbers would spend most samples on the others.

The s_p come from a pilot run of which nothing else is used. Samples that decide where more of them go must not be
counted themselves: pixels that came out dark by chance would get few more, and the mean would be too small. A quarter
of the samples is shared out equally, so that a pixel whose pilot met nothing at all has at most four times the variance
that it would have had.
"""

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.batches import LAYERS, Batches

EQUAL = 0.25  #: fraction of the samples that is the same for every pixel


def allocated(
    pilot: Batches, samples: int, *, shape: tuple[int, int], masks: dict[str, NDArray[np.bool_]]
) -> NDArray[np.uint32]:
    """Return how many samples each pixel gets.

    `pilot`: batches of the same estimator with other seeds, two at least; `samples`: samples a pixel, on the average;
    `shape`: height and width of the image; `masks`: by layer the pixels that are compared, (height, width); the others
    get the equal share alone. Returns samples of every pixel [1], (layers, pixels), at least 1; their mean is `samples`
    up to rounding.
    """
    counts = []
    for number, layer in enumerate(LAYERS):
        variance = (pilot.standard_error[number] ** 2).sum(axis=1).reshape(shape)
        spread = np.where(masks[layer], np.sqrt(_neighbourhood(variance)), 0)
        mean = spread.mean()
        fraction = spread / mean if mean > 0 else np.ones(shape)
        counts.append(np.maximum(1, np.rint(samples * (EQUAL + (1 - EQUAL) * fraction))))
    return np.stack(counts).reshape(len(LAYERS), -1).astype(np.uint32)


def _neighbourhood(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the mean over 3 x 3 pixels: the spread of a few batches is noisy, and neighbours are alike."""
    padded = np.pad(values, 1, mode="edge")
    height, width = values.shape
    shifted = [padded[row : row + height, column : column + width] for row in range(3) for column in range(3)]
    return np.mean(shifted, axis=0)
