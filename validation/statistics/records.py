# SPDX-License-Identifier: BSD-3-Clause
"""Results of comparisons with random errors, for rows and reports, without Dr.Jit;
unknown values are None.
"""

from dataclasses import dataclass
from typing import Literal

from airlight.validation.columns import column

Number = float | None
Ends = tuple[Number, Number]  #: of an interval
Estimator = Literal["single-scatter", "volpath"]
Layer = Literal["airlight", "surface"]


@dataclass(frozen=True, kw_only=True)
class Statistics:
    """Agreement of two images with standard errors; every number stays if
    both radiances are scaled.

    If the images agree and the standard errors are right, z has the mean 0 and, for K batches, the
    standard deviation sqrt((K - 1)/(K - 3)). Numbers "expected" are those of images that agree.
    """

    masked: int = column(unit="pixels", meaning="that the mask leaves out")
    tested: int  #: values with a z
    zero_reference: int  #: values where the reference is zero
    zero_reference_error: Number  #: the largest |test| among them over the mean of the reference
    zero_variance: int  #: values without variance
    #: the largest |test - ref| among them over the mean of the reference
    zero_variance_error: Number
    z_mean: Number = column(
        "z: mean", meaning="errors of pixels in units of their noise: 0 if there is no bias"
    )
    z_std: Number = column(
        "z: st. deviation", meaning="1 if the noise is as large as was estimated"
    )
    rejected: int = column(
        unit="pixels", meaning="with a value rejected at Sidak's level: noise does not explain it"
    )
    expected_rejections: float = column("expected", "pixels", "that would be rejected by chance")
    exceeding: int  #: values whose p-value is below `validation.statistics.comparison.LEVEL`
    expected_exceeding: float
    exceeding_p: Number  #: p-value of `exceeding`, both tails
    blocks: int  #: of 8 x 8 pixels, one channel each
    rejected_blocks: int  #: at Sidak's level for their number
    uniformity_p: Number  #: p-value of the test that the p-values are uniform
    relative_bias: Number = column(
        "bias", meaning="sum of the test image over that of the reference, less 1"
    )
    relative_bias_ci: Ends = column(
        "95 % interval", meaning="holds the true bias in 19 of 20 such runs"
    )
    relative_bias_ci_batches: Ends | None  #: that from the batch means
    relative_bias_se: Number  #: from the standard errors of the pixels
    relative_bias_freedom: Number  #: degrees of freedom of that; None for the normal law
    relative_bias_p: Number  #: two-sided
    #: of the reference in the variance of `relative_bias`; the rest is the test's
    reference_variance_fraction: Number
    largest_fraction: Number  #: of one pixel in that variance; above 1 % the interval is doubtful
    detectable_bias: Number = column(
        "detectable", meaning="the least bias that is found in nine runs of ten"
    )
    margin: Number = column(meaning="agreement: the whole interval lies inside it, either way")
    #: whether all intervals, and stated errors beside them, lie within the margin
    equivalent: bool | None


@dataclass(frozen=True, kw_only=True)
class Agreement:
    """How far an estimator is from the quadrature image in one layer: a check of the reference."""

    estimator: Estimator = column(meaning="that checks")
    layer: Layer = column(meaning="that is checked")
    width: int = column(unit="pixels")
    height: int = column(unit="pixels")
    batches: int = column(meaning="that were traced or taken from the cache")
    samples: int = column(meaning="per pixel in a batch")
    epsilon: float = column(
        "shadow-ray epsilon",
        meaning="by what fraction shadow rays end before the light; 0 for single-scatter",
    )
    masked: int = column(unit="pixels", meaning="left out because a light is close to their ray")
    statistics: Statistics = column(
        meaning="the check confirms the reference if it is `equivalent`"
    )
    uncorrected_bias: Number = column(
        "uncorrected", meaning="relative bias without the shadow-ray epsilon"
    )
    finished: bool = column(
        meaning="whether its intervals became narrow enough; else it may be undecided"
    )


@dataclass(frozen=True)
class Fraction:
    """A fraction of the light, with its 95 % interval; None where it is not known."""

    value: Number
    interval: Ends


@dataclass(frozen=True, kw_only=True)
class MultipleScattering:
    """The multiply scattered light, which every single-scattering method leaves out."""

    #: of the airlight with black surfaces: light that the medium scattered twice or more
    medium: Fraction
    everything: Fraction  #: also light that met surfaces twice, or surfaces and the medium
    max_depth: int  #: the most edges of a path
    batches: int
    samples: int  #: per pixel in a batch
