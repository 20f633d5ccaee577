# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the tests: faults of the physics put into copies of the estimators, and whether the standard run finds them.

The standard run is what a report does: the images of one estimator are compared with those of another, layer by layer
on small images of the built-in scenes, and agree where the 95 % interval of the pooled relative bias lies inside the
margin (`validation.agreement`). A mutation is caught where that verdict is no longer given. What it is not given for
without any mutation proves nothing, so the unchanged copy is run through the same machinery first: the control.
"""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reference.batches import LAYERS, Batches
from reference.epsilon import measure_shadow_epsilon
from reference.quadrature import TruthImage
from validation.agreement import MASK_PIXELS, pixel_angle
from validation.load import load_scene
from validation.module_copies import ModuleCopies, module_source, replaced_once
from validation.mutation_catalogue import MUTATIONS, TOPS, Mutation
from validation.probe_scenes import PROBES
from validation.statistics import Estimate, Statistics, compare_statistics
from validation.truth import truth_image, volpath_batches

Progress = Callable[[float, str], None]

#: Built-in scenes of the standard run.
SCENES = ("open-fog", "sphere-spot", "colonnade", "two-pens")
#: Share of the mutations that the standard run must catch: 18 of 20.
LEAST_CAUGHT = 0.9
_BATCHES, _SAMPLES, _LEAST = 4096, 256, 32


@dataclass(frozen=True)
class Opponent:
    """The batches of an unchanged Monte Carlo estimator."""

    estimator: str
    batches: Batches
    image: TruthImage  #: what the unchanged quadrature expects of it
    shadow_scale: float  #: the share of the leg from the light that it attenuates over
    margin: float  #: of the relative bias against it


@dataclass(frozen=True)
class Stage:
    """A scene with the images that a changed estimator is compared with."""

    name: str
    scene: Any  #: the `mi.Scene`
    truth: TruthImage
    masks: dict[str, NDArray[np.bool_]]  #: pixels to compare, by layer
    opponents: tuple[Opponent, ...]


@dataclass(frozen=True)
class Sighting:
    """One comparison of a changed estimator with an unchanged one."""

    scene: str
    built_in: bool
    layer: str  #: 'airlight' or 'surface'
    against: str  #: the estimator that was left as it is
    margin: float
    true_bias: float  #: relative change of the image by the fault, free of noise
    relative_bias: float  #: of the changed estimator, as seen against the other one
    interval: tuple[float, float]  #: the wider of its 95 % intervals
    detectable_bias: float
    chance: float  #: probability that a run with other seeds does not agree either
    nonfinite: int  #: pixels that the change made infinite or not a number
    rejected: int  #: pixels rejected at Sidak's level, for the record: the verdict is that of the bias
    expected_rejections: float
    agrees: bool


@dataclass(frozen=True)
class MutationResult:
    """Whether one mutation was caught, and how."""

    name: str
    meaning: str
    estimator: str
    module: str
    caught: bool
    caught_by_built_in: bool  #: whether a built-in scene caught it, not a probe alone
    chance: float  #: probability that a run with other seeds catches it
    clearest: Sighting  #: the comparison that shows it best, in a built-in scene if one does
    sightings: tuple[Sighting, ...]
    reason: str  #: why it was not caught by the built-in scenes, empty where it was


@dataclass(frozen=True)
class MutationStudy:
    """All mutations."""

    control: tuple[Sighting, ...]  #: the same comparisons without a mutation
    results: tuple[MutationResult, ...]

    @property
    def caught(self) -> int:
        """Number of mutations caught."""
        return sum(result.caught for result in self.results)

    @property
    def passed(self) -> bool:
        """Whether the control agrees everywhere and enough mutations were caught."""
        return all(one.agrees for one in self.control) and self.caught >= LEAST_CAUGHT * len(self.results)


def study_mutations(
    mutations: Sequence[Mutation] = MUTATIONS,
    *,
    size: tuple[int, int] = (48, 36),
    margin: float = 0.005,
    progress: Progress | None = None,
) -> MutationStudy:
    """Put every mutation through the standard run.

    Parameters
    ----------
    mutations
        What to change.
    size
        Width and height of the images [pixels].
    margin
        Of the relative bias against volpath; volpath runs until its interval is narrow enough for it.
    progress
        Called with (share done, what) now and then.
    """
    tell = progress or (lambda share, what: None)
    names = (*SCENES, *PROBES)
    stages = []
    for number, name in enumerate(names):
        tell(0.7 * number / len(names), f"volpath, {name}")
        stages.append(stage_of(name, loaded_stage(name, size), margin=margin))
    control = seen(None, stages)
    results = []
    for number, mutation in enumerate(mutations):
        tell(0.7 + 0.3 * number / len(mutations), mutation.name)
        results.append(judged(mutation, seen(mutation, stages)))
    return MutationStudy(control, tuple(results))


def loaded_stage(name: str, size: tuple[int, int]):
    """Load a built-in scene or a probe of `validation.probe_scenes`, as a `mi.Scene` of a size [pixels]."""
    import mitsuba as mi

    if name not in PROBES:
        return load_scene(name, size).scene
    dictionary = PROBES[name]()
    dictionary["sensor"]["film"] |= {"width": size[0], "height": size[1]}
    return mi.load_dict(dictionary)


def stage_of(name: str, scene, *, margin: float, samples: int = _SAMPLES) -> Stage:
    """Return a Mitsuba scene with its unchanged images."""
    truth = truth_image(scene)
    near = truth.light_angle <= MASK_PIXELS * pixel_angle(scene)
    masks = {"airlight": ~near & np.isfinite(truth.airlight).all(axis=2), "surface": np.ones_like(near)}
    masks = {layer: mask for layer, mask in masks.items() if np.any(getattr(truth, layer) > 0)}

    shadow_scale = 1 - measure_shadow_epsilon()
    shortened = truth_image(scene, shadow_scale=shadow_scale)

    def opponent(found: Batches) -> Opponent:
        return Opponent("volpath", found, shortened, shadow_scale, margin)

    def enough(found: Batches) -> bool:
        """Look at the spread alone, as `validation.agreement` does: stopping favours no verdict."""
        if len(found.seeds) < _LEAST:
            return False
        compared = (
            _statistics(opponent(found), layer, getattr(shortened, layer), mask) for layer, mask in masks.items()
        )
        return all(0.5 * np.ptp(_widest(one)) < 0.4 * margin for one in compared)

    found = volpath_batches(scene, batches=_BATCHES, samples=samples, enough=enough)
    return Stage(name, scene, truth, masks, (opponent(found),))


def seen(mutation: Mutation | None, stages: Sequence[Stage]) -> tuple[Sighting, ...]:
    """Compare a changed estimator with the unchanged ones on every stage; None changes nothing."""
    copies = copies_with(mutation)
    sightings: list[Sighting] = []
    for stage in stages:
        for opponent in stage.opponents:
            # A mutation may divide by zero or overflow: its image shows that.
            with warnings.catch_warnings(), np.errstate(all="ignore"):
                warnings.simplefilter("ignore")
                truth = copies["reference.scene"].read_truth(stage.scene)
                image = copies["reference.quadrature"].quadrature_image(truth, shadow_scale=opponent.shadow_scale)
                sightings += [_sighting(stage, opponent, layer, getattr(image, layer)) for layer in stage.masks]
    return tuple(sightings)


def copies_with(mutation: Mutation | None) -> ModuleCopies:
    """Return copies of an estimator's modules with one mutation in them, or with none."""
    if mutation is None:
        return ModuleCopies("analytic.panels", module_source("analytic.panels"), TOPS)
    return ModuleCopies(mutation.module, replaced_once(mutation.module, mutation.old, mutation.new), TOPS)


def _sighting(stage: Stage, opponent: Opponent, layer: str, image: NDArray[np.float64]) -> Sighting:
    mask = stage.masks[layer]
    found = _statistics(opponent, layer, image, mask)
    finite = np.isfinite(image).all(axis=2) & mask
    nonfinite = int(mask.sum() - finite.sum())
    true_bias = (
        float(image[finite].sum() / getattr(opponent.image, layer)[finite].sum() - 1) if finite.any() else np.nan
    )
    interval = _widest(found)
    return Sighting(
        stage.name,
        stage.name in SCENES,
        layer,
        opponent.estimator,
        opponent.margin,
        true_bias,
        found.relative_bias,
        interval,
        found.detectable_bias,
        1.0 if nonfinite else _chance(true_bias, interval, opponent.margin),
        nonfinite,
        found.rejected,
        found.expected_rejections,
        bool(found.equivalent) and nonfinite == 0,
    )


def _statistics(opponent: Opponent, layer: str, image: NDArray[np.float64], mask: NDArray[np.bool_]) -> Statistics:
    """Compare an image without random error with the batches of an opponent."""
    number, batches = LAYERS.index(layer), opponent.batches
    estimate = Estimate(
        batches.mean[number].reshape(image.shape),
        batches.standard_error[number].reshape(image.shape),
        len(batches.seeds),
        # The batch means are those of whole images.
        batches.totals[:, number] if mask.all() else None,
    )
    return compare_statistics(estimate, Estimate(image), mask=mask, margin=opponent.margin)


def _widest(found: Statistics) -> tuple[float, float]:
    intervals = [found.relative_bias_ci, found.relative_bias_ci_batches]
    return max((pair for pair in intervals if pair is not None), key=lambda pair: pair[1] - pair[0])


def _chance(bias: float, interval: tuple[float, float], margin: float) -> float:
    """Return the probability that an interval of this width about a bias b plus noise leaves the margin m.

    The noise is normal with the standard error s, the half width H = 1.96 s: agreement needs |b + noise| < m - H, which
    happens with the probability Phi((m - H - b)/s) - Phi((-m + H - b)/s), never where H > m.
    """
    from scipy.special import ndtr

    half = 0.5 * (interval[1] - interval[0])
    error, room = half / 1.96, margin - half
    if error <= 0:
        return float(abs(bias) >= margin)
    agrees = ndtr((room - bias) / error) - ndtr((-room - bias) / error) if room > 0 else 0.0
    return float(1 - agrees)


def judged(mutation: Mutation, sightings: Sequence[Sighting]) -> MutationResult:
    """Sum up what was seen of one mutation."""
    by_built_in = any(not one.agrees for one in sightings if one.built_in)
    caught = any(not one.agrees for one in sightings)
    clearest = max(sightings, key=_clearness)
    reason = "" if by_built_in else _reason(mutation, [one for one in sightings if one.built_in] or list(sightings))
    return MutationResult(
        mutation.name,
        mutation.meaning,
        mutation.estimator,
        mutation.module,
        caught,
        by_built_in,
        # The scenes have seeds of their own; so have the two layers of one.
        float(1 - np.prod([1 - one.chance for one in sightings])),
        clearest,
        tuple(sightings),
        reason,
    )


def _clearness(one: Sighting) -> tuple[bool, bool, float]:
    """Return a key that puts the clearest failure last, and one in a built-in scene behind those in probes.

    Its third entry says how many margins the nearer end of the interval is away from zero.
    """
    low, high = one.interval
    away = max(low, -high) / one.margin
    return (not one.agrees, one.built_in, np.inf if one.nonfinite or not np.isfinite(away) else away)


def _reason(mutation: Mutation, sightings: Sequence[Sighting]) -> str:
    most = max(sightings, key=lambda one: abs(one.true_bias))
    measured = (
        f"the fault changes {most.scene}, {most.layer}, by {100 * most.true_bias:+.3g} %, no other more"
        if most.true_bias
        else "no image of theirs changes"
    )
    return f"{mutation.remark}; {measured}" if mutation.remark else measured
