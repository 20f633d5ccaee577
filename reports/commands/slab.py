# SPDX-License-Identifier: BSD-3-Clause
"""`airlight slab`: the light of a homogeneous slab in sunlight by order of scattering."""

from typing import Annotated

import typer

from reports.commands.options import Force


def slab(
    tau: Annotated[float, typer.Option(metavar="T", help="Thickness of the slab [mean free paths].")],
    sun: Annotated[float, typer.Option(metavar="DEG", help="Zenith angle of the sun [degrees].")],
    phase: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="isotropic, hg:G, hg-draine:D, mie, mie-modified, or a CSV file of angles [degrees] and values.",
        ),
    ] = "isotropic",
    albedo: Annotated[float, typer.Option(metavar="A", help="Single-scattering albedo.")] = 1.0,
    orders: Annotated[
        str,
        typer.Option(
            metavar="WHICH", help="Orders, such as 1,2,3-4,31-inf; sets: those of Bouthors 2008; all: their sum."
        ),
    ] = "sets",
    depths: Annotated[
        str | None,
        typer.Option(
            metavar="T,..",
            show_default=False,
            help="Comma-separated depths [mean free paths]; top and bottom by default.",
        ),
    ] = None,
    directions: Annotated[
        str,
        typer.Option(
            metavar="MU:PHI,..",
            show_default=False,
            help="Of the radiance: mu positive upwards, phi [degrees] 0 forward.",
        ),
    ] = "",
    photons: Annotated[int, typer.Option(metavar="N", help="Check with so many photons.")] = 0,
    seed: Annotated[int, typer.Option(metavar="N", help="Of the photons.")] = 0,
    force: Force = False,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compute the light of a slab in sunlight by order of scattering.

    That is what it reflects and transmits, and where that light leaves it.

    Order n is light that was scattered n times. The numbers come from a deterministic computation with an estimate of
    its error; --photons puts a random walk with standard errors beside them. See docs/the-reference.md.
    """
    from analytic.errors import InputError
    from reports.machine.progress import progress_bar
    from reports.tables.slab import slab_sentence, slab_tables
    from reports.tables.terminal import print_json, print_table
    from validation.slab.light import expected_seconds, slab_numbers
    from validation.slab.request import slab_request

    if photons < 0 or photons == 1:
        raise InputError(f"--photons: got {photons}, wanted at least 2, for example 1000000")
    if seed < 0:
        raise InputError(f"--seed: got {seed}, wanted a whole number from 0 on")
    request = slab_request(tau, sun, phase=phase, albedo=albedo, orders=orders, depths=depths, directions=directions)
    hours = expected_seconds(request, photons) / 3600
    if hours > 1 and not force:
        raise InputError(f"--photons: {photons} photons would take about {hours:.1f} hours; give fewer, or --force")
    with progress_bar("slab") as progress:
        record = slab_numbers(request, photons=photons, seed=seed, progress=progress)
    if json:
        print_json(record)
        return
    for each in slab_tables(record):
        print_table(each)
    print(f"\n{slab_sentence(record)}")
