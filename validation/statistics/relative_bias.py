# SPDX-License-Identifier: BSD-3-Clause
r"""The relative bias of a whole image, its interval, and how small a bias would have been seen.

For images r +- s_r (the reference) and t +- s_t (the test) with T = sum t and R = sum r let B = T / R - 1. To first
order in the errors dB = (dT - (1 + B) dR) / R, so with independent pixels

    var B = (sum v_t + (1 + B)^2 sum v_r) / R^2,     v = (sum over the channels of a pixel of s)^2.

v is the variance of a sum of fully dependent channels, the largest that there can be (Minkowski's inequality): channels
share their paths, and the interval must not be too narrow for it. It is up to sqrt(channels) too wide if they do not.

**Heavy tails.** The errors of pixels are independent but heavy tailed (P(X > x) ~ x^(-3/2) next to the light), and the
sums are normal only if many pixels of similar weight add up. `largest_share`, the share of one pixel in var B, says how
far that holds; the degrees of freedom of Satterthwaite, (sum v)^2 / sum(v^2 / (K - 1)), fall to K - 1 where one pixel
rules.

**Batches.** If the mean over the image is known for each of K batches, a second interval follows from the spread of
these K numbers alone, with K - 1 degrees of freedom. Each of them is a mean over all pixels, much nearer to the normal
law than the batch means of one pixel, and dependence of pixels or channels is in it as it is. If it is much wider than
the first interval, then pixels are not independent (a filter wider than a pixel, a seed used twice).

**Equivalence.** "Not rejected" is no agreement: few samples reject nothing. `equivalent` says that the whole 95 %
interval lies within +-margin, which is two one-sided tests at 2.5 % each (Schuirmann 1987).

**Detectable bias.** A two-sided test at the 5 % level rejects if |B| > q(0.975) se. With a true bias b it does so with
probability P(B > q(0.975) se) = P((B - b)/se > q(0.975) - b/se), the other tail being negligible: that is 90 % if
b = (q(0.975) + q(0.90)) se, q the quantiles of Student's law; 3.24 se for many degrees of freedom.
`validation.statistics.p_values` has the power for any b, by the non-central law.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from validation.statistics.p_values import satterthwaite, student_quantile, two_sided_p

Array = NDArray[np.float64]
Interval = tuple[float, float]


@dataclass(frozen=True)
class Side:
    """One image of a comparison, made regular; zero in pixels that are left out."""

    mean: Array  #: (height, width, channels)
    error: Array  #: standard error, of the same shape
    batches: int | None = None  #: how many gave the standard errors; None for exact ones
    batch_means: Array | None = None  #: mean over the image of every batch, (batches,)

    def spread(self, variance: Array) -> Array:
        """Return v^2 / (K - 1), which `satterthwaite` wants; zero for exact variances."""
        return variance**2 / (self.batches - 1) if self.batches else np.zeros_like(variance)


@dataclass(frozen=True)
class RelativeBias:
    """The relative bias of a whole image (see the module)."""

    value: float  #: sum(test) / sum(ref) - 1
    interval: Interval  #: 95 %, from the standard errors of the pixels
    interval_batches: Interval | None  #: 95 %, from the batch means
    error: float  #: standard error of the value, from those of the pixels
    freedom: float  #: degrees of freedom of `error`
    p: float  #: two-sided p-value that there is no bias, from `error`; NaN without variance
    reference_share: float  #: of the reference's errors in the variance; NaN without variance
    largest_share: float  #: of one pixel in the variance; NaN without variance
    detectable: float  #: found with 90 % power at the 5 % level, by the wider interval

    def within(self, margin: float) -> bool:
        """Whether every interval lies inside +-margin."""
        both = [self.interval] + ([self.interval_batches] if self.interval_batches else [])
        return all(-margin < low and high < margin for low, high in both)


def relative_bias(reference: Side, test: Side, pixels: int) -> RelativeBias:
    """Pool the error of all pixels into one relative bias; everything is NaN if the reference is not bright.

    Parameters
    ----------
    reference, test
        Two independent images, zero in pixels that are left out.
    pixels
        How many pixels are not left out.
    """
    bright = float(reference.mean.sum())
    if not bright > 0:
        nan = float("nan")
        return RelativeBias(nan, (nan, nan), None, nan, nan, nan, nan, nan, nan)
    # From the difference, not from the ratio: no cancellation for images that nearly agree.
    value = float((test.mean - reference.mean).sum()) / bright
    sides = ((test, 1.0), (reference, (1 + value) ** 2))  # with the weight of its variance
    variance = np.zeros(reference.mean.shape[:2])
    spread = of_reference = 0.0
    for side, weight in sides:
        part = weight * (side.error.sum(axis=2) / bright) ** 2
        variance += part
        spread += float(side.spread(part).sum())
        of_reference = float(part.sum())  # the reference is the last
    total = float(variance.sum())
    freedom = float(satterthwaite(total, spread))
    error = float(np.sqrt(total))
    interval, reach = _interval(value, total, freedom)
    interval_batches, reach_batches = _from_batches(value, sides, bright, pixels)
    p = largest = share = float("nan")
    if total > 0:
        p = float(two_sided_p(np.asarray(value / error), np.asarray(freedom)))
        share, largest = of_reference / total, float(variance.max()) / total
    return RelativeBias(value, interval, interval_batches, error, freedom, p, share, largest, max(reach, reach_batches))


def _from_batches(
    value: float, sides: tuple[tuple[Side, float], ...], bright: float, pixels: int
) -> tuple[Interval | None, float]:
    """Return the interval from the spread of batch means, and the bias it would detect."""
    if all(side.batch_means is None for side, _ in sides):
        return None, 0.0
    total = spread = 0.0
    for side, weight in sides:
        if side.batch_means is None:
            parts = weight * (side.error.sum(axis=2) / bright) ** 2
            total, spread = total + float(parts.sum()), spread + float(side.spread(parts).sum())
        else:
            count = len(side.batch_means)
            values = pixels * side.mean.shape[2]
            part = weight * float(side.batch_means.var(ddof=1)) / count * (values / bright) ** 2
            total, spread = total + part, spread + part**2 / (count - 1)
    return _interval(value, total, float(satterthwaite(total, spread)))


def _interval(value: float, variance: float, freedom: float) -> tuple[Interval, float]:
    """Return the 95 % interval and the detectable bias."""
    error = float(np.sqrt(variance))
    half = student_quantile(0.975, freedom) * error
    return (value - half, value + half), half + student_quantile(0.90, freedom) * error
