# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a report that belong to no scene of it: the stability of kernels, how
times grow, claims of papers.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from airlight.realtime.kernels.registry import KERNELS
from airlight.realtime.methods.shader.source import is_users
from airlight.reference.storage.code import source_digest
from airlight.reference.storage.store import Content, Inputs, Kept, is_kept, stored
from airlight.reports.machine.environment import machine
from airlight.reports.machine.own_process import in_own_process
from airlight.reports.machine.progress import Progress, counted, sharing
from airlight.validation.kernels.records import Stability
from airlight.validation.papers.claims import EFFORTS, Claim, claims, experiments, judged
from airlight.validation.study.configuration import Configuration, user_code
from airlight.validation.study.study import Study, standard_study
from airlight.validation.timing import Scaling


@dataclass(frozen=True)
class OtherPart:
    """A part of a report that belongs to no scene."""

    kind: str  #: 'stability', 'scaling' or 'papers'
    title: str  #: shown as the progress
    usual: float  #: roughly what it takes [s]
    inputs: Inputs  #: of its result
    compute: Callable[[Progress], Any]
    result_type: Any

    @property
    def seconds(self) -> float:
        """Expected time [s]."""
        return 0.0 if is_kept(self.inputs.key) else self.usual

    def result(self, progress: Progress) -> Kept[Any]:
        """Return its result, cached or computed."""
        return stored(self.inputs, lambda: self.compute(progress), self.result_type)


def other_parts(study: Study) -> list[OtherPart]:
    """Return the parts that a study asks for; claims of papers only with all
    scenes of a study of ours.
    """
    # Growth needs all scenes of its standard study, and so do the claims of papers: a report on one
    # scene has neither.
    parts = []
    if study.stability:
        parts.append(_stability_part(study.stability))
    if study.growth and set(standard_study("scaling").scenes) <= set(study.scenes):
        usual = standard_study("scaling")
        asked = replace(usual, measure=replace(usual.measure, seconds=study.measure.seconds))
        parts += [_scaling_part(work, asked) for work in study.growth]
    if study.name in EFFORTS and set(standard_study(study.name).scenes) <= set(study.scenes):
        parts += [_paper(name) for name in experiments_of(claims(), study.name)]
    return parts


# The modules of these inputs compute; the reports that show results are not among them.


# --- kernels --------------------------------------------------------------------------------------


@dataclass(frozen=True)
class StabilityInputs(Inputs):
    """The inputs of the stability of kernels."""

    kind = "report-stability"
    modules = ("airlight.validation.kernels.stability",)
    rays: int
    added: Mapping[str, tuple[Content, ...]]  #: kernels of the user, with their code
    machine: Mapping[str, str]  #: single precision rounds otherwise on another


def _stability_part(rays: int) -> OtherPart:
    added = {name: user_code(Configuration("", name)) for name in KERNELS if is_users(name)}
    compute = partial(_stability, rays, list(added))
    inputs = StabilityInputs(rays, added, machine())
    return OtherPart("stability", "stability", 20.0, inputs, compute, list[Stability])


def _stability(rays: int, added: list[str], progress: Progress) -> list[Stability]:
    """Return how stable kernels are. Nearly all of its time goes into compilation: a
    process compiles them quickly.
    """
    from airlight.validation.kernels.stability import stability

    how: dict[str, Any] = {
        "what": "study",
        "name": "of the kernels",
        "limit": math.inf,
        "quick": True,
    }
    # Kernels of users run in this process, which knows them; ours run in another one, which is told
    # to compile quickly.
    built_in: list[Stability] = in_own_process(known_kernels, rays, **how)
    return built_in + (stability(added, count=rays, progress=counted(progress)) if added else [])


def known_kernels(rays: int) -> list[Stability]:
    """Return how stable the kernels of airlight are, in a process that knows no others."""
    from airlight.validation.kernels.stability import stability

    return stability(count=rays)


# --- growth ---------------------------------------------------------------------------------------


@dataclass(frozen=True)
class ScalingInputs(Inputs):
    """The inputs of how times grow."""

    kind = "report-scaling"
    modules = ("airlight.validation.study.growth",)
    work: str  #: its kind
    study: Study
    machine: Mapping[str, str]


def _scaling_part(work: str, study: Study) -> OtherPart:
    inputs = ScalingInputs(work, study, machine())
    return OtherPart(
        "scaling", "how times grow", 80.0, inputs, partial(_scaling, work, study), list[Scaling]
    )


def _scaling(work: str, study: Study, progress: Progress) -> list[Scaling]:
    """Return how times grow with one kind of work."""
    from airlight.validation.study.growth import ladder, study_growth

    return study_growth(
        study, work, ladder(work, study.scenes[0], study.sizes[0]), progress=counted(progress)
    )


# --- claims of papers -----------------------------------------------------------------------------


def experiments_of(chosen: Sequence[Claim], effort: str = EFFORTS[-1]) -> list[str]:
    """Return the names of the experiments that claims need and that an effort has."""
    # Efforts are ordered: each includes the experiments of the ones before.
    needed = {claim.experiment for claim in chosen}
    most = EFFORTS.index(effort)
    return [
        name
        for name, each in experiments().items()
        if name in needed and EFFORTS.index(each.effort) <= most
    ]


@dataclass(frozen=True)
class PaperInputs(Inputs):
    """The inputs of the figures of an experiment."""

    kind = "report-paper"
    modules = ("airlight.validation.papers.claims",)
    name: str
    source: str  #: digest of its module, of what that imports and of the data of these
    machine: Mapping[str, str]


def _paper(name: str) -> OtherPart:
    experiment = experiments()[name]
    module = f"airlight.validation.papers.{experiment.function.partition(':')[0]}"
    inputs = PaperInputs(name, source_digest(module), machine())
    compute = partial(_experiment, name)
    return OtherPart(
        "papers", name, experiment.seconds, inputs, compute, tuple[str, dict[str, Any]]
    )


def _experiment(name: str, progress: Progress) -> tuple[str, dict[str, Any]]:
    """Return the name of an experiment and its figures."""
    progress(0.0, "claims of papers")
    return name, experiments()[name].run()


def paper_rows(results: Sequence[tuple[str, Mapping[str, Any]]]) -> list[Claim]:
    """Return the claims that the results of experiments decide."""
    return decided(claims(), dict(results)) if results else []


def decided(chosen: Sequence[Claim], figures: Mapping[str, Mapping[str, Any]]) -> list[Claim]:
    """Return the claims whose experiments were made, and those that no experiment can measure.

    `figures`, by experiment: numbers by the names that claims.toml gives them, a
    free set and so no record.
    """
    return [
        judged(claim, figures.get(claim.experiment, {}))
        for claim in chosen
        if not claim.experiment or claim.experiment in figures
    ]


def measure_claims(
    chosen: Sequence[Claim], *, quick: bool = False, progress: Progress | None = None
) -> list[Claim]:
    """Measure what claims need and is not cached, and return those that are decided;
    `quick` leaves out images.
    """
    # The results of an experiment are cached.
    parts = [_paper(name) for name in experiments_of(chosen, "quick" if quick else EFFORTS[-1])]
    steps = sharing(progress, [(f"{part.title}, ", part.seconds) for part in parts])
    return decided(chosen, dict(part.result(step).value for part, step in zip(parts, steps)))
