# SPDX-License-Identifier: BSD-3-Clause
"""When a Monte Carlo run ends: after so many samples, after a time, or when its error is small enough.

The error is the standard error relative to the radiance, either of the image, *pooled*, or of its *worst* pixel:

    pooled = sqrt(sum_p se_p^2) / sum_p L_p             worst = max_p se_p / max(L_p, 0.001 mean(L))

for each channel of each layer, the largest of which counts; pixels are independent of each other. The floor of a
thousandth of the mean is that of `airlight compare`. Rays that pass a light within
`validation.estimates.agreement.MASK_PIXELS` pixel widths are left out of the airlight's error: there no number of
samples gives a standard error to trust (DESIGN section 6.6).

The rule looks at the spread alone, never at a reference, so that stopping favours no verdict, and no run stops on a
target before `LEAST_BATCHES`: the standard error of a standard error is 1/sqrt(2 (K - 1)) of it, 13 % at K = 32.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from analytic.geometry import foot_and_height
from reference.monte_carlo.batches import LAYERS, Batches
from reference.scene.read import TruthScene
from validation.estimates.agreement import MASK_PIXELS, pixel_angle

LEAST_BATCHES = 32  #: before a standard error is good enough to stop on
USUAL_BATCH = 64  #: samples a pixel
_MOST_BATCHES = 1 << 16  # of a run without a given number of samples; there are more seeds
_LARGEST_TRACE = 1 << 22  # samples of one batch of such a run: so that it ends near its target
_FLOOR = 1e-3

Target = Literal["pooled", "worst"]


@dataclass(frozen=True)
class Budget:
    """When to stop: exactly one of the three is given.

    Raises
    ------
    InputError
        If none or more than one is given, or one is no positive number.
    """

    samples: int | None = None  #: a pixel, at least
    error: float | None = None  #: relative standard error
    seconds: float | None = None  #: of the whole run; batches from the cache cost next to nothing
    target: Target = "pooled"  #: which error

    def __post_init__(self) -> None:
        given = {"--samples": self.samples, "--error": self.error, "--seconds": self.seconds}
        named = [f"{name} {value:g}" for name, value in given.items() if value is not None]
        if len(named) != 1:
            raise InputError(f"got {' and '.join(named) or 'none'} of {', '.join(given)}; give one of them")
        for name, value in given.items():
            if value is not None and not 0 < value < np.inf:
                raise InputError(f"{name}: got {value:g}, wanted a positive number")
        if self.error is not None and self.error >= 1:
            raise InputError(f"--error: got {self.error:g}, wanted less than 1; 0.01 is 1 %")


def batch_plan(budget: Budget, pixels: int) -> tuple[int, int]:
    """Return how many batches at most, and of how many samples a pixel.

    A given number of samples is split into at least 32 batches where it has as many samples, and rounded up to whole
    ones. The samples of a batch are a power of two up to 64, so that runs of other lengths go on from the same batches.
    """
    if budget.samples is not None:
        samples = _power_of_two(min(USUAL_BATCH, budget.samples // LEAST_BATCHES))
        return max(2, -(-budget.samples // samples)), samples
    return _MOST_BATCHES, _power_of_two(min(USUAL_BATCH, _LARGEST_TRACE // pixels))


def _power_of_two(number: int) -> int:
    return 1 << (max(1, number).bit_length() - 1)


def relative_errors(batches: Batches, near: NDArray[np.bool_]) -> dict[Target, float]:
    """Return the relative standard errors [1] of some batches, less the airlight of pixels `near` a light, (pixels,).

    See the module: 'pooled' is that of the sum of all pixels' errors, the largest of all layers and channels, 'worst'
    that of a single pixel; 0 in the dark, infinite for what is not finite.
    """
    pooled = worst = 0.0
    for number, layer in enumerate(LAYERS):
        keep = ~near if layer == "airlight" else np.ones_like(near)
        mean, error = batches.mean[number][keep], batches.standard_error[number][keep]
        total = mean.sum(axis=0)
        if not (np.isfinite(total).all() and np.isfinite(error).all()):
            return {"pooled": np.inf, "worst": np.inf}  # no target is met by what is no number
        lit = total > 0
        if not lit.any():
            continue
        mean, error, total = mean[:, lit], error[:, lit], total[lit]
        pooled = max(pooled, float((np.sqrt((error**2).sum(axis=0)) / total).max()))
        worst = max(worst, float((error / np.maximum(mean, _FLOOR * total / len(mean))).max()))
    return {"pooled": pooled, "worst": worst}


def near_light(truth: TruthScene, distance: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which pixels' rays pass a light that they see within `MASK_PIXELS` pixel widths, (pixels,).

    `distance` is that to the visible surface, (pixels,) [m].
    """
    widest = MASK_PIXELS * pixel_angle(truth)
    near = np.zeros(len(truth.direction), dtype=bool)
    for light in truth.lights:
        origin = np.broadcast_to(truth.origin, truth.direction.shape)
        foot, height = foot_and_height(origin, truth.direction, light.position)
        near |= (foot > 0) & (foot < distance) & (np.arctan2(height, foot) <= widest)
    return near
