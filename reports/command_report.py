# SPDX-License-Identifier: BSD-3-Clause
"""`airlight report`: the error report."""

import shlex
import sys
from pathlib import Path
from typing import Annotated

import typer


def report(
    quick: Annotated[bool, typer.Option("--quick", help="Small images, few samples: three minutes.")] = False,
    full: Annotated[bool, typer.Option("--full", help="Large images, many samples; much longer.")] = False,
    scenes: Annotated[
        str | None,
        typer.Option(help="Comma-separated built-in scenes and Mitsuba XML files; by default all, three with --quick."),
    ] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods; all by default.")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the report.")] = Path("airlight-report"),
    json: Annotated[bool, typer.Option("--json", help="Print report.json.")] = False,
) -> None:
    """Measure every method in every scene and write the report: one HTML page, report.json, EXR and PNG files.

    Exit status 1 if single-scatter or volpath does not confirm the truth within the margin.
    """
    from analytic.errors import InputError
    from realtime.methods import METHODS
    from realtime.scene import read_scene
    from reference.files import ensure_folder
    from reports.claims import confirmed
    from reports.environment import activate
    from reports.progress import progress_bar
    from reports.report import write_report
    from reports.tables import print_json
    from validation.configurations import QUICK, chosen_configurations
    from validation.load import load_scene
    from validation.scenes import SCENES
    from validation.study import EFFORTS, QUICK_SCENES

    if quick and full:
        raise InputError("report: got both --quick and --full; give one of them, or neither for the default")
    effort = EFFORTS["quick" if quick else "full" if full else "default"]
    if quick and not methods:
        chosen = QUICK
    else:
        chosen = chosen_configurations([name.strip() for name in (methods.split(",") if methods else METHODS)])
    built_in = QUICK_SCENES if quick else SCENES
    names = [name.strip() for name in scenes.split(",")] if scenes else list(built_in)
    ensure_folder(output)
    activate()
    for name in names:  # refuse what cannot be used before the work begins
        read_scene(load_scene(name, (8, 6)).scene)
    with progress_bar("report") as tell:
        command = shlex.join(["airlight", *sys.argv[1:]])
        data = write_report(output, scenes=names, effort=effort, configurations=chosen, command=command, progress=tell)
    if json:
        print_json(data)
    else:
        print("\n".join(f"- {claim['text']}" for claim in data["claims"]))
        print(f"{output / 'report.html'}: {len(names)} scenes in {data['seconds']:.0f} s")
    if not confirmed(data["scenes"]):
        raise typer.Exit(1)
