# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --scaling`: what methods cost as their work grows."""

import sys
from pathlib import Path
from typing import Any

import typer

_SIZE = (800, 600)


def print_scaling(names: list[str] | None, kinds: str, *, size, chosen, json: bool, markdown: bool) -> None:
    """Print times, memory and exponents by the work; exit status 1 if a time jumps."""
    from analytic.errors import InputError
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import counted, part_of, progress_bar
    from reports.tables.scaling import cliffs, scaling_tables
    from reports.tables.terminal import print_json
    from validation.scaling.ladders import KINDS, ladder
    from validation.scaling.study import study_scaling

    wanted = [kind.strip() for kind in kinds.split(",")]
    for kind in wanted:
        if kind not in KINDS:
            raise InputError(f"--scaling: got {kind!r}, wanted some of {','.join(KINDS)}")
    activate()
    pixels = size or _SIZE
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [(name, kind, ladder(kind, name, pixels)) for name in names or ["colonnade"] for kind in wanted]
    records: list[dict[str, Any]] = []
    with progress_bar("bench --scaling") as progress:
        for number, (name, kind, steps) in enumerate(ladders):
            part = part_of(progress, number / len(ladders), (number + 1) / len(ladders))
            records += [
                _record(name, pixels, found) for found in study_scaling(kind, steps, chosen, progress=counted(part))
            ]
    if json:
        print_json({"environment": describe_environment(), "scaling": records})
    else:
        if markdown:
            print_heading()
        print_tables(scaling_tables(records), as_markdown=markdown)
    jumps = cliffs(records)
    for jump in jumps:
        print(f"airlight: {jump}", file=sys.stderr)
    if jumps:
        raise typer.Exit(1)


def _record(name: str, size: tuple[int, int], found) -> dict[str, Any]:
    from dataclasses import asdict

    from validation.metrics.errors import plain

    values = plain(asdict(found))
    del values["configuration"]
    return {"scene": Path(name).stem, "size": list(size), "label": found.configuration.label} | values
