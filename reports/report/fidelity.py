# SPDX-License-Identifier: BSD-3-Clause
"""The experiments behind the claims of papers, each kept on disk, and the rows that they decide."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from reports.machine.progress import Progress, part_of
from reports.report.expected import shares
from reports.report.papers import OtherPart
from validation.fidelity.catalogue import EXPERIMENTS, ROWS, Experiment, experiments_of, judged
from validation.fidelity.row import Row
from validation.frames.result_cache import (
    CachedResult,
    Computed,
    ResultCache,
    cache_entry,
    cached_result,
    expected_seconds,
)
from validation.frames.scene_study import EFFORTS, Effort
from validation.scenes.registry import FOG_SCENES


def fidelity_parts(
    effort: Effort, scenes: Sequence[str], cache: ResultCache, *, rows: Sequence[Row] = ROWS, reported: bool = True
) -> list[OtherPart]:
    """Return the experiments of an effort, nothing where only some of its scenes are studied.

    Parameters
    ----------
    effort, scenes, cache
        Of the report.
    rows
        Whose experiments to return.
    reported
        Leave out what a report measures only as part of the papers' whole tables.
    """
    if not effort.scenes or not set(effort.scenes) <= set(scenes):
        return []
    chosen = {name: EXPERIMENTS[name] for name in experiments_of(rows)}
    return [
        _part(name, experiment, cache)
        for name, experiment in chosen.items()
        if (experiment.report or not reported) and (effort.fidelity or not experiment.images)
    ]


def _part(name: str, experiment: Experiment, cache: ResultCache) -> OtherPart:
    def compute(progress: Progress) -> Computed:
        progress(0.0, "claims of papers")
        return {"experiment": name, "data": experiment.compute()}, {}

    entry = cache_entry(cache, "fidelity", identity={"experiment": name})
    return OtherPart("fidelity", name, entry, compute)


def fidelity_rows(results: Mapping[str, Sequence[CachedResult]], *, rows: Sequence[Row] = ROWS) -> list[dict[str, Any]]:
    """Return the rows that the results of a run decide; those whose experiment was not made are left out.

    Parameters
    ----------
    results
        By kind of `OtherPart`.
    rows
        Which rows.
    """
    evidence = {result.data["experiment"]: result.data["data"] for result in results.get("fidelity", ())}
    if results.get("billeter"):  # whole tables of the paper, of a full report
        evidence["billeter tables"] = results["billeter"][-1].data
    return judged(rows, evidence)


def measure_fidelity(
    rows: Sequence[Row], cache: ResultCache, *, quick: bool = False, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """Measure what rows need and is not kept, and return those that are decided.

    Parameters
    ----------
    rows
        Of `validation.fidelity.catalogue.ROWS`.
    cache
        Of the run.
    quick
        Leave out what needs images.
    progress
        Called with (share done, what) now and then.
    """
    effort = replace(EFFORTS["default"], fidelity=not quick)
    parts = fidelity_parts(effort, tuple(FOG_SCENES), cache, rows=rows, reported=False)
    typical = [EXPERIMENTS[part.title].seconds for part in parts]
    seconds = {
        str(number): usual if (last := expected_seconds(part.entry)) is None else last
        for number, (part, usual) in enumerate(zip(parts, typical))
    }
    results: dict[str, list[CachedResult]] = {}
    for part, share in zip(parts, shares(seconds).values()):
        step = part_of(progress, *share, before=f"{part.title}, ")
        results.setdefault(part.kind, []).append(cached_result(part.entry, partial(part.compute, step)))
    return fidelity_rows(results, rows=rows)
