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

    from analytic.errors import InputError, nearest
    from reference.storage.files import write_text
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import progress_bar
    from reports.report.claims import measure_claims
    from reports.report.kept import report_cache
    from reports.tables.papers import count_words, number_tables, verdict_tables
    from reports.tables.terminal import print_json
    from validation.frames.result_cache import now
    from validation.papers.claims import claims, papers

    if name is not None and name not in papers():
        raise InputError(f"paper: got {name!r}, wanted one of {', '.join(papers())}" + nearest(name, papers()))
    chosen = [claim for claim in claims() if name in (None, claim.paper)]
    activate()
    environment = describe_environment()
    with progress_bar("paper") as progress:
        rows = measure_claims(chosen, report_cache(environment, fresh=fresh), quick=quick, progress=progress)
    data = {"measured": now(), "environment": environment, "papers": rows, "left_out": len(chosen) - len(rows)}
    if output is not None:
        write_text(output, json_format.dumps(data, indent=1) + "\n")
    if json:
        print_json(data)
        return
    if markdown:
        print_heading()
    print_tables([*verdict_tables(rows), *(number_tables(rows) if tables else [])], as_markdown=markdown)
    print(f"\n{count_words([row for row in rows if row['verdict'] is not None])}.")
    if len(rows) < len(chosen):
        print(f"{len(chosen) - len(rows)} more rows need images: leave out --quick.")
