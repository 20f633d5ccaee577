# SPDX-License-Identifier: BSD-3-Clause
r"""Do the statistical tests do what they say? Synthetic images with a known
reference, judged like real ones.

An image is a profile, dim by a factor of a hundred from one side to the other, times 1 + bias. Each
of its K batches has in every pixel a relative error of the standard deviation `spread`, drawn from
a law of mean 0 and deviation 1; mean and standard error follow from the batches as a renderer's do.
Then

* without a bias (`calibrate`) each test must reject as often as its level says, the intervals must
  hold the true value as often as they say, and the p-values of many comparisons must be uniform
  (Kolmogorov and Smirnov);
* with a bias (`power_and_finds`) the fraction of comparisons that find it must be the power that
  each of them predicts from its own standard error.

**How far this holds.** Batch means of path tracers are skewed. With errors of a batch that are
log-normal with the logarithmic deviation s, the count of rejected pixels is the first to break,
from s = 0.5 on (a skewness of 1.7). Blocks hold to s = 0.5, and the interval of the image, which
decides on equivalence, to s = 1 (a skewness of 6). `exceeding_p` notices all of it before it
matters. At s = 2, where one value in a thousand is fifty times the mean, no interval is what it
says with any affordable number of batches.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr
from scipy.stats import binom, nct

from airlight.validation.statistics.comparison import (
    LEVEL,
    NoisyImage,
    Statistics,
    compare_statistics,
)
from airlight.validation.statistics.samples import student_quantile, uniformity_p

Array = NDArray[np.float64]
#: draws numbers of mean 0 and standard deviation 1
Law = Callable[[np.random.Generator, tuple[int, ...]], Array]

BATCHES, SIZE = 16, (24, 24)  #: of images


def monte_carlo(batches: Array) -> NoisyImage:
    """Return the estimate that a renderer would give, from its batch means
    (batches, height, width, ...).
    """
    count = len(batches)
    error = batches.std(axis=0, ddof=1) / np.sqrt(count)
    return NoisyImage(batches.mean(axis=0), error, count, batches.mean(axis=(1, 2)))


def around_one(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw batches of an image of ones."""
    return rng.normal(1, 0.3, shape)


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw from the normal law, which the tests take for granted."""
    return rng.standard_normal(shape)


def log_normal(deviation: float) -> Law:
    """Return the law of exp(deviation N) brought to mean 0 and deviation 1: many small
    values and few large ones.
    """
    mean, spread = (
        np.exp(deviation**2 / 2),
        np.exp(deviation**2 / 2) * np.sqrt(np.expm1(deviation**2)),
    )
    return lambda rng, shape: (np.exp(deviation * rng.standard_normal(shape)) - mean) / spread


@dataclass(frozen=True)
class Experiment:
    """Which images are compared, and how often."""

    law: Law = normal  #: of the errors of a batch in a pixel; see `normal` and `log_normal`
    runs: int = 300  #: comparisons
    batches: int = 16  #: of each random image
    size: int = 24  #: pixels along each side of an image
    #: or an exact one; the skewed errors of two random images cancel their skewness
    noisy_reference: bool = False
    seed: int = 1  #: of the random numbers


#: Expected rates of `calibrate`; `exceeding_alarms` may be lower, as a count is discrete.
EXPECTED = {
    "pixel_alarms": LEVEL,  # with a pixel rejected at Sidak's level
    "block_alarms": LEVEL,
    "exceeding": LEVEL,  # values below the level
    "exceeding_alarms": LEVEL,  # with `exceeding_p` below it
    "uniformity_alarms": LEVEL,
    "coverage": 0.95,  # whose 95 % interval holds the true value, from the standard errors
    "coverage_batches": 0.95,  # from the batch means
}


def calibrate(experiment: Experiment, *, spread: float = 0.3) -> dict[str, float]:
    """Compare many images that agree, and return rates, and how likely the
    p-values are to be uniform.
    """
    comparisons = _comparisons(experiment, 0.0, spread)

    def rate(event: Callable[[Statistics], bool]) -> float:
        return float(np.mean([event(each) for each in comparisons]))

    return {
        "pixel_alarms": rate(lambda s: s.rejected > 0),
        "block_alarms": rate(lambda s: s.rejected_blocks > 0),
        "exceeding": sum(s.exceeding for s in comparisons) / sum(s.tested for s in comparisons),
        "exceeding_alarms": rate(lambda s: s.exceeding_p < LEVEL),
        "uniformity_alarms": rate(lambda s: s.uniformity_p < LEVEL),
        "coverage": rate(lambda s: s.relative_bias_ci[0] <= 0 <= s.relative_bias_ci[1]),
        "coverage_batches": rate(
            lambda s: s.relative_bias_ci_batches[0] <= 0 <= s.relative_bias_ci_batches[1]
        ),
        "bias_uniformity": uniformity_p(np.array([s.relative_bias_p for s in comparisons])),
        "uniformity_uniformity": uniformity_p(np.array([s.uniformity_p for s in comparisons])),
    }


def problems(
    rates: dict[str, float], experiment: Experiment, level: float = 1e-4
) -> dict[str, float]:
    """Return the rates that are not as they should be, each judged by its
    binomial law at a level.
    """
    wrong = {
        name: rates[name]
        for name in ("bias_uniformity", "uniformity_uniformity")
        if rates[name] < level
    }
    for name, expected in EXPECTED.items():
        trials = experiment.runs * experiment.size**2 if name == "exceeding" else experiment.runs
        low, high = fraction_interval(expected, trials, level)
        if not (name == "exceeding_alarms" or low <= rates[name]) or rates[name] > high:
            wrong[name] = rates[name]
    return wrong


def power_and_finds(bias: float, experiment: Experiment, *, spread: float) -> tuple[float, float]:
    """Inject a bias into many images; return the mean power that was predicted, and
    the fraction that found it.
    """
    comparisons = _comparisons(experiment, bias, spread)
    predicted = [power(bias / s.relative_bias_se, s.relative_bias_freedom) for s in comparisons]
    return float(np.mean(predicted)), float(
        np.mean([s.relative_bias_p < 0.05 for s in comparisons])
    )


def spread_to_detect(bias: float, experiment: Experiment) -> float:
    """Return the spread of a batch at which the standard error of the relative
    bias is |bias| / 3.2415.

    With the weight w of a pixel in the sum of the image the variance of the relative bias is
    (spread / (1 + bias))^2 sum w^2 / K for the test's errors, of relative size `spread`, and as
    much for the reference's.
    """
    profile = _profile(experiment.size)
    weights = profile / profile.sum()
    error = float(np.sqrt((weights**2).sum() / experiment.batches)) * (1 + bias)
    error *= np.sqrt(2) if experiment.noisy_reference else 1
    return abs(bias) / 3.2415 / error


def fraction_interval(probability: float, trials: int, level: float) -> tuple[float, float]:
    """Return between which shares an event of that probability falls with probability 1 - level."""
    low, high = binom.interval(1 - level, trials, probability)
    return float(low) / trials, float(high) / trials


def _comparisons(experiment: Experiment, bias: float, spread: float) -> list[Statistics]:
    rng = np.random.default_rng(experiment.seed)
    profile = _profile(experiment.size)

    def estimate(image: Array) -> NoisyImage:
        noise = spread * experiment.law(rng, (experiment.batches, *image.shape))
        return monte_carlo(image * (1 + noise))

    comparisons = []
    for _ in range(experiment.runs):
        test = estimate((1 + bias) * profile)
        reference = estimate(profile) if experiment.noisy_reference else NoisyImage(profile)
        comparisons.append(compare_statistics(reference, test))
    return comparisons


def _profile(size: int) -> Array:
    """Return radiance that falls by a factor of a hundred from left to right."""
    return np.tile(np.geomspace(1.0, 0.01, size), (size, 1))


def power(effect: float, freedom: float, level: float = 0.05) -> float:
    """Return the probability that a two-sided test at a level finds an effect,
    given in standard errors.

    The statistic (B - b)/se + b/se follows Student's non-central law with the parameter b/se, as se
    is itself estimated with `freedom` degrees of freedom, and a shifted normal law for infinitely
    many. Both tails count, so an effect of zero is found with the probability of the level.
    """
    critical = student_quantile(1 - level / 2, freedom)
    if np.isfinite(freedom):
        return float(nct.sf(critical, freedom, effect) + nct.cdf(-critical, freedom, effect))
    return float(ndtr(effect - critical) + ndtr(-effect - critical))
