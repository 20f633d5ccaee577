# SPDX-License-Identifier: BSD-3-Clause
"""Where faults are tried: small scenes with the unchanged images of the estimators, and what
a changed one must meet.

A changed quadrature is compared with the batches of the unchanged `single-scatter`, and a changed
`single-scatter` with the unchanged quadrature, layer by layer. They agree where the 95 % interval
of the pooled relative bias lies inside the margin, as in a report
(`validation.estimates.agreement`). Where a stage has volpath too, a changed quadrature has a second
opponent, at a wider margin.
"""

import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from functools import reduce
from typing import Any

import mitsuba as mi
import numpy as np
from numpy.typing import NDArray

from airlight.reference.monte_carlo import volpath
from airlight.reference.monte_carlo.batches import LAYERS, Batches, merged
from airlight.reference.monte_carlo.single_scatter import integrator as single_scatter
from airlight.reference.quadrature import image as quadrature
from airlight.reference.quadrature.image import ReferenceImage
from airlight.reference.quadrature.replicates import PointPlan
from airlight.reference.scene import read
from airlight.reference.scene.model import PHYSICAL, Model
from airlight.reference.scene.shadow_epsilon import measure_shadow_epsilon
from airlight.validation.estimates.agreement import (
    batch_estimate,
    layer_masks,
    reference_estimate,
    width_to_reach,
)
from airlight.validation.scenes.loading import load_scene, resize
from airlight.validation.statistics.comparison import compare_statistics
from tests.evidence.injected import injected
from tests.evidence.mutations import Mutation
from tests.helpers.probes import PROBES, WIDE_PROBES

#: Margins of the relative bias of quadrature against single-scatter, by stage: of airlight and
#: surface [1]. Each fault that is found on a stage exceeds one of them.
MARGINS = {
    "many-lights": (5e-4, 5e-4),
    "two-pens": (5e-4, 5e-4),
    "rayleigh": (5e-4, 5e-4),
    "sun": (2e-3, 2e-3),  # its media have bounds that batches feel as noise
    "wide-lights": (0.01, 0.005),  # eight times PLAN points, which all pixels share
    "own-equation": (5e-4, 5e-4),
}
#: The equation of the stage `own-equation`, in which every term counts, and none hides another.
EQUATION = Model(
    light_path="0.4",
    camera_path="0.7",
    law="softened:0.3:2",
    range="quartic:9",
    spot="cosine-smooth",
    depth="axis",
    ends="planes:0.5:11",
)
VOLPATH_MARGIN = 0.01
#: Points of each of eight replicates under area lights.
PLAN = PointPlan(error=0.0, first=128, most=128)
_DISTANCES, _SAMPLES = 64, 256  # of single-scatter and volpath, a pixel and batch
# batches; under area lights the points of the quadrature leave more
_LEAST, _MOST, _MOST_WIDE = 32, 1024, 64


@dataclass(frozen=True)
class Stage:
    """A scene with the images of unchanged estimators."""

    scene: Any  # the `mi.Scene`
    model: Model
    image: ReferenceImage
    masks: dict[str, NDArray[np.bool_]]  # pixels to compare, by layer
    margins: dict[str, float]  # by layer
    batches: Batches  # of single-scatter


@dataclass(frozen=True)
class Sighting:
    """One comparison of a changed estimator with an unchanged one."""

    layer: str
    against: str
    bias: float
    interval: tuple[float, float]
    agrees: bool


def stage_scene(name: str) -> Any:
    """Return a built-in scene, a probe, or the probe `many-lights`, in air as `rayleigh`."""
    size = (16, 12) if name in WIDE_PROBES else (24, 18)
    if name in PROBES | WIDE_PROBES:
        entries = (PROBES | WIDE_PROBES)[name]()
    elif name == "own-equation":
        entries = PROBES["many-lights"]()
    elif name == "rayleigh":
        entries = PROBES["many-lights"]()
        entries["fog"] |= {"phase": {"type": "rayleigh"}}
    else:
        return load_scene(name, size).scene
    scene = mi.load_dict(entries)
    resize(scene, size)
    return scene


def stage_of(name: str) -> Stage:
    """Return a stage; single-scatter runs until its intervals are narrow
    enough, whatever they say.
    """
    scene, margins = stage_scene(name), dict(zip(LAYERS, MARGINS[name]))
    model = EQUATION if name == "own-equation" else PHYSICAL
    reference = read.read_reference(scene, model)
    image = quadrature.quadrature_image(reference, plan=PLAN)
    masks = {
        layer: mask
        for layer, mask in layer_masks(reference, image).items()
        if np.any(getattr(image, layer) > 0)
    }
    batches = _batches(reference, range(_LEAST))
    most = _MOST_WIDE if name in WIDE_PROBES else _MOST
    while len(batches.seeds) < most and not all(
        width_to_reach(_statistics(image, batches, layer, mask, margins[layer]), margins[layer]) < 1
        for layer, mask in masks.items()
    ):
        batches = merged(
            batches, _batches(reference, range(len(batches.seeds), 2 * len(batches.seeds)))
        )
    return Stage(scene, model, image, masks, margins, batches)


def _batches(reference, seeds: range) -> Batches:
    return reduce(
        merged, (single_scatter.single_scatter_batch(reference, seed, _DISTANCES) for seed in seeds)
    )


def _statistics(image: ReferenceImage, batches: Batches, layer: str, mask: Any, margin: float):
    test = batch_estimate(batches, layer, mask)
    return compare_statistics(
        reference_estimate(image, layer, test, mask), test, mask=mask, margin=margin
    )


def seen(estimator: str, mutation: Mutation | None, stage: Stage) -> Iterator[Sighting]:
    """Compare an estimator with the other one, changed by a mutation, or not at all."""
    # A fault may divide by zero or overflow: its image shows that.
    with (
        injected(*([mutation.change] if mutation else [])),
        np.errstate(all="ignore"),
        warnings.catch_warnings(),
    ):
        warnings.simplefilter("ignore")
        reference = read.read_reference(stage.scene, stage.model)
        image, batches = stage.image, stage.batches
        if estimator == "quadrature":
            image = quadrature.quadrature_image(reference, plan=PLAN)
        else:
            batches = _batches(reference, range(len(batches.seeds)))
    against = "single-scatter" if estimator == "quadrature" else "quadrature"
    for layer, mask in stage.masks.items():
        yield _sighting(image, batches, layer, mask, stage.margins[layer], against)


def _sighting(
    image: ReferenceImage, batches: Batches, layer: str, mask: Any, margin: float, against: str
) -> Sighting:
    finite = (
        np.isfinite(getattr(image, layer)[mask]).all()
        and np.isfinite(batches.mean[LAYERS.index(layer)]).all()
    )
    if not finite:
        return Sighting(layer, against, float("nan"), (-np.inf, np.inf), agrees=False)
    statistics = _statistics(image, batches, layer, mask, margin)
    low, high = statistics.relative_bias_ci
    return Sighting(
        layer, against, statistics.relative_bias, (low, high), bool(statistics.equivalent)
    )


def volpath_seen(mutation: Mutation | None, stage: Stage, batches: int) -> list[Sighting]:
    """Compare a quadrature that may be changed with volpath, over its shortened shadow rays."""
    reference = read.read_reference(stage.scene)
    traced = reduce(
        merged, (volpath.volpath_batch(reference, seed, _SAMPLES) for seed in range(batches))
    )
    with injected(*([mutation.change] if mutation else [])), np.errstate(all="ignore"):
        image = quadrature.quadrature_image(
            read.read_reference(stage.scene), shadow_scale=1 - measure_shadow_epsilon()
        )
    return [
        _sighting(image, traced, layer, mask, VOLPATH_MARGIN, "volpath")
        for layer, mask in stage.masks.items()
    ]
