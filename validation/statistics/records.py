# SPDX-License-Identifier: BSD-3-Clause
"""Results of comparisons with random errors, for rows and reports, without Dr.Jit; unknown values are None."""

from dataclasses import dataclass
from typing import Literal

from validation.columns import column

Number = float | None
Ends = tuple[Number, Number]  #: of an interval


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """Agreement of two images with standard errors; every number stays if both radiances are scaled.

    If the images agree and the standard errors are right, z has the mean 0 and, for K batches, the standard deviation
    sqrt((K - 1)/(K - 3)). Numbers "expected" are those of images that agree.
    """

    masked: int  #: pixels that the mask leaves out
    tested: int  #: values with a z
    zero_reference: int  #: values where the reference is zero
    zero_reference_error: Number  #: the largest |test| among them over the mean of the reference
    zero_variance: int  #: values without variance
    zero_variance_error: Number  #: the largest |test - ref| among them over the mean of the reference
    z_mean: Number
    z_std: Number
    rejected: int  #: pixels with a value rejected at Sidak's level
    expected_rejections: float
    exceeding: int  #: values whose p-value is below `validation.statistics.comparison.LEVEL`
    expected_exceeding: float
    exceeding_p: Number  #: p-value of `exceeding`, both tails
    blocks: int  #: of 8 x 8 pixels, one channel each
    rejected_blocks: int  #: at Sidak's level for their number
    uniformity_p: Number  #: p-value of the test that the p-values are uniform
    relative_bias: Number  #: sum(test) / sum(ref) - 1
    relative_bias_ci: Ends  #: its 95 % interval from the standard errors
    relative_bias_ci_batches: Ends | None  #: that from the batch means
    relative_bias_se: Number  #: from the standard errors of the pixels
    relative_bias_freedom: Number  #: degrees of freedom of that; None for the normal law
    relative_bias_p: Number  #: two-sided
    reference_variance_fraction: Number  #: of the reference in the variance of `relative_bias`; the rest is the test's
    largest_fraction: Number  #: of one pixel in that variance; above 1 % the interval is doubtful
    detectable_bias: Number  #: smallest that is found with 90 % power at the 5 % level, by the wider interval
    margin: Number
    equivalent: bool | None  #: whether all intervals lie within the margin


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far an estimator is from the quadrature image in one layer: a check of the reference."""

    estimator: Literal["single-scatter", "volpath"] = column(meaning="that checks")
    layer: Literal["airlight", "surface"] = column(meaning="that is checked")
    width: int = column(unit="pixels")
    height: int = column(unit="pixels")
    batches: int = column(meaning="that were traced or taken from the cache")
    samples: int = column(meaning="per pixel in a batch")
    epsilon: float = column(meaning="of the shadow rays that it was corrected for; 0 for single-scatter")
    masked: int = column(unit="pixels", meaning="left out because a light is close to their ray")
    statistics: Statistics = column(meaning="the check confirms the reference if it is `equivalent`")
    uncorrected_bias: Number = column(meaning="relative bias before the correction")
    finished: bool = column(meaning="whether its intervals became narrow enough; else it may be undecided")


@dataclass(frozen=True)
class Fraction:
    """A fraction of the light, with its 95 % interval."""

    value: float
    interval: tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class MultipleScattering:
    """The multiply scattered light, which every single-scattering method leaves out."""

    medium: Fraction  #: of the airlight with black surfaces: light that the medium scattered twice or more
    everything: Fraction  #: also light that met surfaces twice, or surfaces and the medium
    max_depth: int  #: the most edges of a path
    batches: int
    samples: int  #: per pixel in a batch
