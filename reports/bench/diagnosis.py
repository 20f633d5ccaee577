# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --diagnosis`: planted faults and what a diagnosis answers."""

import typer

_SMALL = "64x48"  # of images in which faults are planted: thousands of pixels are enough


def print_diagnoses(scenes: list[str] | None, *, size: str | None, json: bool, markdown: bool) -> None:
    """Print which planted faults a diagnosis names; exit status 1 if it names a fault of a right image."""
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import progress_bar
    from reports.tables.diagnosis import answers_sentence, answers_table
    from reports.tables.terminal import print_json
    from validation.frames.result_cache import now
    from validation.scenes.loading import parse_size
    from validation.scenes.registry import FOG_SCENES

    pixels = parse_size(size or _SMALL)
    activate()
    from validation.diagnosis.planted import planted_answers

    with progress_bar("bench --diagnosis") as progress:
        rows = planted_answers(scenes or list(FOG_SCENES), pixels, progress=progress)
    if json:
        print_json({"measured": now(), "environment": describe_environment(), "size": list(pixels), "diagnosis": rows})
    else:
        if markdown:
            print_heading()
        print_tables([answers_table(rows)], as_markdown=markdown)
        print(f"\n{answers_sentence(rows)}")
    if any(row["planted"] == "right" and not row["right"] for row in rows):
        raise typer.Exit(1)
