# SPDX-License-Identifier: BSD-3-Clause
"""Batches of a Monte Carlo estimator: their means and the spread between them, in float64.

An estimator traces one batch at a time, each with a seed of its own. The standard error of the mean follows from the
spread of the batch means, so nothing needs to be known of the law of a single sample.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAYERS = ("airlight", "surface")
LARGEST_BATCH = 256  #: samples a pixel: float32 sums of more lose digits (DESIGN section 6.2)


@dataclass(frozen=True)
class Batches:
    """Running sums of the batch means; `merged` adds batches up in any order."""

    seeds: tuple[int, ...]
    samples: int  #: samples a pixel in each batch
    mean: Array  #: mean of the batch means, (layers, pixels, 3)
    squares: Array  #: sum of squared deviations from the mean, (layers, pixels, 3)
    totals: Array  #: image means of every batch, (batches, layers, 3)

    @property
    def standard_error(self) -> Array:
        """Standard error of `mean`, (layers, pixels, 3)."""
        count = len(self.seeds)
        return np.sqrt(self.squares / (count * (count - 1)))


def merged(one: Batches, other: Batches) -> Batches:
    """Add up two sets of batches (Chan, Golub and LeVeque's update of mean and sum of squares)."""
    if one.samples != other.samples or set(one.seeds) & set(other.seeds):
        raise ValueError("batches to merge need the same samples a pixel and different seeds")
    n, m = len(one.seeds), len(other.seeds)
    difference = other.mean - one.mean
    return Batches(
        one.seeds + other.seeds,
        one.samples,
        one.mean + difference * (m / (n + m)),
        one.squares + other.squares + difference**2 * (n * m / (n + m)),
        np.concatenate([one.totals, other.totals]),
    )
