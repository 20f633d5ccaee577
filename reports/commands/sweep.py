# SPDX-License-Identifier: BSD-3-Clause
"""`airlight sweep [STUDY.toml]`: many scenes, every method, on one machine or on a Dask cluster."""

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reports.commands.options import ClusterPlace, Json

if TYPE_CHECKING:
    from reports.cluster.connect import Place
    from validation.study.keys import Made
    from validation.study.rows import RowStore
    from validation.study.study import Study

_USUAL = 100  # random scenes of a study without a file
_EVERY = 300.0  # between two times that the Parquet is written while rows come [s]


def sweep(
    study: Annotated[
        Path | None,
        typer.Argument(metavar="STUDY.toml", help="What to sweep over, see docs/many-scenes.md.", show_default=False),
    ] = None,
    random: Annotated[
        int | None,
        typer.Option(metavar="N", help=f"So many random scenes; without a study {_USUAL}.", show_default=False),
    ] = None,
    cluster: ClusterPlace = None,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="DIR", help="Folder of the rows; sweep-NAME by default."),
    ] = None,
    again: Annotated[
        bool, typer.Option("--again", help="Compute cells again that failed, hung or aborted; the others stay.")
    ] = False,
    redraw: Annotated[
        Path | None,
        typer.Option(
            "--from",
            metavar="DIR",
            help="Say what this sweep says: a page, figures and claims from its Parquet, without computing.",
            show_default=False,
        ),
    ] = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="With --from: print the tables in Markdown.")] = False,
    json: Json = False,
) -> None:
    """Run every method over many scenes: a row of numbers each.

    A study names scenes, methods, kernels, parameters, media and sizes; every combination is a cell and becomes one
    row of DIR/sweep.parquet. A process for each processor computes them unless --cluster says otherwise.

    Finished rows are kept: a run that was interrupted goes on where it was, and the same study twice computes nothing.

    --from DIR writes what the rows say: DIR/sweep.html, figures, and claims with their confidence as JSON; with -o into
    another folder.

    Exit status 1 if a cell failed, hung or aborted, or was left undone.
    """
    from analytic.errors import InputError
    from reports.cluster.connect import check_library, parse_place
    from reports.machine.environment import activate
    from validation.study.rows import RowStore
    from validation.study.study import default_study, read_study

    if redraw is not None:
        given = {"a study": study, "--random": random, "--cluster": cluster, "--again": again or None}
        _say(redraw, output, [option for option, value in given.items() if value is not None], markdown, json)
        return
    if markdown:
        raise InputError("--markdown: prints the tables of a sweep that is there; name its folder by --from DIR")
    place = parse_place(cluster)
    _check_parquet()
    check_library()
    count = _USUAL if random is None else random
    chosen = default_study(count) if study is None else read_study(study, count=random)
    folder = output or Path(f"sweep-{chosen.name}")
    variant = activate()
    with RowStore(folder) as store:
        summary = _run(chosen, store, place, variant=variant, again=again)
        summary["parquet"] = str(store.write_parquet()) if len(store) else None
    _print(summary, json=json)
    if summary["problems"] or summary["left"]:
        raise typer.Exit(1)


def _say(source: Path, target: Path | None, others: list[str], markdown: bool, json: bool) -> None:
    """Write what a sweep says, and print its claims."""
    from analytic.errors import InputError
    from reports.tables.drawing import sentence_in_text
    from reports.tables.terminal import print_json, print_table

    if others:
        raise InputError(f"sweep: got --from together with {others[0]}; --from computes nothing, leave that out")
    if json and markdown:
        raise InputError("sweep: got both --json and --markdown; give one of them")
    _check_parquet()
    from reports.sweep.page import write_sweep
    from reports.sweep.summary import headlines, to_json
    from reports.sweep.tables import errors_table, speed_table

    said, page = write_sweep(source, target)
    if json:
        print_json(to_json(said))
    elif markdown:
        for table in (errors_table(said), speed_table(said)):
            print_table(table, as_markdown=True)
    else:
        print("\n".join(f"- {each['kind']}: {sentence_in_text(each['text'])}" for each in headlines(said)))
        print_table(errors_table(said))
        print(f"{page}: {said.scenes} scenes, {len(said.samples)} configurations, {len(said.sweep)} cells")


def _check_parquet() -> None:
    from reports.machine.environment import MissingError

    try:
        import pyarrow  # noqa: F401 - asked for here, before any work
    except ImportError:
        raise MissingError(
            "sweeps need the package pyarrow: install it with `pip install '.[sweep]'` in a clone"
        ) from None


def _run(study: "Study", store: "RowStore", place: "Place", *, variant: str, again: bool) -> dict[str, Any]:
    """Compute what is missing, add it to the store, and return what came of it."""
    from dataclasses import replace

    from reports import __version__
    from reports.cluster.cells import cell_groups, row_without_numbers, timing_groups
    from validation.study.keys import made_here, scene_identities

    made, scenes = made_here(__version__, variant), scene_identities(study.scenes)
    how: dict[str, Any] = {"store": store, "scenes": scenes}

    def with_errors(cell, key, outcome):
        value = outcome.value if outcome.status == "done" else row_without_numbers(cell, key, outcome)
        return value | {"study": study.name, "attempts": outcome.attempts}

    def with_times(cell, key, outcome):
        return store.row(key) | (outcome.value if outcome.status == "done" else {})

    # Images that nobody times are rendered once: their kernels compile longer than they run.
    quick = study.measure.times not in ("with", "stages")
    parts = [_part(study, store, place, made, partial(cell_groups, again=again, **how), with_errors, quick=quick)]
    if study.measure.times == "alone":
        where = replace(place, workers=1) if place.workers else place
        parts.append(_part(study, store, where, made, partial(timing_groups, **how), with_times))
    total = study.scene_count * study.cells_by_scene
    counts = parts[0]["counts"]
    return {
        "study": study.name,
        "scenes": study.scene_count,
        "cells": total,
        "kept": total - parts[0]["missing"],
        "computed": sum(counts.values()) - counts["lost"],
        "timed_alone": parts[1]["counts"]["done"] if len(parts) > 1 else 0,
        "counts": dict(counts),
        "left": sum(part["left"] for part in parts),
        "problems": [problem for part in parts for problem in part["problems"]],
        "refused_workers": [words for part in parts for words in part["refused_workers"]],
        "output": str(store.folder),
    }


def _part(
    study: "Study",
    store: "RowStore",
    place: "Place",
    made: "Made",
    groups_of: Callable[..., Any],
    row_from: Callable[..., dict[str, Any]],
    *,
    quick: bool = False,
) -> dict[str, Any]:
    """Run the groups of a study, and add a row for each outcome."""
    import time
    from collections import Counter

    from reports.cluster.connect import connected
    from reports.cluster.run import run_groups
    from reports.machine.progress import progress_bar
    from validation.study.study import Cell

    missing = sum(len(cells) for _, cells in groups_of(study, made))
    counts: Counter[str] = Counter()
    problems: list[dict[str, Any]] = []
    refused: list[str] = []
    open_cells: dict[str, Cell] = {}
    written = time.monotonic()

    def groups():
        for group, cells in groups_of(study, made):
            open_cells.update(cells)
            yield group

    if not missing:
        return {"counts": counts, "problems": problems, "refused_workers": refused, "left": 0, "missing": 0}
    with connected(place, quick=quick) as cluster, progress_bar(f"sweep {study.name}") as progress:
        for outcome in run_groups(cluster, groups(), made=made, retries=study.retries, refused=refused.append):
            key = outcome.task.name
            cell = open_cells.pop(key, None)
            if cell is None:
                continue  # the truth of an image: its cells say what came of it
            if outcome.status != "lost":
                store.add(row_from(cell, key, outcome))
            counts[outcome.status if outcome.status != "done" else store.status(key) or "done"] += 1
            if outcome.status not in ("done", "refused"):
                what = {"scene": cell.scene, "label": cell.chosen.label, "status": outcome.status}
                problems.append(what | {"reason": outcome.reason})
            if time.monotonic() - written > _EVERY:
                store.write_parquet()
                written = time.monotonic()
            done = sum(counts.values())
            progress(done / missing, f"{done} of {missing} cells, {cell.scene}")
    left = missing - sum(counts.values()) + counts["lost"]
    return {"counts": counts, "problems": problems, "refused_workers": refused, "left": left, "missing": missing}


def _print(summary: dict[str, Any], *, json: bool) -> None:
    from reports.tables.terminal import print_json

    if json:
        print_json(summary)
        return
    print(f"{summary['output']}: {summary['cells']} cells of {summary['scenes']} scenes")
    print(f"  {summary['kept']} were there, {summary['computed']} computed, {summary['left']} left")
    if summary["timed_alone"]:
        print(f"  {summary['timed_alone']} timed alone")
    for status, number in sorted(summary["counts"].items()):
        print(f"  {status}: {number}")
    for problem in summary["problems"]:
        print(f"  {problem['status']}: {problem['scene']}, {problem['label']}: {problem['reason']}")
    for words in summary["refused_workers"]:
        print(f"  refused: {words}")
    if summary["parquet"]:
        print(f"  rows in {summary['parquet']}")
        print(f"  what they say: airlight sweep --from {summary['output']}")
