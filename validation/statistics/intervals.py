# SPDX-License-Identifier: BSD-3-Clause
"""Intervals for what few samples say of all: a share, a quantile, a rank correlation.

A sample is what was drawn independently of the others, such as a scene. What was measured in one scene, by pixels or by
methods, is one sample however many numbers it has.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri
from scipy.stats import binomtest, quantile_test, spearmanr

LEVEL = 0.95  #: with at least this probability an interval holds what it estimates


def binomial_interval(successes: int, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Return the interval of a probability from k successes in n independent trials; of no trial, from 0 to 1.

    Clopper and Pearson's: it holds the probability with at least the level, whatever the probability is. Wilson's
    interval is shorter, and holds it on the average of probabilities alone.
    """
    if trials == 0:
        return 0.0, 1.0
    interval = binomtest(successes, trials).proportion_ci(level, method="exact")
    return float(interval.low), float(interval.high)


def quantile_interval(
    values: ArrayLike, probability: float, level: float = LEVEL
) -> tuple[float, float | None, float | None]:
    """Return a quantile of a sample and its interval, which is free of any law.

    The quantile at p is the least value that at least the share p of the sample does not exceed. The ends of the
    interval are order statistics (David and Nagaraja 2003, *Order Statistics*, section 7.1); None where the sample,
    (n,) with n > 0, is too small for an end. Infinities are values.
    """
    sample = np.asarray(values, dtype=np.float64)
    interval = quantile_test(sample, p=probability).confidence_interval(level)
    low, high = (None if np.isnan(end) else float(end) for end in interval)
    return float(np.quantile(sample, probability, method="inverted_cdf")), low, high


def rank_correlation(x: ArrayLike, y: ArrayLike, level: float = LEVEL) -> tuple[float, float, float]:
    """Return Spearman's rank correlation of two properties of a sample, and its interval.

    Equal values have the mean of their ranks. The interval is that of Fisher's z, atanh(r), with the standard error
    sqrt((1 + r^2/2) / (n - 3)).

    Valid for |correlation| < 0.95 and n >= 10, by the simulations of Bonett and Wright 2000, *Psychometrika* 65, 23-28,
    whose standard error it is. Of fewer than ten samples, and where all of x or of y are equal, r is 0 and the interval
    from -1 to 1: nothing is known.
    """
    count = np.size(x)
    if count < 10 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, -1.0, 1.0
    r = float(spearmanr(x, y).statistic)
    # Of one order for both the formula would be certain: it is taken as if two neighbours had changed places.
    most = 1 - 12 / (count * (count**2 - 1))
    z = np.arctanh(np.clip(r, -most, most))
    half = float(ndtri((1 + level) / 2)) * np.sqrt((1 + r * r / 2) / (count - 3))
    low, high = float(np.tanh(z - half)), float(np.tanh(z + half))
    return float(np.clip(r, -1, 1)), -1.0 if r < -most else low, 1.0 if r > most else high
