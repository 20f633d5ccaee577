# SPDX-License-Identifier: BSD-3-Clause
"""`airlight baselines [SCENE...]`: is every method as accurate as it was?"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from reports.commands import completion
from reports.commands.options import Json

if TYPE_CHECKING:
    from validation.frames.baseline_files import Baseline, Move


def baselines(
    scenes: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="SCENE",
            help="Built-in scenes; all by default.",
            show_default=False,
            autocompletion=completion.scenes,
        ),
    ] = None,
    update: Annotated[bool, typer.Option("--update", help="Write what moved into the baselines.")] = False,
    because: Annotated[
        str | None,
        typer.Option(metavar="TEXT", help="Why numbers moved; CHANGELOG.md must say the same.", show_default=False),
    ] = None,
    times: Annotated[bool, typer.Option("--times/--no-times", help="Also time frames beside unshadowed.")] = True,
    json: Json = False,
) -> None:
    """Compare the errors of all methods with those kept in the source.

    Every configuration renders small images of every scene. Errors may move by rounding in either direction; a
    frame may take up to three times as long, relative to a frame of `unshadowed`. A configuration without a
    baseline fails too, and so does a baseline without its configuration. Exit status 1 if anything moved. --update
    writes what moved with a new revision, which CHANGELOG.md must name.
    """
    from analytic.errors import InputError, nearest
    from reports.machine.environment import activate
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.terminal import print_json
    from validation.frames.baseline_files import (
        FOLDER,
        compare_baseline,
        read_baseline,
        stray_baselines,
        updated,
        write_baseline,
    )
    from validation.frames.baseline_runs import measure_baseline
    from validation.scenes.registry import FOG_SCENES

    names = list(dict.fromkeys(scenes or FOG_SCENES))
    for name in names:
        if name not in FOG_SCENES:
            raise InputError(
                f"baselines: got {name!r}, wanted built-in scenes: {', '.join(FOG_SCENES)}{nearest(name, FOG_SCENES)}"
            )
    if because is not None and not update:
        raise InputError("baselines: --because is for --update; give both, or neither")
    kept = {name: read_baseline(name) for name in names}
    activate()
    measured = {}
    with progress_bar("baselines") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            measured[name] = measure_baseline(name, kept=kept[name], times=times, progress=step)
    moves = {name: compare_baseline(kept[name], measured[name]) for name in names}
    stray = [] if scenes else stray_baselines(FOG_SCENES)
    if update:
        # A missing reason is refused before the first file is written.
        new = [updated(kept[name], measured[name], because) for name in names]
        written = [baseline for baseline in new if baseline is not None]
        for baseline in written:
            write_baseline(baseline)
    if json:
        from validation.metrics.errors import plain

        print_json({"scenes": measured, "moves": plain(moves), "stray": stray, "updated": update})
    else:
        _print_moves(measured, moves, stray)
        if update:
            _print_updates(written, FOLDER)
    if stray or (not update and any(moves.values())):
        raise typer.Exit(1)


def _print_moves(after: "Mapping[str, Baseline]", moves: "Mapping[str, Sequence[Move]]", stray: Sequence[str]) -> None:
    """Print what moved, and a line for each scene."""
    from reports.tables.checks import move_table
    from reports.tables.terminal import print_table

    table = move_table(move for changed in moves.values() for move in changed)
    if table.rows:
        print_table(table)
    for name, data in after.items():
        print(f"{name}: {len(data['configurations'])} configurations, {len(moves[name])} moved")
    for name in stray:
        print(f"{name}: a baseline without its scene: remove the file")


def _print_updates(written: "Sequence[Baseline]", folder: Path) -> None:
    """Say what was written, and the lines that the changelog must hold."""
    from validation.frames.baseline_files import changelog_line

    if not written:
        print("nothing moved, nothing written")
        return
    print(f"written to {folder}: {', '.join(baseline['scene'] for baseline in written)}")
    lines = [changelog_line(baseline) for baseline in written if baseline["revision"] > 1]
    if lines:
        print("say so in CHANGELOG.md, with the numbers above; a test looks for these lines:")
        print("\n".join(f"- {line}" for line in lines))
