# SPDX-License-Identifier: BSD-3-Clause
"""Tests of the tests: faults of the physics put into copies of the estimators, and whether the standard run finds them.

The standard run is what a report does: the images of one estimator are compared with those of another, layer by layer
on small images of the built-in scenes, and agree where the 95 % interval of the pooled relative bias lies inside the
margin (`validation.estimates.agreement`). A mutation is caught where they no longer agree. If they did not agree
without any mutation, that would prove nothing, so the unchanged copy runs through the same machinery first: the
control.
"""

import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import ndtr

from validation.estimates.agreement import layer_mean, widest_interval
from validation.mutations.catalogue import MUTATIONS
from validation.mutations.module_copies import ModuleCopies, module_source, replaced_once
from validation.mutations.record import TOPS, Mutation
from validation.mutations.test_beds import (
    SCENES,
    Stage,
    batch_statistics,
    distance_batches,
    image_statistics,
    loaded_stage,
    stage_of,
)
from validation.scenes.probes import PROBES, WIDE_PROBES
from validation.statistics.comparison import Statistics

Array = NDArray[np.float64]
Progress = Callable[[float, str], None]

CONTROL = ""  #: in the place of a mutation's name: what is seen without one

#: Share of the mutations that the standard run must catch: 18 of 20.
LEAST_CAUGHT = 0.9


@dataclass(frozen=True)
class Sighting:
    """One comparison of a changed estimator with an unchanged one."""

    scene: str
    built_in: bool
    layer: str  #: 'airlight' or 'surface'
    against: str  #: the estimator that was left as it is
    margin: float
    true_bias: float  #: relative change of the image by the fault, free of noise or with the same random numbers
    relative_bias: float  #: of the changed estimator, as seen against the other one
    interval: tuple[float, float]  #: the wider of its 95 % intervals
    detectable_bias: float
    chance: float  #: probability that a run with other seeds does not agree either
    nonfinite: int  #: pixels that the change made infinite or not a number
    rejected: int  #: pixels rejected at Sidak's level, for the record: the verdict is that of the bias
    expected_rejections: float
    agrees: bool


Seen = dict[str, tuple[Sighting, ...]]  #: by the name of a mutation what was seen of it on a stage
#: Names of stages, mutations, size and margin -> by stage what is seen there, as of `seen_on_stage`.
Elsewhere = Callable[[tuple[str, ...], tuple[Mutation, ...], tuple[int, int], float], Mapping[str, Seen]]


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
        return all(sighting.agrees for sighting in self.control) and self.caught >= LEAST_CAUGHT * len(self.results)


def study_mutations(
    mutations: Sequence[Mutation] = MUTATIONS,
    *,
    size: tuple[int, int] = (48, 36),
    margin: float = 0.01,
    progress: Progress | None = None,
    elsewhere: Elsewhere | None = None,
) -> MutationStudy:
    """Put every mutation through the standard run.

    Parameters
    ----------
    mutations
        What to change.
    size
        Width and height of the images [pixels].
    margin
        Of the relative bias against volpath; that against single-scatter is a twentieth of it. Both run until their
        intervals are narrow enough.
    progress
        Called with (share done, what) now and then.
    elsewhere
        Looks at stages in other processes; what these do not bring is done here.
    """
    tell = progress or (lambda share, what: None)
    names = (*SCENES, *PROBES, *(WIDE_PROBES if any(mutation.wide for mutation in mutations) else ()))
    by_stage = dict(elsewhere(names, tuple(mutations), size, margin)) if elsewhere else {}
    for number, name in enumerate(names):
        tell(number / len(names), f"images and faults, {name}")
        if name not in by_stage:
            by_stage[name] = seen_on_stage(name, mutations, size, margin)

    def on_all(name: str) -> tuple[Sighting, ...]:
        return tuple(sighting for stage in names for sighting in by_stage[stage].get(name, ()))

    return MutationStudy(on_all(CONTROL), tuple(judged(mutation, on_all(mutation.name)) for mutation in mutations))


def seen_on_stage(name: str, mutations: Sequence[Mutation], size: tuple[int, int], margin: float) -> Seen:
    """Return what is seen of the mutations on one stage, by their names, and of the unchanged copy as `CONTROL`."""
    stage = stage_of(name, loaded_stage(name, size), margin=margin)
    tried = [mutation for mutation in mutations if (stage.plan is not None) == mutation.wide]
    return {CONTROL: seen(None, [stage])} | {mutation.name: seen(mutation, [stage]) for mutation in tried}


def seen(mutation: Mutation | None, stages: Sequence[Stage]) -> tuple[Sighting, ...]:
    """Compare a changed estimator with the unchanged ones on every stage; None changes nothing."""
    copies = copies_with(mutation)
    look = _single_scatter_seen if mutation is not None and mutation.estimator == "single-scatter" else _quadrature_seen
    # A mutation may divide by zero or overflow: its image shows that.
    with warnings.catch_warnings(), np.errstate(all="ignore"):
        warnings.simplefilter("ignore")
        return tuple(sighting for stage in stages for sighting in look(copies, stage))


def copies_with(mutation: Mutation | None) -> ModuleCopies:
    """Return copies of an estimator's modules with one mutation in them, or with none."""
    if mutation is None:
        return ModuleCopies("analytic.panels", module_source("analytic.panels"), TOPS["quadrature"])
    source = replaced_once(mutation.module, mutation.old, mutation.new)
    return ModuleCopies(mutation.module, source, TOPS[mutation.estimator])


def _quadrature_seen(copies: ModuleCopies, stage: Stage) -> Iterator[Sighting]:
    """Compare a changed quadrature with every opponent."""
    truth = copies["reference.scene.read"].read_truth(stage.scene)
    for opponent in stage.opponents:
        images = copies["reference.quadrature.image"].quadrature_image(
            truth, shadow_scale=opponent.shadow_scale, plan=stage.plan
        )
        for layer, mask in stage.masks.items():
            image, unchanged = getattr(images, layer), getattr(opponent.image, layer)
            statistics = image_statistics(opponent, layer, image, mask)
            yield _sighting(stage, layer, opponent.estimator, statistics, _change(image, unchanged, mask))


def _single_scatter_seen(copies: ModuleCopies, stage: Stage) -> Iterator[Sighting]:
    """Compare a changed single-scatter with the quadrature, by as many batches as the unchanged one has."""
    opponent = next(each for each in stage.opponents if each.estimator == "single-scatter")
    truth = copies["reference.scene.read"].read_truth(stage.scene)
    batch = copies["reference.monte_carlo.single_scatter.integrator"].single_scatter_batch
    batches = distance_batches(batch, truth, len(opponent.batches.seeds))
    for layer, mask in stage.masks.items():
        # The same seeds: what differs is the mutation, but for noise where paths part.
        change = _change(layer_mean(batches, layer, mask), layer_mean(opponent.batches, layer, mask), mask)
        yield _sighting(stage, layer, "quadrature", batch_statistics(opponent, layer, batches, mask), change)


def _change(image: Array, unchanged: Array, mask: NDArray[np.bool_]) -> tuple[float, int]:
    """Return the relative change of the sum over the pixels that are finite, and how many are not."""
    finite = np.isfinite(image).all(axis=2) & mask
    change = float(image[finite].sum() / unchanged[finite].sum() - 1) if finite.any() else float("nan")
    return change, int(mask.sum() - finite.sum())


def _sighting(stage: Stage, layer: str, against: str, statistics: Statistics, change: tuple[float, int]) -> Sighting:
    (true_bias, nonfinite), interval, margin = change, widest_interval(statistics), statistics.margin or 0.0
    return Sighting(
        scene=stage.name,
        built_in=stage.name in SCENES,
        layer=layer,
        against=against,
        margin=margin,
        true_bias=true_bias,
        relative_bias=statistics.relative_bias,
        interval=interval,
        detectable_bias=statistics.detectable_bias,
        chance=1.0 if nonfinite else _chance(true_bias, interval, margin),
        nonfinite=nonfinite,
        rejected=statistics.rejected,
        expected_rejections=statistics.expected_rejections,
        agrees=bool(statistics.equivalent) and nonfinite == 0,
    )


def _chance(bias: float, interval: tuple[float, float], margin: float) -> float:
    """Return the probability that an interval of this width about a bias b plus noise leaves the margin m.

    The noise is normal with the standard error s, the half width H = 1.96 s: agreement needs |b + noise| < m - H, which
    happens with the probability Phi((m - H - b)/s) - Phi((-m + H - b)/s), never where H > m.
    """
    half = 0.5 * (interval[1] - interval[0])
    error, room = half / 1.96, margin - half
    if error <= 0:
        return float(abs(bias) >= margin)
    agrees = ndtr((room - bias) / error) - ndtr((-room - bias) / error) if room > 0 else 0.0
    return float(1 - agrees)


def judged(mutation: Mutation, sightings: Sequence[Sighting]) -> MutationResult:
    """Sum up what was seen of one mutation."""
    by_built_in = any(not sighting.agrees for sighting in sightings if sighting.built_in)
    caught = any(not sighting.agrees for sighting in sightings)
    clearest = max(sightings, key=_clearness)
    reason = (
        ""
        if by_built_in
        else _reason(mutation, [sighting for sighting in sightings if sighting.built_in] or list(sightings))
    )
    return MutationResult(
        mutation.name,
        mutation.meaning,
        mutation.estimator,
        mutation.module,
        caught,
        by_built_in,
        # The scenes have seeds of their own; so have the two layers of one.
        float(1 - np.prod([1 - sighting.chance for sighting in sightings])),
        clearest,
        tuple(sightings),
        reason,
    )


def _clearness(sighting: Sighting) -> tuple[bool, bool, float]:
    """Return a key that puts the clearest failure last, and one in a built-in scene behind those in probes.

    Its third entry says how many margins the nearer end of the interval is away from zero.
    """
    low, high = sighting.interval
    away = max(low, -high) / sighting.margin
    return (not sighting.agrees, sighting.built_in, np.inf if sighting.nonfinite or not np.isfinite(away) else away)


def _reason(mutation: Mutation, sightings: Sequence[Sighting]) -> str:
    most = max(sightings, key=lambda sighting: abs(sighting.true_bias) / sighting.margin)
    measured = (
        f"the fault changes {most.scene}, {most.layer}, by {100 * most.true_bias:+.3g} %, no other more; "
        f"its margin there is ±{100 * most.margin:g} %"
        if most.true_bias
        else "no image of theirs changes"
    )
    return f"{mutation.remark}; {measured}" if mutation.remark else measured
