# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a report that belong to no scene: tables of papers, stability of the kernels, faults of the physics."""

from collections.abc import Callable, Sequence
from typing import Any

from reports.data.serialize import mutations_data, plain
from reports.machine.progress import counted, part_of
from reports.papers.billeter import billeter_data
from reports.papers.biri import biri_data
from validation.frames.result_cache import Computed, Keeper, Kept, kept_result, slot
from validation.frames.scene_study import Effort

Tell = Callable[[float, str], None]


def stability_part(effort: Effort, keeper: Keeper, results: list[Kept], tell: Tell) -> list[dict[str, Any]]:
    """Return the stability of every kernel; none where the effort asks for no rays."""
    if not effort.rays:
        return []
    from validation.kernels.stability import stability

    def compute() -> Computed:
        told = counted(part_of(tell, 0.0, 1.0, before="stability, "))
        return {"kernels": plain(stability(count=effort.rays, progress=told))}, {}

    place = slot(keeper, "stability", identity={"rays": effort.rays}, fingerprint={})
    results.append(kept_result(place, compute))
    return results[-1].data["kernels"]


def mutations_part(effort: Effort, keeper: Keeper, results: list[Kept], tell: Tell) -> dict[str, Any] | None:
    """Return which faults of the physics the checks of the truth find; None where the effort does not ask."""
    if not effort.mutations:
        return None
    from validation.mutations.study import study_mutations

    tell(0.0, "faults of the physics")
    place = slot(keeper, "mutations", identity={}, fingerprint={})
    told = part_of(tell, 0.0, 1.0, before="faults of the physics, ")
    results.append(kept_result(place, lambda: (mutations_data(study_mutations(progress=told)), {})))
    return results[-1].data


def published_part(
    effort: Effort, scenes: Sequence[str], keeper: Keeper, results: list[Kept], tell: Tell
) -> dict[str, Any] | None:
    """Return the tables of the papers, measured again in those of their scenes that are studied; None without any."""
    found: dict[str, Any] = {}
    if "biri" in effort.papers:
        found["biri"] = _biri(effort, scenes, keeper, results, part_of(tell, 0.0, 0.4))
    if "billeter" in effort.papers:
        found["billeter"] = _billeter(effort, scenes, keeper, results, part_of(tell, 0.4, 1.0))
    found = {paper: data for paper, data in found.items() if data is not None}
    return ({"biri": None, "billeter": None} | found) if found else None


def _biri(effort: Effort, scenes: Sequence[str], keeper: Keeper, results: list[Kept], tell: Tell) -> Any:
    """Return Tables 1 and 2 of Biri 2006, each entry kept for itself."""
    from validation.frames.zero_cost import needless_costs
    from validation.papers.biri import PUBLISHED, biri_rows

    entries = [one for one in PUBLISHED if one.scene in scenes]
    if not entries:
        return None
    kernels, seconds = effort.paper_kernels, effort.seconds
    rows: list[Any] = []
    for number, one in enumerate(entries):
        share, width = number / len(entries), 1 / len(entries)

        def compute(one=one, share=share, width=width) -> Computed:
            told = part_of(tell, share, share + width, before="Biri 2006, ")
            return biri_data(biri_rows([one], kernels, seconds=seconds, progress=told), []), {}

        identity = {"scene": one.scene, "size": one.size, "kernels": kernels, "seconds": seconds}
        results.append(kept_result(slot(keeper, "biri", identity=identity, fingerprint={}), compute))
        rows += results[-1].data["rows"]
        stages = results[-1].data["stages"]
    needless: list[Any] = []
    if "billeter" in effort.papers:  # the effort that leaves nothing out
        tell(1.0, "what is not needed")
        place = slot(keeper, "needless", identity={}, fingerprint={})
        results.append(kept_result(place, lambda: ({"costs": plain(needless_costs())}, {})))
        needless = results[-1].data["costs"]
    return {"stages": stages, "rows": rows, "needless": needless}


def _billeter(effort: Effort, scenes: Sequence[str], keeper: Keeper, results: list[Kept], tell: Tell) -> Any:
    """Return Figures 6 and 7 and Table 1 of Billeter 2010."""
    from validation.papers.billeter_images import FIGURES, figure_rows
    from validation.papers.billeter_tessellation import TABLE, table_rows

    images = [one for one in FIGURES if one.scene in scenes]
    views = [one for one in TABLE if one.scene in scenes]
    if not images and not views:
        return None

    def compute() -> Computed:
        options: dict[str, Any] = {"kernel": effort.paper_kernels[0], "seconds": effort.seconds}
        figures = figure_rows(
            images, **options, progress=lambda share, what: tell(0.3 * share, f"Billeter 2010, {what}")
        )
        table = table_rows(
            views, **options, progress=lambda share, what: tell(0.3 + 0.7 * share, f"Billeter 2010, {what}")
        )
        return billeter_data(figures, table), {}

    named = sorted({*(one.scene for one in images), *(one.scene for one in views)})
    identity = {"scenes": named, "kernel": effort.paper_kernels[0], "seconds": effort.seconds}
    results.append(kept_result(slot(keeper, "billeter", identity=identity, fingerprint={}), compute))
    return results[-1].data
