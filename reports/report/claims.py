# SPDX-License-Identifier: BSD-3-Clause
"""The experiments behind the claims of papers, each cached on disk, and the claims that they decide."""

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any

from reference.storage.kept import is_kept, key_of
from reports.machine.environment import machine
from reports.machine.progress import Progress, part_of
from reports.report.expected import shares
from reports.report.papers import OtherPart
from validation.papers.claims import Claim, claims, judged
from validation.papers.experiments import EFFORTS, EXPERIMENTS
from validation.study.results import CachedResult, Computed, cached_result
from validation.study.scene import Effort


def paper_parts(effort: Effort, scenes: Sequence[str]) -> list[OtherPart]:
    """Return the experiments of a report, nothing where only some of the scenes of its effort are studied."""
    if not effort.scenes or not set(effort.scenes) <= set(scenes):
        return []
    return [_part(name) for name in experiments_of(claims(), effort.name)]


def experiments_of(chosen: Sequence[Claim], effort: str = EFFORTS[-1]) -> list[str]:
    """Return the names of the experiments that claims need and that an effort has."""
    needed = {claim.experiment for claim in chosen}
    most = EFFORTS.index(effort)
    return [name for name, each in EXPERIMENTS.items() if name in needed and EFFORTS.index(each.effort) <= most]


def _part(name: str) -> OtherPart:
    def compute(progress: Progress) -> Computed:
        progress(0.0, "claims of papers")
        return {"experiment": name, "figures": EXPERIMENTS[name].run()}, {}

    module = f"validation.papers.{EXPERIMENTS[name].function.partition(':')[0]}"
    return OtherPart("papers", name, key_of("report-paper", module, experiment=name, machine=machine()), compute)


def paper_rows(results: Mapping[str, Sequence[CachedResult]]) -> list[dict[str, Any]]:
    """Return the claims that the results of a report decide, by kind of `OtherPart`."""
    found = {result.data["experiment"]: result.data["figures"] for result in results.get("papers", ())}
    return decided(claims(), found) if found else []


def decided(chosen: Sequence[Claim], figures: Mapping[str, Mapping[str, Any]]) -> list[dict[str, Any]]:
    """Return the claims whose experiments were made, and those that no experiment can measure, ready for JSON."""
    return [
        judged(claim, figures.get(claim.experiment, {}))
        for claim in chosen
        if not claim.experiment or claim.experiment in figures
    ]


def measure_claims(
    chosen: Sequence[Claim], *, quick: bool = False, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """Measure what claims need and is not cached, and return those that are decided.

    Parameters
    ----------
    chosen
        Of `validation.papers.claims.claims`.
    quick
        Leave out what needs images.
    progress
        Called with (share done, what) now and then.
    """
    names = experiments_of(chosen, "quick" if quick else EFFORTS[-1])
    parts = {name: _part(name) for name in names}
    seconds = {name: 0.0 if is_kept(part.key) else EXPERIMENTS[name].seconds for name, part in parts.items()}
    figures = {}
    for (name, part), share in zip(parts.items(), shares(seconds).values()):
        step = part_of(progress, *share, before=f"{name}, ")
        figures[name] = cached_result(part.key, partial(part.compute, step)).data["figures"]
    return decided(chosen, figures)
