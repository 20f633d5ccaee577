# SPDX-License-Identifier: BSD-3-Clause
"""p-values, and what to do with many of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtr, ndtri, stdtr, stdtrit
from scipy.stats import binom, kstest

Array = NDArray[np.float64]


def satterthwaite(variance: ArrayLike, spread: ArrayLike) -> Array:
    """Return the degrees of freedom of a sum of variances, each estimated from few batches.

    A variance v from K batch means of normal errors has itself the variance 2 v^2 / (K - 1). A sum V of such v has thus
    the variance 2 sum v^2 / (K - 1), which is that of one with

        nu = V^2 / sum(v^2 / (K - 1))

    degrees of freedom (Satterthwaite 1946, eq. 17; Welch 1947 for two terms).

    `variance` is V and `spread` the sum, 0 for variances that are known exactly, which gives an infinite nu [1].
    """
    v, s = np.asarray(variance, dtype=np.float64), np.asarray(spread, dtype=np.float64)
    return np.divide(v**2, s, out=np.full(np.broadcast_shapes(v.shape, s.shape), np.inf), where=s > 0)


def two_sided_p(z: Array, freedom: Array) -> Array:
    """Return P(|Z| >= |z|) of Student's law; of the normal law where the degrees of freedom are infinite.

    `z` and `freedom` have one shape, (n,) [1].
    """
    tail = -np.abs(z)
    finite = np.isfinite(freedom)
    return 2 * np.where(finite, stdtr(np.where(finite, freedom, 1.0), tail), ndtr(tail))


def student_quantile(probability: float, freedom: float) -> float:
    """Return the quantile [1] at a `probability` of Student's law; of the normal law for an infinite `freedom`."""
    return float(stdtrit(freedom, probability) if np.isfinite(freedom) else ndtri(probability))


def sidak(level: float, tests: int) -> float:
    """Return the level [1] of each of m independent `tests` of which none rejects with probability 1 - `level`.

    1 - (1 - level)^(1/m) (Sidak 1967), without cancellation for large m.
    """
    return float(-np.expm1(np.log1p(-level) / max(tests, 1)))


def binomial_p(successes: int, trials: int, probability: float) -> float:
    """Return min(1, 2 min(P(X <= k), P(X >= k))) of the binomial law: too few count as well as too many.

    X is the number of `successes` k in `trials`, each of a `probability` [1].
    """
    lower, upper = binom.cdf(successes, trials, probability), binom.sf(successes - 1, trials, probability)
    return float(min(1.0, 2 * min(lower, upper)))


def uniformity_p(p: Array) -> float:
    """Return the p-value of Kolmogorov and Smirnov's test that p-values `p`, of shape (n,), are uniform in [0, 1]."""
    return float(kstest(p, "uniform").pvalue)


def bonferroni(p: Sequence[float]) -> float:
    """Return a p-value [1] for the least of several p-values `p` that may depend on one another; NaN for none."""
    return min(1.0, len(p) * min(p)) if p else float("nan")
