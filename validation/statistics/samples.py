# SPDX-License-Identifier: BSD-3-Clause
"""Statistics of samples: one or many p-values, intervals of a fraction, a
quantile, a rank correlation.

A sample of an interval is one independent draw, such as a scene. All numbers that were measured in
one scene, by pixels or by methods, are one sample.
"""

import math
from collections.abc import Sequence
from hashlib import sha256
from typing import TypeVar

import numpy as np
import scipy
from numpy.typing import ArrayLike
from scipy.special import ndtri, stdtr, stdtrit

from airlight.validation.arrays import Array
from airlight.validation.statistics.estimate import INTERVAL, Estimate

_Errors = TypeVar("_Errors", float, Array)

LEVEL = 0.95  #: with at least this probability an interval holds what it estimates
#: values of a series of which the mean has an error: of fewer, r says nothing of
#: phi (see `mean_of_series`)
LEAST = 8
#: Why a mean has no error, in words.
UNTOLD_SERIES = (
    f"its error is unknown with fewer than {LEAST} frames, or frames that are all off by the same"
)
# The largest persistence that is assumed: the error of a longer history looks like a bias in 128
# frames.
_MOST = 0.95


def satterthwaite(variance: ArrayLike, spread: ArrayLike) -> Array:
    """Return the degrees of freedom of a sum of variances, each estimated from few batches.

    A variance v from K batch means of normal errors has itself the variance 2 v^2 / (K - 1). A sum
    V of such v has thus the variance 2 sum v^2 / (K - 1), which is that of one with

        nu = V^2 / sum(v^2 / (K - 1))

    degrees of freedom (Satterthwaite 1946, eq. 17; Welch 1947 for two terms).

    `variance` is V and `spread` the sum, 0 for variances that are known exactly, which
    gives an infinite nu [1].
    """
    v, s = np.asarray(variance, dtype=np.float64), np.asarray(spread, dtype=np.float64)
    return np.divide(
        v**2, s, out=np.full(np.broadcast_shapes(v.shape, s.shape), np.inf), where=s > 0
    )


def two_sided_p(z: Array, freedom: Array) -> Array:
    """Return P(|Z| >= |z|) of Student's law; of the normal law where the degrees
    of freedom are infinite.

    `z` and `freedom` have one shape, (n,) [1].
    """
    return np.asarray(2 * stdtr(freedom, -np.abs(z)))


def student_quantile(probability: float, freedom: float) -> float:
    """Return the quantile [1] at a `probability` of Student's law; of the normal law
    for an infinite `freedom`.
    """
    return float(stdtrit(freedom, probability))


def student(values: Array) -> tuple[float, float]:
    """Return the mean of independent values, (n,), and half of its interval of 95 % by Student."""
    error = float(values.std(ddof=1)) / np.sqrt(len(values))
    return float(values.mean()), student_quantile(0.5 + LEVEL / 2, len(values) - 1) * float(error)


def widened(error: _Errors, freedom: _Errors) -> _Errors:
    """Return standard errors times a factor: twice each is then half of Student's interval of 95 %,
    as `Estimate` has them.

    `freedom`: their degrees of freedom [1], of each.
    """
    widened_error: _Errors = error * (stdtrit(freedom, 0.5 + LEVEL / 2) / INTERVAL)
    return widened_error


def first_equal(runs: Sequence[Array]) -> list[int]:
    """Return for each image of several runs the number of the first that
    is the same, bit by bit.
    """
    first: dict[bytes, int] = {}
    return [
        first.setdefault(sha256(run.tobytes()).digest(), number) for number, run in enumerate(runs)
    ]


def mean_of_runs(values: Sequence[float]) -> Estimate:
    """Return the mean of independent values, two or more."""
    middle, half = student(np.asarray(values, dtype=np.float64))
    return Estimate(middle, half / INTERVAL)


def mean_of_series(values: Array) -> Estimate:
    r"""Return the mean of a stationary series, whose values may depend on those before
    them; (n,) in order of time.

    If the correlation of two values falls as phi^k with their distance k (an average in time does
    that), the mean of n of them has the variance of n/f independent ones, and their sample variance
    is too small:

        f = 1 + 2 sum_k (1 - k/n) phi^k,    E s^2 = sigma^2 (n - f)/(n - 1),    var(mean) = sigma^2 f/n

    phi comes from the first autocorrelation r, whose mean is phi - (1 + 4 phi)/n (Kendall 1954),
    and one standard error of it, n^(-1/2), is added: too small a phi does harm, too large a phi
    costs width. It is taken as 0 to `_MOST`. The interval is Student's with n/f - 1 degrees of
    freedom, at least one.

    Of 6000 series each, n from 8 to 128, the intervals of 95 % hold the true mean in 96 to 98 % for
    phi = 0, 93 to 98 % for 0.5 and 0.8, 89 to 99 % for 0.95
    (tests/validation/statistics/test_intervals.py). Independent values pay with an interval wider
    by 1.3 at n = 30, by 1.1 at 128. The error is unknown for fewer than `LEAST` values, which do
    not tell their own dependence, and for a series that never changes: a frozen one looks the same
    as an exact one.
    """
    count, mean = len(values), float(np.mean(values))
    apart = values - mean
    square = float(apart @ apart)
    # Values that differ by less than 1e-12 differ by rounding of float64 alone, of sums of 1e4.
    if count < LEAST or np.abs(apart).max() <= 1e-12 * abs(mean):
        return Estimate(mean)
    # phi = (n r + 1)/(n - 4) makes up for the mean of r; n^(-1/2) is one standard error of it.
    correlation = float(apart[1:] @ apart[:-1]) / square
    persistence = (count * correlation + 1) / (count - 4) + count**-0.5
    distance = np.arange(1, count)
    powers = min(max(persistence, 0.0), _MOST) ** distance
    inflation = 1 + 2 * float((1 - distance / count) @ powers)
    # s^2 = square/(n - 1) and sigma^2 = s^2 (n - 1)/(n - f): the n - 1 cancel.
    variance = square / (count - inflation) * inflation / count
    return Estimate(mean, float(widened(math.sqrt(variance), max(count / inflation - 1, 1.0))))


def sidak(level: float, tests: int) -> float:
    """Return the level [1] of each of m independent `tests` of which none rejects with
    probability 1 - `level`.

    1 - (1 - level)^(1/m) (Sidak 1967), without cancellation for large m.
    """
    return float(-np.expm1(np.log1p(-level) / max(tests, 1)))


def binomial_p(successes: int, trials: int, probability: float) -> float:
    """Return min(1, 2 min(P(X <= k), P(X >= k))) of the binomial law: too few
    count as well as too many.

    X is the number of `successes` k in `trials`, each of a `probability` [1].
    """
    law = scipy.stats.binom(trials, probability)
    lower, upper = law.cdf(successes), law.sf(successes - 1)
    return float(min(1.0, 2 * min(lower, upper)))


def uniformity_p(p: Array) -> float:
    """Return the p-value of Kolmogorov and Smirnov's test that p-values `p`, of shape
    (n,), are uniform in [0, 1].
    """
    return float(scipy.stats.kstest(p, "uniform").pvalue)


def bonferroni(p: Sequence[float]) -> float:
    """Return a p-value [1] for the least of several p-values `p` that may depend on
    one another; NaN for none.
    """
    return min(1.0, len(p) * min(p)) if p else float("nan")


def binomial_interval(successes: int, trials: int, level: float = LEVEL) -> tuple[float, float]:
    """Return the interval of a probability from k successes in n independent trials;
    of no trial, from 0 to 1.

    Clopper and Pearson's: it holds the probability with at least the level, whatever the
    probability is. Wilson's interval is shorter, and holds it on the average of probabilities
    alone.
    """
    if trials == 0:
        return 0.0, 1.0
    interval = scipy.stats.binomtest(successes, trials).proportion_ci(level, method="exact")
    return float(interval.low), float(interval.high)


def quantile_interval(
    values: ArrayLike, probability: float
) -> tuple[float, float | None, float | None]:
    """Return a quantile of a sample and its interval, which is free of any law.

    The quantile at p is the least value that at least the fraction p of the sample does not exceed.
    The ends of the interval are order statistics (David and Nagaraja 2003, *Order Statistics*,
    section 7.1); None where the sample, (n,) with n > 0, is too small for an end. Infinities are
    values.
    """
    sample = np.asarray(values, dtype=np.float64)
    interval = scipy.stats.quantile_test(sample, p=probability).confidence_interval(LEVEL)
    low, high = (None if np.isnan(end) else float(end) for end in interval)
    return float(np.quantile(sample, probability, method="inverted_cdf")), low, high


def rank_correlation(
    x: ArrayLike, y: ArrayLike, level: float = LEVEL
) -> tuple[float, float, float]:
    """Return Spearman's rank correlation of two properties of a sample, and its interval.

    Equal values have the mean of their ranks. The interval is that of Fisher's z, atanh(r), with
    the standard error sqrt((1 + r^2/2) / (n - 3)).

    Valid for |correlation| < 0.95 and n >= 10, by the simulations of Bonett and Wright 2000,
    *Psychometrika* 65, 23-28, whose standard error it is. For fewer than ten samples, and where all
    of x or of y are equal, r is 0 and the interval from -1 to 1: nothing is known.
    """
    count = np.size(x)
    if count < 10 or np.ptp(x) == 0 or np.ptp(y) == 0:
        return 0.0, -1.0, 1.0
    r = float(scipy.stats.spearmanr(x, y).statistic)
    # If both have the same order the formula gives no width: r is taken as if two
    # neighbours had changed places.
    most = 1 - 12 / (count * (count**2 - 1))
    z = np.arctanh(np.clip(r, -most, most))
    half = float(ndtri((1 + level) / 2)) * np.sqrt((1 + r * r / 2) / (count - 3))
    low, high = float(np.tanh(z - half)), float(np.tanh(z + half))
    return float(np.clip(r, -1, 1)), -1.0 if r < -most else low, 1.0 if r > most else high
