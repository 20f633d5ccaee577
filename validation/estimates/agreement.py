# SPDX-License-Identifier: BSD-3-Clause
"""The routes to the reference against each other: the quadrature image, our own integrator
and Mitsuba's path tracer.

They share no code but Mitsuba's ray casting. `single-scatter` estimates the same integral as the
quadrature by other means: agreement of a few hundredths of a percent says that neither has a fault.
`volpath` is code that nobody here wrote. It attenuates over a shadow ray that ends a relative
epsilon before the light (DESIGN section 6.1), so it is compared with the quadrature image of *that*
integral, exp(-sigma_t (x + (1 - epsilon) r)), with the epsilon measured on this machine. The bias
without this correction is given beside it.

Under area lights the quadrature has standard errors of its own, and both sides' count: the interval
of the image takes the spread of its replicates' means, as it takes that of whole batches of the
samplers. volpath's light comes in part by rays that the phase function sends on, which are not
shortened: the bias that is corrected for is the most that the epsilon can do, and the one without
correction is given beside it.

Rays that pass closer to a light than `MASK_PIXELS` pixel widths are left out: the contribution of
one path there is bounded only by 1/h^2, so that no number of samples gives a standard error to
trust (DESIGN section 6.6). Lights with extent leave out none: their fluence is bounded.
"""

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import cast

import numpy as np

from airlight.analytic.clock import stopwatch
from airlight.reference.monte_carlo.batches import LARGEST_SEED, LAYERS, Batches, allocated
from airlight.reference.monte_carlo.volpath_gaps import CannotTrace
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.reference import reference_image
from airlight.reference.quadrature.replicates import REPLICATES
from airlight.reference.scene.read import ReferenceScene, read_reference
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.validation.arrays import Array, Bools
from airlight.validation.estimates.monte_carlo import ElsewhereFor, monte_carlo_batches
from airlight.validation.estimates.quadrature import reference_error, reference_layer
from airlight.validation.statistics.comparison import NoisyImage, compare_statistics
from airlight.validation.statistics.records import Agreement, Estimator, Layer, Statistics

MASK_PIXELS = 2.0

_SAMPLES = 64  # a pixel in each batch


def agreement(
    scene,
    *,
    estimator: str = "volpath",
    margin: float = 0.005,
    batches: int = 256,
    samples: int = _SAMPLES,
    seconds: float | None = None,
    points: int | None = None,
    spread: ElsewhereFor | None = None,
) -> dict[str, Agreement]:
    """Compare an estimator with the quadrature image of a Mitsuba scene at its own size.

    It runs until the half width of every interval is below 0.4 times the margin. This rule looks at
    the spread alone, so that stopping favours no verdict; nor does the end of the time.

    The `mi.Scene` may be small, since all pixels are pooled. The estimator, 'volpath' or
    'single-scatter', agrees if the 95 % interval of the relative bias lies inside +- `margin`. At
    most `batches` are traced, of `samples` a pixel each; volpath places its samples where its pilot
    spread most (`reference.monte_carlo.batches`). After `seconds`, the pilot not counted, no
    further batch is traced; `spread` lets other processes trace some. `points` are those of area
    lights in the reference of volpath (`reference.quadrature.reference.reference_image`), whose
    margins are wider; single-scatter is compared with as many as the error of a pixel needs. The
    result is by layer, without the surface where nothing lit is visible.
    """
    # Mitsuba's shadow rays end a relative epsilon before the light: volpath is compared with the
    # quadrature of exactly this integral.
    epsilon = measure_shadow_epsilon() if estimator == "volpath" else 0.0
    plain = reference_image(scene)
    shortened = (
        reference_image(scene, shadow_scale=1 - epsilon, points=points) if epsilon else plain
    )
    masks = layer_masks(read_reference(scene), plain)
    # A layer without any light in the pixels that are compared has no relative bias.
    layers = [layer for layer in LAYERS if np.any(getattr(plain, layer)[masks[layer]] > 0)]

    def compared(traced: Batches, layer: str) -> Statistics:
        mask = masks[layer]
        # The quadrature's own standard errors count too, where the batches have one.
        test = batch_estimate(traced, layer, mask)
        return compare_statistics(
            reference_estimate(shortened, layer, test, mask), test, mask=mask, margin=margin
        )

    # A pilot with seeds that no run reaches says where volpath's samples spread most; the samples
    # of all batches are placed by it.
    counts = None
    if estimator == "volpath" and layers:
        pilot = monte_carlo_batches(
            scene, estimator, batches=8, samples=samples, first_seed=LARGEST_SEED // 2
        )
        counts = allocated(pilot.batches, samples, shape=plain.distance.shape, masks=masks)
    # From here on: where a pilot alone takes long, no time was left for the batches that count.
    took = stopwatch()
    go_on = None if seconds is None else (lambda done: took().seconds <= seconds)

    def enough(so_far: Batches) -> bool:
        # Before this many batches the standard error of a standard error exceeds 13 %.
        if layers and len(so_far.seeds) < 32:
            return False
        return all(width_to_reach(compared(so_far, layer), margin) < 1 for layer in layers)

    traced = monte_carlo_batches(
        scene,
        estimator,
        batches=batches,
        samples=samples,
        counts=counts,
        enough=enough,
        go_on=go_on,
        elsewhere=None if spread is None else spread(estimator, samples, counts),
    ).batches
    # Judged on all batches that were traced, whichever rule ended the run.
    results = {layer: compared(traced, layer) for layer in layers}
    return {
        layer: Agreement(
            estimator=cast(Estimator, estimator),
            layer=cast(Layer, layer),
            width=plain.distance.shape[1],
            height=plain.distance.shape[0],
            batches=len(traced.seeds),
            samples=traced.samples,
            epsilon=epsilon,
            masked=int((~masks[layer]).sum()),
            statistics=results[layer],
            uncorrected_bias=_bias(getattr(plain, layer), traced, layer, masks[layer]),
            finished=width_to_reach(results[layer], margin) < 1,
        )
        for layer in layers
    }


def agreements(
    scene,
    margins: Mapping[str, float],
    *,
    batches: int = 256,
    samples: Mapping[str, int] | None = None,
    seconds: float | None = None,
    points: int | None = None,
    spread: ElsewhereFor | None = None,
) -> dict[str, Agreement]:
    """Compare several estimators with the quadrature image.

    By estimator there are the `margins` of the relative bias [1] and the `samples`; each takes so
    many `batches` and `seconds` at most; `points`: see `agreement`. The result is by estimator and
    layer, as in 'volpath airlight', without volpath where it cannot trace the scene.
    """
    by_name: dict[str, Agreement] = {}
    for estimator, margin in margins.items():
        by_layer: dict[str, Agreement] = {}
        with suppress(CannotTrace):
            by_layer = agreement(
                scene,
                estimator=estimator,
                margin=margin,
                batches=batches,
                samples=(samples or {}).get(estimator, _SAMPLES),
                seconds=seconds,
                points=points,
                spread=spread,
            )
        by_name |= {f"{estimator} {layer}": result for layer, result in by_layer.items()}
    return by_name


def reference_estimate(
    image: ReferenceImage, layer: str, test: NoisyImage, mask: Bools
) -> NoisyImage:
    """Return a layer of a quadrature image as the reference of a comparison of the pixels of
    a mask with some batches.

    Under area lights it has standard errors, of `REPLICATES` scramblings, and the mean over the
    image of each. A value that no sample of the batches reached has no standard error of theirs,
    and must not be judged by the quadrature's standard error alone.
    """
    error = reference_error(image, layer)
    # A zero error of the batches says that no sample reached the value, not that it is exact.
    reached = np.asarray(test.standard_error) > 0
    if error is None or not error.any():
        return NoisyImage(reference_layer(image, layer))
    # Each replicate's mean over the image: the mean of the values plus what this replicate adds,
    # with the mean of these removed.
    values, means = reference_layer(image, layer), None
    if image.replicate_means is not None and mask.all():
        added = image.replicate_means[LAYERS.index(layer)]
        means = values.mean(axis=(0, 1)) + added - added.mean(axis=0)
    return NoisyImage(values, np.where(reached, error, 0.0), REPLICATES, means)


def _bias(expected: Array, batches: Batches, layer: str, mask: Bools) -> float:
    return float(layer_mean(batches, layer, mask)[mask].sum() / expected[mask].sum() - 1)


def layer_masks(reference: ReferenceScene, image: ReferenceImage) -> dict[str, Bools]:
    """Return the pixels to compare, by layer, (height, width): of the airlight those whose
    ray keeps off the lights.
    """
    # At two pixel widths from a light: closer rays have heavy tails in the samples. Infinite values
    # of the quadrature are left out, too.
    near = image.light_angle <= MASK_PIXELS * pixel_angle(reference)
    return {
        "airlight": ~near & np.isfinite(image.airlight).all(axis=2),
        "surface": np.ones_like(near),
    }


def layer_mean(batches: Batches, layer: str, mask: Bools) -> Array:
    """Return the mean image of a layer, (height, width, 3) [W/(m^2 sr)]; the mask,
    (height, width), gives its size.
    """
    return batches.mean[LAYERS.index(layer)].reshape(*mask.shape, 3)


def batch_estimate(batches: Batches, layer: str, mask: Bools) -> NoisyImage:
    """Return a layer of some batches as one side of a comparison of the pixels of a mask."""
    number = LAYERS.index(layer)
    return NoisyImage(
        layer_mean(batches, layer, mask),
        batches.standard_error[number].reshape(*mask.shape, 3),
        len(batches.seeds),
        # Batch means are means over whole images.
        batches.totals[:, number] if mask.all() else None,
    )


def widest_interval(statistics: Statistics) -> tuple[float, float] | None:
    """Return the ends of the wider of the 95 % intervals of the relative bias [1];
    None where none is known.
    """
    intervals = [statistics.relative_bias_ci, statistics.relative_bias_ci_batches or (None, None)]
    finite = [(low, high) for low, high in intervals if low is not None and high is not None]
    return max(finite, key=lambda pair: pair[1] - pair[0], default=None)


def width_to_reach(statistics: Statistics, margin: float) -> float:
    """Return the half width of the wider interval over 0.4 times `margin` [1], both
    relative: runs stop below 1.
    """
    widest = widest_interval(statistics)
    return math.inf if widest is None else 0.5 * (widest[1] - widest[0]) / (0.4 * margin)


def pixel_angle(reference: ReferenceScene) -> float:
    """Return the angle between the two pixels in the middle of the image [rad]."""
    # The pixel in the middle and the one to its left, or above it in an image of one column. A
    # single pixel has no neighbour, and the angle 0.
    middle = (reference.height // 2) * reference.width + reference.width // 2
    beside = max(middle - 1, 0)
    return float(
        np.arccos(np.clip(reference.direction[middle] @ reference.direction[beside], -1, 1))
    )
