# SPDX-License-Identifier: BSD-3-Clause
"""`airlight published`: the tables of a paper, measured again beside the printed figures."""

from typing import Annotated

import typer


def published(
    scenes: Annotated[
        str | None, typer.Option(help="Comma-separated scenes of the tables; all that are built in by default.")
    ] = None,
    kernels: Annotated[str, typer.Option(help="Comma-separated airlight kernels.")] = "exact,taylor",
    scale: Annotated[float, typer.Option(help="Of width and height; 1 for the published sizes.")] = 1.0,
    needless: Annotated[
        bool, typer.Option(help="Also measure that casters which are not there or not seen cost nothing.")
    ] = True,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print tables for a README, dated.")] = False,
) -> None:
    """Measure Tables 1 and 2 of Biri, Arques, Michelin 2006 again, with `shadow-planes`.

    Share of time by stage and frames a second, everything rebuilt after the light moved and static, at the published
    sizes, beside the published figures of 2006, and the error of the airlight against the quadrature truth.
    """
    from analytic.errors import InputError
    from reports.biri_tables import print_biri, rows_data
    from reports.environment import activate, describe_environment
    from reports.progress import progress_bar
    from reports.tables import print_json
    from validation.biri_tables import PUBLISHED, biri_rows
    from validation.kernel_choice import find_kernel
    from validation.needless import needless_costs
    from validation.scenes import SCENES

    if not 0 < scale <= 4:
        raise InputError(f"--scale: got {scale:g}, wanted more than 0, at most 4")
    built_in = [one for one in PUBLISHED if one.scene in SCENES]
    known = list(dict.fromkeys(one.scene for one in built_in))
    wanted = [name.strip() for name in scenes.split(",")] if scenes else known
    for name in wanted:
        if name not in known:
            raise InputError(f"--scenes: got {name!r}, wanted some of {', '.join(known)}")
    names = [name.strip() for name in kernels.split(",")]
    for name in names:
        find_kernel(name)
    activate()
    with progress_bar("published") as tell:
        chosen = [one for one in built_in if one.scene in wanted]
        rows = biri_rows(chosen, names, scale=scale, progress=tell)
        tell(0.99, "what is not needed")
        costs = needless_costs(size=(round(800 * scale), round(600 * scale))) if needless else []
    if json:
        print_json({"environment": describe_environment()} | rows_data(rows, costs))
    else:
        print_biri(rows, costs, markdown=markdown)
