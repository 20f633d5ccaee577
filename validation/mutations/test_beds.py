# SPDX-License-Identifier: BSD-3-Clause
"""Where mutations are tried: small scenes with the unchanged images of every estimator."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import reduce
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from reference.monte_carlo.batches import Batches, merged
from reference.quadrature.image import quadrature_image
from reference.quadrature.light_points import PointPlan
from reference.quadrature.ray_values import TruthImage
from reference.scene.read import TruthScene, read_truth
from reference.scene.shadow_epsilon import measure_shadow_epsilon
from validation.estimates.agreement import batch_estimate, layer_masks, width_to_reach
from validation.estimates.monte_carlo import monte_carlo_batches
from validation.estimates.quadrature import truth_image
from validation.scenes.loading import load_scene, resize
from validation.scenes.probes import PROBES, WIDE_PROBES
from validation.statistics.comparison import Estimate, Statistics, compare_statistics

Array = NDArray[np.float64]
Batch = Callable[[TruthScene, int, int], Batches]

#: Built-in scenes of the standard run.
SCENES = ("open-fog", "sphere-spot", "colonnade", "two-pens")
#: The margin against single-scatter is that against volpath over this: it has so much less noise.
SHARPER = 20.0
#: Under lights with extent, where the quadrature of a stage has errors of its own, of 3e-4 in the mean.
WIDE_SHARPER = 4.0
#: Points and lines of each of eight replicates there, the same for every ray.
WIDE_PLAN = PointPlan(error=0.0, first=32, most=32)
_LEAST, _MOST = 32, 4096  # batches
_SAMPLES = 256  # of volpath, a pixel and batch
_DISTANCES = 64  # of single-scatter, a pixel and batch


@dataclass(frozen=True)
class Opponent:
    """The batches of an unchanged Monte Carlo estimator, and the unchanged quadrature image of the same integral."""

    estimator: str
    batches: Batches
    image: TruthImage
    shadow_scale: float  #: the share of the leg from the light that both attenuate over
    margin: float  #: of the relative bias of one against the other


@dataclass(frozen=True)
class Stage:
    """A scene with the images that a changed estimator is compared with."""

    name: str
    scene: Any  #: the `mi.Scene`
    masks: dict[str, NDArray[np.bool_]]  #: pixels to compare, by layer
    opponents: tuple[Opponent, ...]
    plan: PointPlan | None = None  #: how many points stand for lights with extent


def loaded_stage(name: str, size: tuple[int, int]):
    """Load a built-in scene or a probe of `validation.scenes.probes`, as a `mi.Scene` of a size [pixels].

    Probes of lights with extent have half the width and height.
    """
    if name not in PROBES | WIDE_PROBES:
        return load_scene(name, size).scene
    scene = mi.load_dict((PROBES | WIDE_PROBES)[name]())
    if name in WIDE_PROBES:
        size = max(1, size[0] // 2), max(1, size[1] // 2)
    resize(scene, size)
    return scene


def stage_of(name: str, scene, *, margin: float) -> Stage:
    """Return a Mitsuba scene with its unchanged images; `margin` is that of the relative bias [1] against volpath.

    Both Monte Carlo estimators run until the half width of their intervals is below 0.4 times the margin, as in
    `validation.estimates.agreement`: a rule that looks at the spread alone, so that stopping favours no verdict.
    """
    wide = bool(read_truth(scene).area)
    plan = WIDE_PLAN if wide else None

    def unchanged(scale: float) -> TruthImage:
        if wide:
            return quadrature_image(read_truth(scene), shadow_scale=scale, plan=plan)
        return truth_image(scene, shadow_scale=scale)

    truth = unchanged(1.0)
    masks = layer_masks(read_truth(scene), truth)
    masks = {layer: mask for layer, mask in masks.items() if np.any(getattr(truth, layer) > 0)}

    def volpath(traced: Batches) -> Opponent:
        return Opponent("volpath", traced, shortened, shadow_scale, margin)

    def single_scatter(traced: Batches) -> Opponent:
        return Opponent("single-scatter", traced, truth, 1.0, margin / (WIDE_SHARPER if wide else SHARPER))

    def enough(opponent: Opponent) -> bool:
        if len(opponent.batches.seeds) < _LEAST:
            return False
        compared = (image_statistics(opponent, layer, getattr(truth, layer), mask) for layer, mask in masks.items())
        return all(width_to_reach(statistics, opponent.margin) < 1 for statistics in compared)

    shadow_scale = 1 - measure_shadow_epsilon()
    shortened = unchanged(shadow_scale)

    def run(name: str, samples: int, opponent: Callable[[Batches], Opponent]) -> Opponent:
        traced = monte_carlo_batches(
            scene, name, batches=_MOST, samples=samples, enough=lambda batches: enough(opponent(batches))
        )
        return opponent(traced.batches)

    opponents = run("volpath", _SAMPLES, volpath), run("single-scatter", _DISTANCES, single_scatter)
    return Stage(name, scene, masks, opponents, plan)


def distance_batches(batch: Batch, truth: TruthScene, count: int) -> Batches:
    """Return as many batches of a copy of single-scatter, with the seeds that the unchanged one has in a `Stage`.

    Parameters
    ----------
    batch
        The copy of `reference.monte_carlo.single_scatter.integrator.single_scatter_batch`.
    truth
        The scene.
    count
        How many; seeds count up from 0.
    """
    return reduce(merged, (batch(truth, seed, _DISTANCES) for seed in range(count)))


def image_statistics(opponent: Opponent, layer: str, image: Array, mask: NDArray[np.bool_]) -> Statistics:
    """Compare a quadrature image that may be changed with the batches of an opponent.

    Parameters
    ----------
    opponent
        The batches, unchanged.
    layer
        'airlight' or 'surface'.
    image
        The layer of the quadrature image, (height, width, 3) [W/(m^2 sr)].
    mask
        Pixels to compare, (height, width).
    """
    estimate = batch_estimate(opponent.batches, layer, mask)
    return compare_statistics(estimate, Estimate(image), mask=mask, margin=opponent.margin)


def batch_statistics(opponent: Opponent, layer: str, batches: Batches, mask: NDArray[np.bool_]) -> Statistics:
    """Compare batches that may be changed with the quadrature image of an opponent.

    Parameters
    ----------
    opponent
        The quadrature image, unchanged.
    layer
        'airlight' or 'surface'.
    batches
        Those that may be changed; radiances [W/(m^2 sr)].
    mask
        Pixels to compare, (height, width).
    """
    image = getattr(opponent.image, layer)
    estimate = batch_estimate(batches, layer, mask)
    return compare_statistics(Estimate(image), estimate, mask=mask, margin=opponent.margin)
