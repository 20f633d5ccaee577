# SPDX-License-Identifier: BSD-3-Clause
"""`airlight published`: the tables and figures of papers, measured again beside what was printed."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import Force, Json, Markdown, listed

PAPERS = ("biri", "billeter", "ali", "bouthors")


def published(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENE",
            help="Scenes of the papers; all that are built in by default.",
            show_default=False,
            autocompletion=completion.scenes,
        ),
    ] = None,
    paper: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="biri, billeter, ali or bouthors; all by default.",
            show_default=False,
            autocompletion=completion.one_of(*PAPERS),
        ),
    ] = None,
    kernels: Annotated[
        str, typer.Option(metavar="NAMES", help="Comma-separated airlight kernels; for billeter the first counts.")
    ] = "exact,taylor",
    scale: Annotated[float, typer.Option(metavar="X", help="Of width and height; 1 for the published sizes.")] = 1.0,
    maps: Annotated[
        str,
        typer.Option(metavar="SIZES", help="billeter: comma-separated sizes of the shadow map in Table 1, ascending."),
    ] = "1024,2048,4096",
    limit: Annotated[
        float,
        typer.Option(metavar="SECONDS", help="billeter: frames that take longer are left out, with the reason."),
    ] = 30.0,
    force: Force = False,
    json: Json = False,
    markdown: Markdown = False,
) -> None:
    """Measure tables and figures of papers again.

    The papers are Biri, Arques, Michelin 2006, Billeter, Sintorn, Assarsson 2010, Ali 2016 and Bouthors, Neyret,
    Max, Bruneton, Crassin 2008.

    biri: Tables 1 and 2 with `shadow-planes`: share of time by stage, frames a second; with `three-media`, the
    error of the constant R of section 4.2 by size and depth. billeter: Figures 6 and 7 and Table 1 with `light-
    volumes` and its peers: frames a second, static against adaptive tessellation, and the
    passes. ali: Fig. 5.8 with `soft-shafts` and what goes with it, by errors in the
    penumbrae and times. bouthors: what a slab decides, Fig. 3, the printed extinction and
    densities, light by direction beside the fitted functions, Fig. 8, clouds beside light paths, Figs 11 and 12, by
    order of scattering too, and the frames a second of section 9. The others at
    the published sizes, after the light moved, everything rebuilt or camera rays kept, beside the published figures,
    with the error of the airlight.
    """
    from analytic.errors import InputError
    from reports.commands.maps import parse_map_sizes
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json
    from validation.configurations.kernel_names import find_kernel
    from validation.frames.expected_work import check_work, frame_work, truth_work

    if paper is not None and paper not in PAPERS:
        raise InputError(f"--paper: got {paper!r}, wanted one of {', '.join(PAPERS)}")
    if not 0 < scale <= 4:
        raise InputError(f"--scale: got {scale:g}, wanted more than 0, at most 4")
    if not limit > 0:
        raise InputError(f"--limit: got {limit:g}, wanted more than 0 [s]")
    papers = PAPERS if paper is None else (paper,)
    wanted = _wanted_scenes(scenes or [], papers)
    names = listed("--kernels", kernels)
    for name in names:
        find_kernel(name)
    sizes = parse_map_sizes("--maps", maps)
    activate()
    data: dict[str, Any] = {}
    pixels = round(800 * scale), round(600 * scale)
    count = len(wanted) * (len(names) + len(sizes))
    works = [truth_work(pixels, images=2 * len(wanted)), frame_work(pixels, frames=20 * count)]
    check_work(f"published, --scale {scale:g}", works, force=force)
    with progress_bar("published") as progress:
        if "biri" in papers:
            data |= _biri(wanted, names, scale=scale, progress=progress)
        if "billeter" in papers:
            data |= _billeter(wanted, names[0], scale=scale, maps=sizes, limit=limit, progress=progress)
        if "ali" in papers and "fence" in wanted:
            data |= _ali(scale=scale, progress=progress)
        if "bouthors" in papers and not scenes:
            data |= _bouthors(progress)
    if json:
        print_json({"environment": describe_environment()} | data)
    else:
        _print(data, as_markdown=markdown)


def _print(data: dict[str, Any], *, as_markdown: bool) -> None:
    """Print the tables of the papers."""
    from reports.machine.printing import print_heading, print_tables
    from reports.papers.ali import ali_tables
    from reports.papers.billeter import billeter_tables
    from reports.papers.biri import biri_notes, biri_tables
    from reports.papers.bouthors import bouthors_tables

    if as_markdown:
        print_heading()
    if "rows" in data:
        print_tables(biri_tables(data), as_markdown=as_markdown)
        for note in biri_notes(data):
            print(f"\n{note}")
    if "ali" in data:
        print_tables(ali_tables(data["ali"]), as_markdown=as_markdown)
    if "bouthors" in data:
        print_tables(bouthors_tables(data["bouthors"]), as_markdown=as_markdown)
    if "billeter" in data:
        print_tables(billeter_tables(data["billeter"]), as_markdown=as_markdown)


def _ali(*, scale: float, progress: Callable) -> dict[str, Any]:
    """Measure the figures of Ali 2016."""
    from validation.fidelity.ali_figures import study_data
    from validation.papers.ali import SIZE, shafts_study

    # Whole tiles of 4 x 4 pixels.
    size = (4 * max(1, round(0.25 * scale * SIZE[0])), 4 * max(1, round(0.25 * scale * SIZE[1])))
    return {"ali": study_data(shafts_study(size, progress=progress))}


def _bouthors(progress: Callable) -> dict[str, Any]:
    """Measure what a slab decides of Bouthors 2008, its light by direction, clouds beside the truth, and frames."""
    from reports.machine.progress import part_of
    from validation.papers.bouthors import slab_study
    from validation.papers.bouthors_clouds import clouds_study
    from validation.papers.bouthors_frames import frames_study
    from validation.papers.bouthors_transport import transport_study

    slab = slab_study(progress=part_of(progress, 0.0, 0.1))
    transport = transport_study(progress=part_of(progress, 0.1, 0.25))
    images = clouds_study(progress=part_of(progress, 0.25, 0.9))
    return {"bouthors": slab | transport | images | frames_study(progress=part_of(progress, 0.9, 1.0))}


def _wanted_scenes(scenes: Sequence[str], papers: Sequence[str]) -> list[str]:
    from analytic.errors import InputError, nearest
    from validation.papers.billeter_images import FIGURES
    from validation.papers.billeter_tessellation import TABLE
    from validation.papers.biri import PUBLISHED
    from validation.scenes.registry import SCENES

    of_paper = {
        "biri": [row.scene for row in PUBLISHED if row.scene in SCENES],
        "ali": ["fence"],
        "bouthors": [],
        "billeter": [figure.scene for figure in FIGURES] + [view.scene for view in TABLE],
    }
    known = list(dict.fromkeys(name for paper in papers for name in of_paper[paper]))
    for name in scenes:
        if name not in known:
            raise InputError(f"scene: got {name!r}, wanted some of {', '.join(known)}" + nearest(name, known))
    return list(scenes) or known


def _biri(wanted: Sequence[str], kernels: Sequence[str], *, scale: float, progress: Callable) -> dict[str, Any]:
    """Measure the tables of Biri 2006, nothing where none of their scenes is wanted."""
    from reports.papers.biri import biri_data
    from validation.papers.biri import PUBLISHED, biri_rows

    chosen = [row for row in PUBLISHED if row.scene in wanted]
    if not chosen:
        return {}
    rows = biri_rows(chosen, kernels, scale=scale, progress=progress)
    from validation.papers.constant_distance import constant_distance_study

    progress(0.99, "the constant R")
    study = constant_distance_study() if any(row_set.scene == "three-media" for row_set in chosen) else ()
    return biri_data(rows, study)


def _billeter(
    wanted: Sequence[str], kernel: str, *, scale: float, maps: Sequence[int], limit: float, progress: Callable
) -> dict[str, Any]:
    """Measure the figures and the table of Billeter 2010, nothing where none of their scenes is wanted."""
    from reports.machine.progress import part_of
    from reports.papers.billeter import billeter_data
    from validation.papers.billeter_images import FIGURES, SIZE, figure_rows
    from validation.papers.billeter_tessellation import TABLE, table_rows

    images = [figure for figure in FIGURES if figure.scene in wanted]
    views = [view for view in TABLE if view.scene in wanted]
    if not images and not views:
        return {}
    share = len(images) / (len(images) + 3 * len(maps) * len(views))
    size = (max(1, round(scale * SIZE[0])), max(1, round(scale * SIZE[1])))
    step = part_of(progress, 0.0, share), part_of(progress, share, 1.0)
    figures = figure_rows(images, kernel=kernel, size=size, limit=limit, progress=step[0])
    table = table_rows(views, maps=maps, kernel=kernel, size=size, limit=limit, progress=step[1])
    return {"billeter": billeter_data(figures, table)}
