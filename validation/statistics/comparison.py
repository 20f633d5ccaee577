# SPDX-License-Identifier: BSD-3-Clause
r"""Does an image with random errors agree with another one, and how small a
disagreement would have been seen?

Each of the two images has a mean per value (a value is one channel of one pixel) and may have a
standard error: with r +- s_r the reference, t +- s_t the test, d = t - r and s^2 = s_r^2 + s_t^2.
Both variances are used, and none is raised to a floor: a dim image is tested as sharply as a bright
one. The two images must be independent, and so must be the errors of two pixels of one image (box
filter, seeds of their own), but for what an image says that they share; channels of a pixel may
depend on one another.

**Values.** z = d / s follows Student's law if the errors are normal and the standard errors come
from K batch means. For two random images the degrees of freedom are Welch and Satterthwaite's,
s^4 / (s_r^4/(K_r - 1) + s_t^4/(K_t - 1)); the normal law holds if no K is given. P(|Z| >= |z|) is
the p-value, uniform in [0, 1] if the images agree.

**Rejected pixels.** The smallest of m independent p-values is below a with probability 1 - (1 -
a)^m. Sidak's level a = 1 - (1 - A)^(1/m) makes that A (`LEVEL`): one false alarm in 1/A comparisons
of images, however many pixels they have. The expected number of rejections is m a, about A. That
finds an outlier, but hardly a bias of all pixels.

**Exceedances.** n independent p-values are below a plain level a Binomial(n, a) times. More mean a
bias or standard errors too small, fewer mean standard errors too large: hence both tails, p = 2
min(P(X <= k), P(X >= k)). Channels are not independent, so each has its own test, and the least p
is multiplied by their number (Bonferroni). Likewise Kolmogorov and Smirnov's test of the p-values
against the uniform law.

**Blocks.** sum d / sqrt(sum s^2) over the 8 x 8 pixels of a block, one channel: it shows a bias of
local extent up to eight times as well as one pixel.

**The image.** One relative bias with its 95 % interval, equivalence and detectable bias: see below.
A bias that all pixels share shows here first: with 262 144 pixels 512 times better than in any one
of them.

Values without variance (s = 0: a pixel without light, one that no path reached, a reference without
noise) have no z. They are counted and compared in absolute terms, and they do enter the relative
bias. The same holds for values where the reference is zero, which have no relative error: light
where none should be shows there. Pixels that a mask leaves out (the light in their footprint) are
counted, for a mask can hide what it should not.

The relative bias of a whole image
----------------------------------
With T = sum t and R = sum r let B = T / R - 1. To first
order in the errors dB = (dT - (1 + B) dR) / R, so with independent pixels

    var B = (sum v_t + (1 + B)^2 sum v_r) / R^2,     v = (sum over the channels of a pixel of s)^2.

v is the variance of a sum of fully dependent channels, the largest that there can be (Minkowski's
inequality): channels share their paths, and the interval must not be too narrow for it. It is up to
sqrt(channels) too wide if they do not.

Where all pixels have the same samples, as of a sky, the variance of a sum is that of the error that
they share, (`shared` times the sum of s)^2, if that is the larger one: of the image, and of each
block.

**Heavy tails.** The errors of pixels are independent but heavy tailed (P(X > x) ~ x^(-3/2) next to
the light), and the sums are normal only if many pixels of similar weight add up.
`largest_fraction`, that of one pixel in var B, says how far that holds; the degrees of freedom of
Satterthwaite, (sum v)^2 / sum(v^2 / (K - 1)), fall to K - 1 where one pixel rules.

**Batches.** If the mean over the image is known for each of K batches, a second interval follows
from the spread of these K numbers alone, with K - 1 degrees of freedom. Each of them is a mean over
all pixels, much nearer to the normal law than the batch means of one pixel, and dependence of
pixels or channels is in it as it is. If it is much wider than the first interval, then pixels are
not independent (a filter wider than a pixel, a seed used twice).

**Equivalence.** "Not rejected" is no agreement: few samples reject nothing. `equivalent` says that
the whole 95 % interval lies within +-margin, which is two one-sided tests at 2.5 % each (Schuirmann
1987).

**Detectable bias.** A two-sided test at the 5 % level rejects if |B| > q(0.975) se. With a true
bias b it does so with probability P(B > q(0.975) se) = P((B - b)/se > q(0.975) - b/se), the other
tail being negligible: that is 90 % if b = (q(0.975) + q(0.90)) se, q the quantiles of Student's
law; 3.24 se for many degrees of freedom.
"""

import math
from dataclasses import asdict, dataclass, replace

import numpy as np
from numpy.typing import ArrayLike

from airlight.errors import InputError
from airlight.validation.arrays import Array, Bools
from airlight.validation.columns import record_of
from airlight.validation.metrics.errors import compared
from airlight.validation.statistics.records import Statistics
from airlight.validation.statistics.samples import (
    binomial_p,
    bonferroni,
    satterthwaite,
    sidak,
    student_quantile,
    two_sided_p,
    uniformity_p,
)

BLOCK = 8  #: side of a block [pixels]
#: The probability with which a comparison of images that agree rejects any pixel, and any block;
#: values whose p-value is below it are counted.
LEVEL = 0.01


@dataclass(frozen=True)
class NoisyImage:
    """One side of a comparison: an image with its noise, (height, width) or
    (height, width, channels).
    """

    mean: ArrayLike  #: radiance [W/(m^2 sr)]
    #: of `mean`, of the same shape; None for an image without random error
    standard_error: ArrayLike | None = None
    #: independent ones, whose means gave the standard error; None for one as good as exact
    batches: int | None = None
    #: over the pixels compared, of every batch, (batches,) or (batches, channels)
    batch_means: ArrayLike | None = None
    #: standard error of the mean over the mean of `standard_error`: 0 where pixels are independent,
    #: about 1 where all have one error
    shared: float = 0.0


@dataclass(frozen=True)
class _Side:
    """An estimate, made regular; zero in pixels that are left out."""

    mean: Array  #: (height, width, channels)
    error: Array  #: standard error, of the same shape
    batches: int | None = None  #: how many gave the standard errors; None for exact ones
    batch_means: Array | None = None  #: mean over the image of every batch, (batches,)
    shared: float = 0.0  #: as of `NoisyImage`

    def of_image(self, scale: float) -> tuple[float, float]:
        """Return the variance of the sum over the image, times a scale squared, and its spread."""
        parts = (scale * self.error.sum(axis=2)) ** 2
        together = (scale * self.shared * float(self.error.sum())) ** 2
        if together > parts.sum():
            return together, float(self.spread(np.asarray(together)))
        return float(parts.sum()), float(self.spread(parts).sum())

    def of_blocks(self) -> tuple[Array, Array]:
        """Return the variance of the sum over each block, and its spread."""
        squares, together = self.error**2, (self.shared * block_sums(self.error)) ** 2
        apart, spread = block_sums(squares), block_sums(self.spread(squares))
        shares = together > apart
        return np.where(shares, together, apart), np.where(shares, self.spread(together), spread)

    def spread(self, variance: Array) -> Array:
        """Return v^2 / (K - 1), which `satterthwaite` asks for; zero for exact variances."""
        return variance**2 / (self.batches - 1) if self.batches else np.zeros_like(variance)


def compare_statistics(
    reference: NoisyImage,
    test: NoisyImage,
    *,
    mask: ArrayLike | None = None,
    margin: float | None = None,
    stated: float = 0.0,
) -> Statistics:
    """Test two images against each other (derivations: see the module).

    Valid for pixels whose beam keeps away from the light: where it holds the light the variance is
    infinite and no test means anything (the 95 % interval of Pareto's law with exponent 3/2 holds
    the true value in 80 % of cases), so mask them. Skewed estimates need many batches: with 32,
    each one log-normal number of logarithmic deviation 1, 6 % of values exceed the 1 % level, as a
    batch without a rare large value is too low and looks too sure at once. `exceeding_p` and
    `uniformity_p` show it; the interval of the image keeps its 95 %
    (tests/validation/statistics/test_rates.py).

    At least one of two independent estimates has a standard error. Pixels that the mask leaves out,
    (height, width) of truth values, or that are not finite in either mean are not compared:
    `error_metrics` counts the latter, and batch means, which would not be of these pixels, are then
    ignored. A relative bias up to the `margin` [1] counts as agreement, such as 0.005. The relative
    bias may have an error of up to `stated` [1] that is no noise: agreement allows for it on
    both sides of each interval.
    """
    check_margin(margin)
    ref, tst, asked = compared(reference.mean, test.mean, mask)
    if reference.standard_error is None and test.standard_error is None:
        raise InputError(
            "neither image has a standard error; give one, or compare them by their metrics alone"
        )
    chosen = asked & (np.isfinite(ref) & np.isfinite(tst)).all(axis=2)
    whole = bool((chosen == asked).all())
    # Free of units from here on. A power of two leaves every digit as it is; squares stay in range.
    largest = max(float(np.abs(image[chosen]).max(initial=0.0)) for image in (ref, tst))
    scale = float(2.0 ** np.frexp(largest)[1]) if largest > 0 else 1.0
    expected = _side("reference", reference, chosen, scale=scale, with_batches=whole)
    tested = _side("test", test, chosen, scale=scale, with_batches=whole)
    # The images agree within a margin if every interval of the bias lies inside it.
    bias = _relative_bias(expected, tested, int(chosen.sum()))
    intervals = [bias.relative_bias_ci, bias.relative_bias_ci_batches or bias.relative_bias_ci]
    values = {
        "masked": (~asked).sum(),
        **_value_tests(expected, tested, chosen),
        **_block_tests(expected, tested),
        **asdict(bias),
        "margin": margin,
        "equivalent": None
        if margin is None
        else all(stated - margin < low and high < margin - stated for low, high in intervals),
    }
    return record_of(values, Statistics)


def check_margin(margin: float | None) -> None:
    """Refuse a margin that nothing can lie in."""
    if margin is not None and not 0 < margin < np.inf:
        raise InputError(f"margin: got {margin}, expected a relative bias above 0, such as 0.005")


def _value_tests(expected: _Side, tested: _Side, chosen: Bools) -> dict[str, float]:
    """Test every value by itself."""
    difference, error = tested.mean - expected.mean, np.hypot(expected.error, tested.error)
    # Values with an error have a z, and a p-value with the degrees of freedom of the error.
    random = chosen[:, :, None] & (error > 0)
    fixed = chosen[:, :, None] & ~random
    z = difference[random] / error[random]
    spread = expected.spread(expected.error**2) + tested.spread(tested.error**2)
    p = two_sided_p(z, satterthwaite(error**2, spread)[random])
    # Channels of a pixel may depend on one another: each has its own tests of all p-values.
    channel = np.nonzero(random)[2]
    by_channel = [p[channel == c] for c in np.unique(channel)]
    # A pixel is rejected if one of its values is too unlikely among all.
    small = np.zeros(random.shape, dtype=bool)
    small[random] = p < sidak(LEVEL, z.size)
    # Without a reference, or without an error, differences are compared with the mean alone.
    dark = chosen[:, :, None] & (expected.mean == 0)
    mean = float(expected.mean[chosen].mean()) if chosen.any() else 0.0
    return {
        "tested": z.size,
        "zero_reference": int(dark.sum()),
        "zero_reference_error": _largest(difference[dark], mean),
        "zero_variance": int(fixed.sum()),
        "zero_variance_error": _largest(difference[fixed], mean),
        "z_mean": float(z.mean()) if z.size else float("nan"),
        "z_std": float(z.std(ddof=1)) if z.size > 1 else float("nan"),
        "rejected": int(small.any(axis=2).sum()),
        "expected_rejections": z.size * sidak(LEVEL, z.size),
        "exceeding": int((p < LEVEL).sum()),
        "expected_exceeding": z.size * LEVEL,
        "exceeding_p": bonferroni(
            [binomial_p(int((q < LEVEL).sum()), q.size, LEVEL) for q in by_channel]
        ),
        "uniformity_p": bonferroni([uniformity_p(q) for q in by_channel]),
    }


def _largest(difference: Array, mean: float) -> float:
    """Return the largest difference over a mean; NaN if that is not bright."""
    return float(np.abs(difference).max(initial=0.0)) / mean if mean > 0 else float("nan")


def _block_tests(expected: _Side, tested: _Side) -> dict[str, int]:
    """Test the sums over blocks of pixels."""
    difference = block_sums(
        np.where(np.hypot(expected.error, tested.error) > 0, tested.mean - expected.mean, 0.0)
    )
    variance, spread = np.add(expected.of_blocks(), tested.of_blocks())
    random = variance > 0
    z = difference[random] / np.sqrt(variance[random])
    p = two_sided_p(z, satterthwaite(variance, spread)[random])
    return {"blocks": z.size, "rejected_blocks": int((p < sidak(LEVEL, z.size)).sum())}


def block_side(height: int, width: int, fewest: int = 10) -> int:
    """Return the side of a block [pixels]: `fewest` blocks at least along the shorter side of an
    image, where it has as many pixels.
    """
    return min(BLOCK, max(1, min(height, width) // fewest))


def block_sums(values: Array, side: int = BLOCK) -> Array:
    """Return the sums over square blocks, smaller ones at the far edges:
    (rows, columns, channels).
    """
    rows, columns = (np.arange(0, length, side) for length in values.shape[:2])
    return np.add.reduceat(np.add.reduceat(values, rows, axis=0), columns, axis=1)


def _side(
    name: str, estimate: NoisyImage, chosen: Bools, *, scale: float, with_batches: bool
) -> _Side:
    """Check one estimate and make it regular: float64 of three dimensions, scaled, zero
    outside the chosen pixels.
    """
    # Mean and standard error, in a common unit and 0 outside.
    shape = np.shape(estimate.mean)
    inside = chosen[:, :, None]
    mean = np.asarray(estimate.mean, dtype=np.float64).reshape(*shape[:2], -1)
    mean = np.where(inside, mean, 0.0) / scale
    error = np.zeros_like(mean)
    if estimate.standard_error is not None:
        given = np.asarray(estimate.standard_error, dtype=np.float64)
        if given.shape != shape:
            raise InputError(
                f"the standard error of the {name} has shape {given.shape}; expected that of its "
                f"image, {shape}"
            )
        error = np.where(inside, given.reshape(mean.shape), 0.0) / scale
    wrong = int((~(np.isfinite(error) & (error >= 0))).any(axis=2).sum())
    if wrong:
        raise InputError(
            f"the standard error of the {name} is negative or not finite in {wrong} pixels; mask "
            "them"
        )
    # Batch means give a second interval, where they are of the pixels that are compared.
    if estimate.batches is not None and estimate.batches < 2:
        raise InputError(
            f"batches of the {name}: got {estimate.batches}, expected at least 2 for a standard "
            "error"
        )
    if estimate.batch_means is None or not with_batches:
        return _Side(mean, error, estimate.batches, shared=estimate.shared)
    means = np.asarray(estimate.batch_means, dtype=np.float64) / scale
    means = means.reshape(len(means), -1).mean(axis=1)
    # Means over other pixels would give the interval of another number. Sums of float32 agree to
    # 1e-4.
    bias = float(mean[chosen].mean())
    if len(means) < 2 or not np.isclose(means.mean(), bias, rtol=1e-4, atol=0):
        raise InputError(
            f"the {len(means)} batch means of the {name} have the mean {means.mean() * scale:.6g}, "
            "the pixels compared "
            f"{bias * scale:.6g}; give two or more, taken over the same pixels"
        )
    return _Side(mean, error, estimate.batches, means, estimate.shared)


# The relative bias of the whole image


@dataclass(frozen=True)
class _Bias:
    """The relative bias of an image, by the names of `Statistics`; unknown numbers are NaN."""

    relative_bias: float = math.nan
    relative_bias_se: float = math.nan
    relative_bias_freedom: float = math.nan
    relative_bias_p: float = math.nan
    relative_bias_ci: tuple[float, float] = (math.nan, math.nan)
    relative_bias_ci_batches: tuple[float, float] | None = None
    reference_variance_fraction: float = math.nan
    largest_fraction: float = math.nan
    detectable_bias: float = math.nan


def _relative_bias(reference: _Side, test: _Side, pixels: int) -> _Bias:
    """Pool the error of all pixels into one relative bias; unknown for a dark reference."""
    bright = float(reference.mean.sum())
    if not bright > 0:
        return _Bias()
    # From the difference, not from the ratio: no cancellation for images that nearly agree.
    value = float((test.mean - reference.mean).sum()) / bright
    sides = ((test, 1 / bright), (reference, (1 + value) / bright))  # with the scale of its error
    pixels_variance = np.zeros(reference.mean.shape[:2])
    total = spread = of_reference = 0.0
    for side, scale in sides:
        pixels_variance += (scale * side.error.sum(axis=2)) ** 2
        of_reference, part = side.of_image(scale)  # the reference is the last
        total, spread = total + of_reference, spread + part
    freedom, error = float(satterthwaite(total, spread)), float(np.sqrt(total))
    interval, reach = _interval(value, total, freedom)
    interval_batches, reach_batches = _from_batches(value, sides, pixels)
    bias = _Bias(
        relative_bias=value,
        relative_bias_se=error,
        relative_bias_freedom=freedom,
        relative_bias_ci=interval,
        relative_bias_ci_batches=interval_batches,
        detectable_bias=max(reach, reach_batches),
    )
    # Without variance there is no probability and no fraction of it.
    if not total > 0:
        return bias
    return replace(
        bias,
        relative_bias_p=float(two_sided_p(np.asarray(value / error), np.asarray(freedom))),
        reference_variance_fraction=of_reference / total,
        largest_fraction=float(pixels_variance.max()) / total,
    )


def _from_batches(
    value: float, sides: tuple[tuple[_Side, float], ...], pixels: int
) -> tuple[tuple[float, float] | None, float]:
    """Return the interval from the spread of batch means, and the bias it would detect."""
    if all(side.batch_means is None for side, _ in sides):
        return None, 0.0
    total = spread = 0.0
    for side, scale in sides:
        if side.batch_means is None:
            part, part_spread = side.of_image(scale)
        else:
            count = len(side.batch_means)
            values = pixels * side.mean.shape[2]
            part = float(side.batch_means.var(ddof=1)) / count * (values * scale) ** 2
            part_spread = part**2 / (count - 1)
        total, spread = total + part, spread + part_spread
    return _interval(value, total, float(satterthwaite(total, spread)))


def _interval(value: float, variance: float, freedom: float) -> tuple[tuple[float, float], float]:
    """Return the 95 % interval and the detectable bias."""
    error = float(np.sqrt(variance))
    half = student_quantile(0.975, freedom) * error
    return (value - half, value + half), half + student_quantile(0.90, freedom) * error
