# SPDX-License-Identifier: BSD-3-Clause
"""`airlight stability`: where kernels break."""

from typing import Annotated

import typer

from reports.commands.options import listed


def stability(
    kernels: Annotated[
        str | None,
        typer.Option(
            metavar="NAMES",
            show_default=False,
            help="Comma-separated: a kernel, 'name-N' or 'module:function'; all by default.",
        ),
    ] = None,
    rays: Annotated[int, typer.Option(min=64, max=1_000_000, metavar="N", help="Number of generated rays.")] = 100_000,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Look for rays on which kernels break.

    Tries every kernel on certified values and on rays of every magnitude. Prints the ray of each largest error in the
    format of `airlight integrate`. Exit status 1 if a kernel that claims to be exact exceeds the error that it claims.
    """
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.stability import print_stability
    from reports.tables.terminal import print_json
    from validation.kernels.stability import CERTIFIED, Bar
    from validation.kernels.stability import stability as run
    from validation.metrics.errors import plain

    names = None if kernels is None else listed("--kernels", kernels)
    activate()
    with progress_bar("stability") as progress:
        results = run(names, count=rays, progress=lambda done, total, what: progress(done / total, what))
    if json:
        data = {"environment": describe_environment(), "certified": CERTIFIED, "bar": Bar(), "kernels": results}
        print_json(plain(data))
    else:
        print_stability(plain(results))
    if any(kernel.broken for kernel in results):
        raise typer.Exit(1)
