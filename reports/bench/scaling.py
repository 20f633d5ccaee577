# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --scaling`: what methods cost as their work grows."""

import sys
from pathlib import Path
from typing import Any

import typer

_SIZE = (800, 600)
_KEPT = Path(__file__).resolve().parents[2] / "validation/baselines/scaling"  # what `bench --scaling --json` printed
_EARLIER = "what `bench --scaling --json` printed, or a report.json of `report --full`"


def print_scaling(
    names: list[str] | None, kinds: str, *, size, chosen, against: Path | None, json: bool, markdown: bool
) -> None:
    """Print times, memory and exponents by the work; exit status 1 if a time jumps or grows faster than it did."""
    from analytic.errors import InputError
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import counted, part_of, progress_bar
    from reports.report.others import scaling_data
    from reports.tables.scaling import cliffs, grown, scaling_tables
    from reports.tables.terminal import print_json
    from validation.study.growth import study_scaling
    from validation.study.ladders import KINDS, ladder

    wanted = [kind.strip() for kind in kinds.split(",")]
    for kind in wanted:
        if kind not in KINDS:
            raise InputError(f"--scaling: got {kind!r}, wanted some of {','.join(KINDS)}")
    earlier = _earlier(against, names or ["colonnade"])
    activate()
    pixels = size or _SIZE
    # Scenes that have nothing of a kind are refused before an hour of work, not after.
    ladders = [(name, kind, ladder(kind, name, pixels)) for name in names or ["colonnade"] for kind in wanted]
    records: list[dict[str, Any]] = []
    with progress_bar("bench --scaling") as progress:
        for number, (name, kind, steps) in enumerate(ladders):
            part = part_of(progress, number / len(ladders), (number + 1) / len(ladders))
            found = study_scaling(kind, steps, chosen, progress=counted(part))
            records += [scaling_data(name, pixels, each) for each in found]
    if json:
        print_json({"environment": describe_environment(), "scaling": records})
    else:
        if markdown:
            print_heading()
        print_tables(scaling_tables(records), as_markdown=markdown)
    faults = [*cliffs(records), *grown(earlier, records)]
    for fault in faults:
        print(f"airlight: {fault}", file=sys.stderr)
    if faults:
        raise typer.Exit(1)


def _earlier(against: Path | None, names: list[str]) -> list[dict[str, Any]]:
    """Return the records of an earlier run: of the file that the user names, or the baselines of built-in scenes.

    A baseline is what `airlight bench SCENE --scaling KIND --json` printed once for size, triangles, lights and map.
    """
    from analytic.errors import InputError
    from reports.data.json_files import read_json
    from reports.tables.scaling import is_record

    if against is None:
        kept = [_KEPT / f"{name}.json" for name in names]
        files = [path for path in kept if path.is_file()]
    else:
        files = [against]
    records = []
    for path in files:
        data = read_json(path, _EARLIER)
        found = data.get("scaling") if isinstance(data, dict) else None
        if not isinstance(found, list) or not found or not all(map(is_record, found)):
            raise InputError(f"{path}: it holds no `scaling`; wanted {_EARLIER}")
        records += found
    return records
