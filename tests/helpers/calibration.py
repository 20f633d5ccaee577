# SPDX-License-Identifier: BSD-3-Clause
r"""Do the statistical tests do what they say? Synthetic images with a known truth, judged like real ones.

An image is a profile, dim by a factor of a hundred from one side to the other, times 1 + bias. Each of its K batches
has in every pixel a relative error of the standard deviation `spread`, drawn from a law of mean 0 and deviation 1; mean
and standard error follow from the batches as a renderer's do. Then

* without a bias (`calibrate`) each test must reject as often as its level says, the intervals must hold the truth as
  often as they say, and the p-values of many comparisons must be uniform (Kolmogorov and Smirnov);
* with a bias (`check_power`) the share of comparisons that find it must be the power that each of them predicts from
  its own standard error.

**How far this holds.** Batch means of path tracers are skewed. With errors of a batch that are log-normal with the
logarithmic deviation s, the count of rejected pixels is the first to break, from s = 0.5 on (a skewness of 1.7). Blocks
hold to s = 0.5, and the interval of the image, which decides on equivalence, to s = 1 (a skewness of 6). `exceeding_p`
notices all of it before it matters. At s = 2, where one value in a thousand is fifty times the mean, no interval is
what it says with any affordable number of batches.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom

from validation.statistics.comparison import Estimate, Statistics, compare_statistics
from validation.statistics.p_values import power, uniformity_p

Array = NDArray[np.float64]
Law = Callable[[np.random.Generator, tuple[int, ...]], Array]  #: draws numbers of mean 0 and standard deviation 1

LEVEL = 0.01  #: of the tests of values, pixels and blocks


def normal(rng: np.random.Generator, shape: tuple[int, ...]) -> Array:
    """Draw from the normal law, which the tests take for granted."""
    return rng.standard_normal(shape)


def log_normal(deviation: float) -> Law:
    """Return the law of exp(deviation N) brought to mean 0 and deviation 1: many small values and few large ones."""
    mean, spread = np.exp(deviation**2 / 2), np.exp(deviation**2 / 2) * np.sqrt(np.expm1(deviation**2))
    return lambda rng, shape: (np.exp(deviation * rng.standard_normal(shape)) - mean) / spread


@dataclass(frozen=True)
class Experiment:
    """Which images are compared, and how often."""

    law: Law = normal  #: of the errors of a batch in a pixel; see `normal` and `log_normal`
    runs: int = 300  #: comparisons
    batches: int = 16  #: of each random image
    size: int = 24  #: pixels along each side of an image
    noisy_reference: bool = False  #: or an exact one; the skewed errors of two random images cancel their skewness
    seed: int = 1  #: of the random numbers


@dataclass(frozen=True)
class Calibration:
    """How often the tests of `validation.statistics.comparison` reject images that agree: shares of the runs."""

    runs: int
    pixels: int
    batches: int
    pixel_alarms: float  #: with a pixel rejected at Sidak's level
    block_alarms: float
    exceeding: float  #: of values, below the 1 % level
    exceeding_alarms: float  #: with `exceeding_p` below 1 %: at most 1 %, as a number is discrete
    uniformity_alarms: float
    coverage: float  #: whose 95 % interval holds the truth, from the standard errors
    coverage_batches: float  #: from the batch means
    bias_uniformity: float  #: Kolmogorov and Smirnov's p-value that the runs' `relative_bias_p` are uniform
    uniformity_uniformity: float  #: and their `uniformity_p`

    def problems(self, level: float = 1e-4) -> tuple[str, ...]:
        """Name what is not as it should be, each judged by its binomial law at a level; empty if all is well."""
        expected = {
            "pixel_alarms": LEVEL,
            "block_alarms": LEVEL,
            "exceeding": LEVEL,
            "uniformity_alarms": LEVEL,
            "coverage": 0.95,
            "coverage_batches": 0.95,
        }
        departures = []
        for name, share in expected.items():
            trials = self.runs * self.pixels if name == "exceeding" else self.runs
            low, high = share_interval(share, trials, level)
            if not low <= getattr(self, name) <= high:
                departures.append(f"{name} is {getattr(self, name):.4g}, expected {share:g} ({low:.4g} to {high:.4g})")
        if self.exceeding_alarms > share_interval(LEVEL, self.runs, level)[1]:
            departures.append(f"exceeding_alarms is {self.exceeding_alarms:.4g}, expected at most {LEVEL:g}")
        for name in ("bias_uniformity", "uniformity_uniformity"):
            if getattr(self, name) < level:
                departures.append(f"{name} is {getattr(self, name):.2g}")
        return tuple(departures)


@dataclass(frozen=True)
class PowerCheck:
    """How often an injected bias was found, and how often the comparisons themselves said that it would be."""

    bias: float
    detectable: float
    predicted: float
    measured: float
    runs: int

    @property
    def agrees(self) -> bool:
        """Whether the share lies where the prediction's binomial law has it with probability 1 - 1e-4."""
        low, high = share_interval(self.predicted, self.runs, 1e-4)
        return low <= self.measured <= high


def calibrate(experiment: Experiment, *, spread: float = 0.3) -> Calibration:
    """Compare many images that agree, and count."""
    comparisons = _comparisons(experiment, 0.0, spread)

    def covered(name: str) -> float:
        return float(np.mean([getattr(s, name)[0] <= 0 <= getattr(s, name)[1] for s in comparisons]))

    return Calibration(
        runs=experiment.runs,
        pixels=experiment.size**2,
        batches=experiment.batches,
        pixel_alarms=float(np.mean([s.rejected > 0 for s in comparisons])),
        block_alarms=float(np.mean([s.rejected_blocks > 0 for s in comparisons])),
        exceeding=sum(s.exceeding for s in comparisons) / sum(s.tested for s in comparisons),
        exceeding_alarms=float(np.mean([s.exceeding_p < LEVEL for s in comparisons])),
        uniformity_alarms=float(np.mean([s.uniformity_p < LEVEL for s in comparisons])),
        coverage=covered("relative_bias_ci"),
        coverage_batches=covered("relative_bias_ci_batches"),
        bias_uniformity=uniformity_p(np.array([s.relative_bias_p for s in comparisons])),
        uniformity_uniformity=uniformity_p(np.array([s.uniformity_p for s in comparisons])),
    )


def check_power(bias: float, experiment: Experiment, *, spread: float) -> PowerCheck:
    """Inject a bias into many images, and compare the share that finds it with the power that was predicted."""
    comparisons = _comparisons(experiment, bias, spread)
    predicted = [power(bias / s.relative_bias_se, s.relative_bias_freedom) for s in comparisons]
    return PowerCheck(
        bias=bias,
        detectable=float(np.mean([s.detectable_bias for s in comparisons])),
        predicted=float(np.mean(predicted)),
        measured=float(np.mean([s.relative_bias_p < 0.05 for s in comparisons])),
        runs=experiment.runs,
    )


def spread_to_detect(bias: float, experiment: Experiment) -> float:
    """Return the spread of a batch at which the standard error of the relative bias is |bias| / 3.2415.

    With the weight w of a pixel in the sum of the image the variance of the relative bias is (spread / (1 + bias))^2
    sum w^2 / K for the test's errors, of relative size `spread`, and as much for the reference's.
    """
    profile = _profile(experiment.size)
    weights = profile / profile.sum()
    error = float(np.sqrt((weights**2).sum() / experiment.batches)) * (1 + bias)
    error *= np.sqrt(2) if experiment.noisy_reference else 1
    return abs(bias) / 3.2415 / error


def share_interval(probability: float, trials: int, level: float) -> tuple[float, float]:
    """Return between which shares an event of that probability falls with probability 1 - level."""
    low, high = binom.interval(1 - level, trials, probability)
    return float(low) / trials, float(high) / trials


def _comparisons(experiment: Experiment, bias: float, spread: float) -> list[Statistics]:
    rng = np.random.default_rng(experiment.seed)
    truth = _profile(experiment.size)

    def estimate(image: Array) -> Estimate:
        """Return what a renderer gives of an image: mean, standard error and batch means."""
        images = image * (1 + spread * experiment.law(rng, (experiment.batches, *image.shape)))
        error = images.std(axis=0, ddof=1) / np.sqrt(experiment.batches)
        return Estimate(images.mean(axis=0), error, experiment.batches, images.mean(axis=(1, 2)))

    comparisons = []
    for _ in range(experiment.runs):
        test = estimate((1 + bias) * truth)
        reference = estimate(truth) if experiment.noisy_reference else Estimate(truth)
        comparisons.append(compare_statistics(reference, test, family_level=LEVEL, plain_level=LEVEL))
    return comparisons


def _profile(size: int) -> Array:
    """Return radiance that falls by a factor of a hundred from left to right."""
    return np.tile(np.geomspace(1.0, 0.01, size), (size, 1))
