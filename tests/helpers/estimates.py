# SPDX-License-Identifier: BSD-3-Clause
"""Synthetic images with random errors that tests share."""

import numpy as np

from validation.statistics.comparison import Estimate

BATCHES = 16
SIZE = (24, 24)


def normal(rng, shape):
    return rng.normal(1, 0.3, shape)


def monte_carlo(batches):
    """Return the estimate that a renderer would give, from its batch means (batches, height, width, ...)."""
    count = len(batches)
    error = batches.std(axis=0, ddof=1) / np.sqrt(count)
    return Estimate(batches.mean(axis=0), error, count, batches.mean(axis=(1, 2)))
