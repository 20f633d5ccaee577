# SPDX-License-Identifier: BSD-3-Clause
"""The two routes to the truth against each other: the quadrature image and Mitsuba's volumetric path tracer.

They share no code but Mitsuba's ray casting. volpath attenuates over a shadow ray that ends a relative epsilon before
the light (DESIGN section 6.1), so it is compared with the quadrature image of *that* integral, exp(-sigma_t (x + (1 -
epsilon) r)), with the epsilon measured on this machine. The bias without this correction is given beside it.

Rays that pass closer to a light than `MASK_PIXELS` pixel widths are left out: the contribution of one path there is
bounded only by 1/h^2, so that no number of samples gives a standard error to trust (DESIGN section 6.6).
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reference.epsilon import measure_shadow_epsilon
from reference.quadrature import TruthImage
from reference.scene import read_truth
from reference.volpath import LAYERS, Batches
from validation.statistics import Estimate, Statistics, compare_statistics
from validation.truth import truth_image, volpath_batches

Progress = Callable[[int, int, str], None]

MASK_PIXELS = 2.0
MARGIN = 0.005  #: the two agree if the interval of the relative bias lies inside +- this


@dataclass(frozen=True)
class Agreement:
    """How far volpath is from the quadrature image in one layer."""

    layer: str  #: 'airlight' or 'surface'
    width: int
    height: int
    batches: int
    samples: int  #: a pixel and batch
    epsilon: float  #: the shadow-ray epsilon that was corrected for
    masked: int  #: pixels left out because a light is close to their ray
    statistics: Statistics  #: of volpath against the quadrature of the shortened shadow ray
    uncorrected_bias: float  #: pooled relative bias against the plain truth


def agreement(scene, *, batches: int = 32, samples: int = 64, progress: Progress | None = None) -> dict[str, Agreement]:
    """Compare volpath with the quadrature image of a Mitsuba scene at its own size.

    Parameters
    ----------
    scene
        The `mi.Scene`; a small size will do, since the comparison pools all pixels.
    batches, samples
        Batches of volpath, and samples a pixel in each.
    progress
        Called with (done, total, what) after every batch.

    Returns
    -------
    dict
        By layer; the surface is left out where nothing is visible but the medium.
    """
    epsilon = measure_shadow_epsilon()
    plain = truth_image(scene)
    shortened = truth_image(scene, shadow_scale=1 - epsilon)
    volpath = volpath_batches(scene, batches=batches, samples=samples, progress=progress)
    pixel = _pixel_angle(scene)
    masks = {
        "airlight": (plain.light_angle > MASK_PIXELS * pixel) & np.all(np.isfinite(plain.airlight), axis=2),
        "surface": np.isfinite(plain.distance),
    }
    return {
        layer: _agreement(layer, plain, shortened, volpath, masks[layer], epsilon)
        for layer in LAYERS
        if np.any(getattr(plain, layer) > 0)
    }


def _agreement(
    layer: str, plain: TruthImage, shortened: TruthImage, volpath: Batches, mask, epsilon: float
) -> Agreement:
    number = LAYERS.index(layer)
    expected = getattr(shortened, layer)
    mean = volpath.mean[number].reshape(expected.shape)
    error = volpath.standard_error[number].reshape(expected.shape)
    chosen = np.broadcast_to(mask[..., None], expected.shape)
    statistics = compare_statistics(
        Estimate(expected),
        Estimate(mean, error, len(volpath.seeds)),
        mask=chosen,
        margin=MARGIN,
    )
    true = getattr(plain, layer)[chosen].sum()
    height, width = expected.shape[:2]
    return Agreement(
        layer,
        width,
        height,
        len(volpath.seeds),
        volpath.samples,
        epsilon,
        int(mask.size - mask.sum()) if layer == "airlight" else 0,
        statistics,
        float(mean[chosen].sum() / true - 1),
    )


def _pixel_angle(scene) -> float:
    """Return the angle between the two pixels in the middle of the image [rad]."""
    truth = read_truth(scene)
    middle = (truth.height // 2) * truth.width + truth.width // 2
    beside = middle - 1 if truth.width > 1 else middle
    return float(np.arccos(np.clip(truth.direction[middle] @ truth.direction[beside], -1, 1)))
