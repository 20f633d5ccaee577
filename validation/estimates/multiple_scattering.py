# SPDX-License-Identifier: BSD-3-Clause
"""How much multiple scattering a scene has: the share of light that every single-scattering method leaves out.

volpath is run twice with the same seeds, with max_depth = 2 (one scattering) and with a large one. Over the batches b,
with S_b and T_b the image means of the two, the share is

    1 - R,    R = mean(S) / mean(T),    s_R = std(S_b - R T_b) / (sqrt(K) mean(T))

(the estimate of a ratio, and its standard error to first order; Cochran 1977, eq. 2.46). Paths of one seed begin alike,
so that S and T rise and fall together: the smaller the share, the more of the noise cancels in S - R T. The ratio is
biased by about s_R^2, which is far below its interval. The interval is Student's, for K - 1 degrees of freedom.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.batches import LAYERS
from validation.estimates.monte_carlo import monte_carlo_batches
from validation.statistics.samples import student_quantile

Array = NDArray[np.float64]
Progress = Callable[[int, int, str], None]


@dataclass(frozen=True)
class Share:
    """A share of the radiance, averaged over the image and the three channels."""

    value: float
    interval: tuple[float, float]  #: of 95 %


@dataclass(frozen=True)
class MultipleScattering:
    """What single-scattering methods leave out of the image of a scene."""

    medium: Share  #: of the airlight with black surfaces: light that the medium scattered twice or more
    everything: Share  #: of all light: also that which met surfaces twice, or surfaces and the medium
    max_depth: int  #: paths of more edges are left out even here
    batches: int
    samples: int  #: a pixel in each


def multiple_scattering_fraction(
    scene,
    *,
    max_depth: int = 64,
    batches: int = 32,
    samples: int = 16,
    first_seed: int = 0,
    progress: Progress | None = None,
) -> MultipleScattering:
    """Return the share of multiple scattering in the image of a Mitsuba scene at its own size.

    Parameters
    ----------
    scene
        The `mi.Scene`; a small size will do, since the share is one of the whole image.
    max_depth
        Most edges of a path; of n scatterings by the medium at most albedo^n of the light is left, so 64 lacks little
        but in a thick medium whose albedo is close to 1.
    batches, samples, first_seed, progress
        See `validation.estimates.monte_carlo.monte_carlo_batches`, which is run twice.

    Raises
    ------
    ValueError
        If `max_depth` allows no second scattering.

    Notes
    -----
    Valid for scenes that volpath can trace. A light close to a camera ray makes heavy tails, and the interval of few
    batches too narrow.
    """
    if max_depth < 3:
        raise ValueError(f"max_depth: got {max_depth}, wanted at least 3, which allows two scatterings")

    def totals(depth: int) -> Array:
        """Return the image means of every batch, (batches, layers)."""
        run = monte_carlo_batches(
            scene,
            "volpath",
            batches=batches,
            samples=samples,
            first_seed=first_seed,
            max_depth=depth,
            progress=progress,
        )
        return run.batches.totals.mean(axis=2)

    single, whole = totals(2), totals(max_depth)
    airlight = LAYERS.index("airlight")
    return MultipleScattering(
        left_out(single[:, airlight], whole[:, airlight]),
        left_out(single.sum(axis=1), whole.sum(axis=1)),
        max_depth,
        batches,
        samples,
    )


def left_out(part: Array, whole: Array) -> Share:
    """Return 1 - part/whole with its 95 % interval, from image means of paired batches, (batches,); 0 without light."""
    count = len(whole)
    if not whole.mean() > 0:
        return Share(0.0, (0.0, 0.0))
    ratio = float(part.mean() / whole.mean())
    error = float((part - ratio * whole).std(ddof=1) / np.sqrt(count) / whole.mean())
    half = student_quantile(0.975, count - 1) * error
    return Share(1 - ratio, (1 - ratio - half, 1 - ratio + half))
