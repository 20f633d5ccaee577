# SPDX-License-Identifier: BSD-3-Clause
"""Intervals for what few samples say of all: a share, a quantile, a rank correlation.

A sample is what was drawn independently of the others, such as a scene. What was measured in one scene, by pixels or by
methods, is one sample however many numbers it has.
"""

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import betaincinv, ndtri
from scipy.stats import binom, rankdata

LEVEL = 0.95  #: with at least this probability an interval holds what it estimates


def binomial_interval(successes: int, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Return the interval of a probability from k successes in n independent trials.

    The two ends are the probabilities at which k or more, and k or fewer, successes have a chance of (1 - level)/2:
    quantiles of Beta(k, n - k + 1) and Beta(k + 1, n - k). It holds the probability with at least the level, whatever
    the probability is; Wilson's interval is shorter, and holds it on the average of probabilities alone.

    Parameters
    ----------
    successes
        k, from 0 to n.
    trials
        n; of none nothing is known, from 0 to 1.
    level
        Of confidence [1].

    Raises
    ------
    ValueError
        If k is not from 0 to n.

    References
    ----------
    Clopper and Pearson 1934, *Biometrika* 26, 404-413; as quantiles of the beta law in Brown, Cai and DasGupta 2001,
    *Statistical Science* 16, section 4.2.1.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"got {successes} successes, wanted 0 to {trials}")
    tail = (1 - level) / 2
    low = betaincinv(successes, trials - successes + 1, tail) if successes > 0 else 0.0
    high = betaincinv(successes + 1, trials - successes, 1 - tail) if successes < trials else 1.0
    return float(low), float(high)


def quantile_interval(
    values: ArrayLike, probability: float, level: float = LEVEL
) -> tuple[float, float | None, float | None]:
    """Return a quantile of a sample and its interval, which is free of any law.

    The quantile at p is the least value that at least the share p of the sample does not exceed. The number of values
    below the true one is Binomial(n, p); the ends of the interval are the order statistics whose ranks bound that
    number by (1 - level)/2 on either side (David and Nagaraja 2003, *Order Statistics*, section 7.1).

    Parameters
    ----------
    values
        The sample, (n,) with n > 0, in any unit; infinities are values.
    probability
        p, between 0 and 1.
    level
        Of confidence [1].

    Returns
    -------
    tuple
        The quantile, and the ends of its interval; None where the sample is too small for an end.
    """
    ordered = np.sort(np.asarray(values, dtype=np.float64))
    count, tail = len(ordered), (1 - level) / 2
    # X values do not exceed the quantile. The r-th (from 1) exceeds it where X < r, which at the least r with
    # P(X <= r) >= tail has a chance below the tail. The s-th is below it only where X >= s.
    low = int(binom.ppf(tail, count, probability)) - 1
    high = int(binom.isf(tail, count, probability))
    estimate = ordered[max(0, int(np.ceil(probability * count - 1e-9)) - 1)]
    return (
        float(estimate),
        float(ordered[low]) if low >= 0 else None,
        float(ordered[high]) if high < count else None,
    )


def rank_correlation(x: ArrayLike, y: ArrayLike, level: float = LEVEL) -> tuple[float, float, float]:
    """Return Spearman's rank correlation of two properties of a sample, and its interval.

    Equal values have the mean of their ranks. The interval is that of Fisher's z, atanh(r), with the standard error
    sqrt((1 + r^2/2) / (n - 3)).

    Valid for |correlation| < 0.95 and n >= 10, by the simulations of the reference.

    Parameters
    ----------
    x, y
        Of each sample, (n,), finite, in any units.
    level
        Of confidence [1].

    Returns
    -------
    tuple
        r and the ends of its interval [1]. Of fewer than ten samples, and where all of x or of y are equal, r is 0
        and the interval from -1 to 1: nothing is known.

    References
    ----------
    Bonett and Wright 2000, *Psychometrika* 65, 23-28: their standard error for Spearman's correlation.
    """
    first, second = rankdata(x), rankdata(y)
    count = len(first)
    if count < 10 or np.ptp(first) == 0 or np.ptp(second) == 0:
        return 0.0, -1.0, 1.0
    r = float(np.corrcoef(first, second)[0, 1])
    # Of one order for both the formula would be certain: it is taken as if two neighbours had changed places.
    most = 1 - 12 / (count * (count**2 - 1))
    z = np.arctanh(np.clip(r, -most, most))
    half = float(ndtri((1 + level) / 2)) * np.sqrt((1 + r * r / 2) / (count - 3))
    low, high = float(np.tanh(z - half)), float(np.tanh(z + half))
    return float(np.clip(r, -1, 1)), -1.0 if r < -most else low, 1.0 if r > most else high
