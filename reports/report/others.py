# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a report that belong to no scene of it: the stability of kernels, how times grow, claims of papers."""

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

from reference.storage.kept import is_kept, key_of
from reports.machine.environment import machine
from reports.machine.own_process import in_own_process
from reports.machine.progress import Progress, counted, part_of
from validation.kernels.records import Stability
from validation.papers.claims import EFFORTS, Claim, Judged, claims, experiments, judged
from validation.study.results import Computed, Result, cached_result
from validation.study.study import Study, standard_study

_STABILITY, _GROWTH = 20.0, 80.0  # that these take [s]
_LEAST = 0.01  # to read a kept result [s]


@dataclass(frozen=True)
class OtherPart:
    """A part of a report that belongs to no scene."""

    kind: str  #: 'stability', 'scaling' or 'papers'
    title: str  #: shown as the progress
    key: str  #: of its result
    usual: float  #: roughly what it takes [s]
    compute: Callable[[Progress], Computed]

    @property
    def seconds(self) -> float:
        """What it will take [s]."""
        return 0.0 if is_kept(self.key) else self.usual

    def result(self, progress: Progress) -> Result:
        """Return its result, kept or computed."""
        return cached_result(self.key, partial(self.compute, progress))


def other_parts(study: Study) -> list[OtherPart]:
    """Return the parts that a study asks for; claims of papers only with all scenes of a study of ours."""
    parts = []
    if study.stability:
        from validation.kernels.stability import stability

        key = key_of("report-stability", stability, rays=study.stability)
        parts.append(OtherPart("stability", "stability", key, _STABILITY, partial(_stability, study.stability)))
    if study.growth and set(standard_study("scaling").scenes) <= set(study.scenes):
        parts += [_scaling(kind, study.measure.seconds) for kind in study.growth]
    if study.name in EFFORTS and set(standard_study(study.name).scenes) <= set(study.scenes):
        parts += [_paper(name) for name in experiments_of(claims(), study.name)]
    return parts


def spans_of(seconds: Mapping[str, float]) -> dict[str, tuple[float, float]]:
    """Return where each part begins and ends, as fractions of the time that all of them take in turn."""
    spent = [max(_LEAST, value) for value in seconds.values()]
    total = sum(spent)
    bounds = [sum(spent[:number]) / total for number in range(len(spent))] + [1.0]
    return dict(zip(seconds, itertools.pairwise(bounds)))


# --- kernels ---------------------------------------------------------------------------------------------------------


def _stability(rays: int, progress: Progress) -> Computed:
    """Return how stable kernels are. Nearly all of its time goes into compilation: a process compiles them quickly."""
    from realtime.kernels.registry import KERNELS
    from validation.kernels.stability import stability

    how: dict[str, Any] = {"what": "study", "name": "of the kernels", "limit": math.inf, "quick": True}
    known: list[Stability] = in_own_process(known_kernels, rays, **how)
    added = [name for name in KERNELS if name not in {kernel.kernel for kernel in known}]
    return {"kernels": known + (stability(added, count=rays, progress=counted(progress)) if added else [])}, {}


def known_kernels(rays: int) -> list[Stability]:
    """Return how stable the kernels of airlight are, in a process that knows no others."""
    from validation.kernels.stability import stability

    return stability(count=rays)


# --- growth ----------------------------------------------------------------------------------------------------------


def _scaling(kind: str, seconds: float) -> OtherPart:
    """Return how times grow with one kind of work."""
    from validation.study.growth import study_growth
    from validation.study.ladders import ladder

    usual = standard_study("scaling")
    study = replace(usual, measure=replace(usual.measure, seconds=seconds))

    def compute(progress: Progress) -> Computed:
        steps = ladder(kind, study.scenes[0], study.sizes[0])
        return {"scaling": study_growth(study, kind, steps, progress=counted(progress))}, {}

    key = key_of("report-scaling", study_growth, ladder, machine=machine(), kind=kind, study=study)
    return OtherPart("scaling", "how times grow", key, _GROWTH, compute)


# --- claims of papers ------------------------------------------------------------------------------------------------


def experiments_of(chosen: Sequence[Claim], effort: str = EFFORTS[-1]) -> list[str]:
    """Return the names of the experiments that claims need and that an effort has."""
    needed = {claim.experiment for claim in chosen}
    most = EFFORTS.index(effort)
    return [name for name, each in experiments().items() if name in needed and EFFORTS.index(each.effort) <= most]


def _paper(name: str) -> OtherPart:
    experiment = experiments()[name]

    def compute(progress: Progress) -> Computed:
        progress(0.0, "claims of papers")
        return {"experiment": name, "figures": experiment.run()}, {}

    module = f"validation.papers.{experiment.function.partition(':')[0]}"
    key = key_of("report-paper", module, experiment=name, machine=machine())
    return OtherPart("papers", name, key, experiment.seconds, compute)


def paper_rows(results: Sequence[Result]) -> list[Judged]:
    """Return the claims that the results of experiments decide."""
    found = {result.data["experiment"]: result.data["figures"] for result in results}
    return decided(claims(), found) if found else []


def decided(chosen: Sequence[Claim], figures: Mapping[str, Mapping[str, Any]]) -> list[Judged]:
    """Return the claims whose experiments were made, and those that no experiment can measure."""
    return [
        judged(claim, figures.get(claim.experiment, {}))
        for claim in chosen
        if not claim.experiment or claim.experiment in figures
    ]


def measure_claims(chosen: Sequence[Claim], *, quick: bool = False, progress: Progress | None = None) -> list[Judged]:
    """Measure what claims need and is not cached, and return those that are decided; `quick` leaves out images."""
    parts = {name: _paper(name) for name in experiments_of(chosen, "quick" if quick else EFFORTS[-1])}
    steps = spans_of({name: part.seconds for name, part in parts.items()})
    figures = {
        name: part.result(part_of(progress, *steps[name], before=f"{name}, ")).data["figures"]
        for name, part in parts.items()
    }
    return decided(chosen, figures)
