# SPDX-License-Identifier: BSD-3-Clause
"""`airlight paper`: a verdict for every claim of the papers that are built here, and their numbers beside ours."""

from pathlib import Path
from typing import Annotated

import typer


def paper(
    name: Annotated[
        str | None,
        typer.Argument(metavar="NAME", show_default=False, help="biri, billeter, ali or bouthors; all by default."),
    ] = None,
    tables: Annotated[
        bool, typer.Option("--tables", help="The numbers without a verdict too: rates of graphics cards beside ours.")
    ] = False,
    quick: Annotated[bool, typer.Option("--quick", help="Only the claims that need no image.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what was cached by earlier runs.")] = False,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", show_default=False, help="Write JSON to this file too."),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print tables for a README, dated.")] = False,
) -> None:
    """Print a verdict on every claim of the papers.

    Equations, figures, tables and sentences: published beside measured. A verdict is reproduced, not reproduced,
    differs (it depends on the machine or on a scene of ours) or impossible. Each is computed from what this command
    measures, or from what is cached by an earlier run; all take an hour or so.
    """
    import json as json_format

    from reference.storage.files import write_text
    from reports.api.studies import paper as measured
    from reports.machine.environment import describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.tables.papers import count_words, number_tables, verdict_tables
    from reports.tables.terminal import print_json
    from validation.study.results import date

    found = measured(name, quick=quick, fresh=fresh, progress=True)
    rows = found.rows
    data = {"measured": date(), "environment": describe_environment(), "papers": rows, "left_out": found.left_out}
    if output is not None:
        write_text(output, json_format.dumps(data, indent=1) + "\n")
    if json:
        print_json(data)
        return
    if markdown:
        print_heading()
    print_tables([*verdict_tables(rows), *(number_tables(rows) if tables else [])], as_markdown=markdown)
    print(f"\n{count_words([row for row in rows if row['verdict'] is not None])}.")
    if found.left_out:
        print(f"{found.left_out} more rows need images: leave out --quick.")
