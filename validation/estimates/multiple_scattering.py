# SPDX-License-Identifier: BSD-3-Clause
"""The multiple scattering of a scene: the fraction of light that every single-scattering method
leaves out.

volpath is run twice with the same seeds, with max_depth = 2 (one scattering) and with a large one.
Over the batches b, with S_b and T_b the image means of the two, the fraction is

    1 - R,    R = mean(S) / mean(T),    s_R = std(S_b - R T_b) / (sqrt(K) mean(T))

(the estimate of a ratio, and its standard error to first order; Cochran 1977, eq. 2.46). Paths of
one seed begin alike, so that S and T rise and fall together: the smaller the fraction, the more of
the noise cancels in S - R T. The ratio is biased by about s_R^2, which is far below its interval.
The interval is Student's, for K - 1 degrees of freedom.
"""

import numpy as np

from airlight.reference.monte_carlo.batches import LAYERS
from airlight.validation.arrays import Array
from airlight.validation.estimates.monte_carlo import monte_carlo_batches
from airlight.validation.statistics.records import Fraction, MultipleScattering
from airlight.validation.statistics.samples import student_quantile


def multiple_scattering_fraction(
    scene, *, max_depth: int = 64, batches: int = 32, samples: int = 16
) -> MultipleScattering:
    """Return the fraction of multiple scattering in the image of a Mitsuba scene at its own size.

    Valid for scenes that volpath can trace. A light close to a camera ray makes heavy tails, and
    the interval of few batches too narrow.

    Parameters
    ----------
    scene
        An `mi.Scene`.
    max_depth
        The largest number of edges of a path, 3 at least. After n scatterings at most albedo^n of
        the light remains: 64 edges lack little unless the medium is thick and its albedo close
        to 1.
    batches
        How many images of each depth are rendered: their spread gives the interval.
    samples
        Paths per pixel of each image.
    """
    # The same seeds for both depths: the noise of paths of one scattering is in both and cancels.
    single, whole = (
        monte_carlo_batches(
            scene, "volpath", max_depth=depth, batches=batches, samples=samples
        ).batches.totals.mean(axis=2)
        for depth in (2, max_depth)
    )
    airlight = LAYERS.index("airlight")
    return MultipleScattering(
        medium=left_out(single[:, airlight], whole[:, airlight]),
        everything=left_out(single.sum(axis=1), whole.sum(axis=1)),
        max_depth=max_depth,
        batches=batches,
        samples=samples,
    )


def left_out(part: Array, whole: Array) -> Fraction:
    """Return 1 - part/whole with its 95 % interval, from image means of paired batches,
    (batches,); unknown where no path found light.
    """
    count = len(whole)
    # Written so that NaN counts as no light.
    if not whole.mean() > 0:
        return Fraction(None, (None, None))
    # R and s_R of the module, over the batches b.
    ratio = float(part.mean() / whole.mean())
    error = float((part - ratio * whole).std(ddof=1) / np.sqrt(count) / whole.mean())
    # Batches without any path of further orders do not say how rare these are.
    if error == 0:
        return Fraction(1 - ratio, (None, None))
    half = student_quantile(0.975, count - 1) * error
    return Fraction(1 - ratio, (1 - ratio - half, 1 - ratio + half))
