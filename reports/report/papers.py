# SPDX-License-Identifier: BSD-3-Clause
"""The parts of a report that belong to no scene of it.

These are tables of papers, the stability of the kernels, and how times grow with the work.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from reports.data.serialize import scaling_data
from reports.machine.own_process import in_own_process
from reports.machine.progress import Progress, counted, part_of
from reports.papers.billeter import billeter_data
from reports.papers.biri import biri_data
from validation.fidelity.catalogue import ROWS, published_figures
from validation.frames.result_cache import CachedResult, CacheEntry, Computed, ResultCache, cache_entry
from validation.frames.scene_study import Effort
from validation.metrics.errors import plain

_GROWING = "colonnade"  # of which times are measured as its work grows
_GROWING_SIZE = (400, 300)  # of its images [pixels]


@dataclass(frozen=True)
class OtherPart:
    """A part of a report that belongs to no scene."""

    kind: str  #: 'stability', 'scaling', 'biri', 'billeter' or 'fidelity'
    title: str  #: shown as the progress
    entry: CacheEntry
    compute: Callable[[Progress], Computed]


def other_parts(effort: Effort, scenes: Sequence[str], cache: ResultCache) -> list[OtherPart]:
    """Return the parts that an effort asks for; those of papers in the scenes that are studied, table by table."""
    parts = []
    if effort.rays:
        entry = cache_entry(cache, "stability", identity={"rays": effort.rays})
        parts.append(OtherPart("stability", "stability", entry, lambda progress: _stability(effort.rays, progress)))
    if _GROWING in scenes:
        parts += [_scaling(kind, effort.seconds, cache) for kind in effort.scaling]
    if "biri" in effort.papers:
        parts += _biri(effort, scenes, cache)
    if "billeter" in effort.papers:
        parts += _billeter(effort, scenes, cache)
    return parts


def published_data(results: Mapping[str, Sequence[CachedResult]]) -> dict[str, Any] | None:
    """Return the tables of the papers from the results of their parts, by kind; None without any."""
    biri, billeter = results.get("biri"), results.get("billeter")
    if not biri and not billeter:
        return None
    tables = None
    if biri:
        rows = [row for result in biri for row in result.data["rows"]]
        study = [row for result in biri for row in result.data["constant_distance"]]
        tables = {"stages": biri[-1].data["stages"], "rows": rows, "constant_distance": study}
    figures = published_figures(ROWS)
    return {"biri": tables, "billeter": billeter[-1].data if billeter else None, "figures": figures}


def _stability(rays: int, progress: Progress) -> Computed:
    """Return how stable kernels are. Nearly all of its time goes into compilation: a process compiles them quickly."""
    from realtime.kernels.registry import KERNELS
    from validation.kernels.stability import stability

    known = in_own_process(known_kernels, rays, what="study", name="of the kernels", limit=None, quick=True)
    added = [name for name in KERNELS if name not in {kernel["kernel"] for kernel in known}]
    return {"kernels": known + (plain(stability(added, count=rays, progress=counted(progress))) if added else [])}, {}


def known_kernels(rays: int) -> list[dict[str, Any]]:
    """Return how stable the kernels of airlight are, in a process that knows no others."""
    from validation.kernels.stability import stability

    return plain(stability(count=rays))


def _scaling(kind: str, seconds: float, cache: ResultCache) -> OtherPart:
    """Return how times grow with one kind of work."""

    def compute(progress: Progress) -> Computed:
        from validation.scaling.ladders import ladder
        from validation.scaling.study import METHODS, study_scaling

        steps = ladder(kind, _GROWING, _GROWING_SIZE)
        found = study_scaling(kind, steps, METHODS, seconds=seconds, progress=counted(progress))
        return {"scaling": [scaling_data(_GROWING, _GROWING_SIZE, each) for each in found]}, {}

    identity = {"scene": _GROWING, "size": _GROWING_SIZE, "kind": kind, "seconds": seconds}
    return OtherPart("scaling", "how times grow", cache_entry(cache, "scaling", identity=identity), compute)


def _biri(effort: Effort, scenes: Sequence[str], cache: ResultCache) -> list[OtherPart]:
    """Return Tables 1 and 2 of Biri 2006, each entry a part."""
    from validation.papers.biri import PUBLISHED, Published, biri_rows
    from validation.papers.constant_distance import constant_distance_study

    kernels, seconds = effort.paper_kernels, effort.seconds

    def measured(published: Published, progress: Progress) -> dict[str, Any]:
        study = constant_distance_study() if published.scene == "three-media" else ()
        # At the size of the report's images, whose truths are kept.
        rows = biri_rows([published], kernels, error_size=effort.image, seconds=seconds, progress=progress)
        return biri_data(rows, study)

    def part(published: Published) -> OtherPart:
        identity = {
            "scene": published.scene,
            "size": published.size,
            "compared": effort.image,
            "kernels": kernels,
            "seconds": seconds,
        }
        return OtherPart(
            "biri",
            "Biri 2006",
            cache_entry(cache, "biri", identity=identity),
            lambda progress: (measured(published, progress), {}),
        )

    return [part(published) for published in PUBLISHED if published.scene in scenes]


def _billeter(effort: Effort, scenes: Sequence[str], cache: ResultCache) -> list[OtherPart]:
    """Return Figures 6 and 7 and Table 1 of Billeter 2010 as one part."""
    from validation.papers.billeter_images import FIGURES, figure_rows
    from validation.papers.billeter_tessellation import TABLE, table_rows

    images = [figure for figure in FIGURES if figure.scene in scenes]
    views = [view for view in TABLE if view.scene in scenes]
    if not images and not views:
        return []
    named = sorted({*(figure.scene for figure in images), *(view.scene for view in views)})
    options: dict[str, Any] = {"kernel": effort.paper_kernels[0], "seconds": effort.seconds}

    def compute(progress: Progress) -> Computed:
        figures = figure_rows(images, **options, progress=part_of(progress, 0.0, 0.3))
        return billeter_data(figures, table_rows(views, **options, progress=part_of(progress, 0.3, 1.0))), {}

    entry = cache_entry(cache, "billeter", identity={"scenes": named, **options})
    return [OtherPart("billeter", "Billeter 2010", entry, compute)]
