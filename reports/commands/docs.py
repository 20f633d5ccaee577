# SPDX-License-Identifier: BSD-3-Clause
"""`airlight docs`: the documentation as pages to read in a browser."""

from pathlib import Path
from typing import Annotated

import typer


def docs(
    output: Annotated[Path, typer.Option("--output", "-o", metavar="DIR", help="Folder of the pages.")] = Path(
        "airlight-docs"
    ),
    report: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            show_default=False,
            help="First take the numbers from this report's folder; changes docs/data.",
        ),
    ] = None,
    kernels: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            show_default=False,
            help="First take the kernels' costs from what `airlight bench --kernels --json` printed.",
        ),
    ] = None,
) -> None:
    """Build the documentation, HTML pages that need no network.

    Warnings of Sphinx are errors: exit status 1.
    """
    from reports.docs.build import build_docs, source_folder

    source = source_folder()
    if report is not None or kernels is not None:
        from reports.docs.data import refresh
        from reports.machine.environment import activate

        activate()  # counting shapes and triangles loads the scenes
        for path in refresh(source / "data", report=report, kernels=kernels):
            print(path)
    problems = build_docs(source, output)
    print(problems or output / "index.html")
    if problems:
        raise typer.Exit(1)
