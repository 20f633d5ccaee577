# SPDX-License-Identifier: BSD-3-Clause
"""`airlight fidelity`: a verdict for every claim of the papers that are built here."""

from typing import Annotated

import typer


def fidelity(
    paper: Annotated[
        str | None,
        typer.Option(
            metavar="NAME", show_default=False, help="biri, billeter, bouthors, sun, pegoraro or chen; all by default."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Only the rows that need no image.")] = False,
    fresh: Annotated[bool, typer.Option("--fresh", help="Measure again what was kept from earlier runs.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print tables for a README, dated.")] = False,
) -> None:
    """Print a verdict on every claim of the papers.

    Every equation, figure, table and sentence: published beside measured. A verdict is reproduced, refuted, differs
    (it depends on machine or scene) or impossible. Each is computed from what this command measures, or from what
    is kept from an earlier run.
    """
    from analytic.errors import InputError
    from reports.machine.environment import activate, describe_environment
    from reports.machine.printing import print_heading, print_tables
    from reports.machine.progress import progress_bar
    from reports.papers.fidelity import count_words, fidelity_tables
    from reports.report.fidelity import measure_fidelity
    from reports.report.kept import report_cache
    from reports.tables.terminal import print_json
    from validation.fidelity.catalogue import PAPERS, ROWS
    from validation.frames.result_cache import now

    if paper is not None and paper not in PAPERS:
        raise InputError(f"--paper: got {paper!r}, wanted one of {', '.join(PAPERS)}")
    rows = [row for row in ROWS if paper in (None, row.paper)]
    activate()
    environment = describe_environment()
    with progress_bar("fidelity") as progress:
        judged = measure_fidelity(rows, report_cache(environment, fresh=fresh), quick=quick, progress=progress)
    if json:
        print_json(
            {"measured": now(), "environment": environment, "fidelity": judged, "left_out": len(rows) - len(judged)}
        )
        return
    if markdown:
        print_heading()
    shown = ("item", "claim", "verdict", "published", "measured", "unit", "why")
    print_tables((table.only(*shown) for table in fidelity_tables(judged)), as_markdown=markdown)
    print(f"\n{count_words(judged)}.")
    if len(judged) < len(rows):
        print(f"{len(rows) - len(judged)} more rows need images: leave out --quick.")
