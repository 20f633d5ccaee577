# SPDX-License-Identifier: BSD-3-Clause
"""`airlight clouds`: the tables that methods for clouds look up."""

from typing import Annotated

import typer

from reports.commands.options import Json


def clouds(
    tables: Annotated[
        bool, typer.Option("--tables", help="Make the tables of the canonical transport, or show those that are kept.")
    ] = False,
    phase: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="isotropic, hg:G, hg-draine:D, mie, mie-modified, or a CSV file of angles and values.",
        ),
    ] = "mie-modified",
    albedo: Annotated[float, typer.Option(metavar="A", help="Single-scattering albedo.")] = 1.0,
    json: Json = False,
) -> None:
    """Make the tables that methods for clouds look up.

    They hold light scattered in a slab by sets of orders, with where it entered: T, c and sigma. They are kept in the
    cache, so that each phase function and albedo takes its minutes once. See docs/the-reference.md.
    """
    from analytic.errors import InputError
    from reports.machine.environment import activate
    from reports.machine.progress import progress_bar
    from reports.tables.clouds import clouds_sentence, clouds_table
    from reports.tables.terminal import print_json, print_table
    from validation.slab.canonical import canonical_record

    if not tables:
        raise InputError("clouds: got nothing to do, wanted --tables")
    activate()
    with progress_bar("clouds") as progress:
        record = canonical_record(phase, albedo, progress=progress)
    if json:
        print_json(record)
        return
    print_table(clouds_table(record))
    print(f"\n{clouds_sentence(record)}")
