# SPDX-License-Identifier: BSD-3-Clause
"""`airlight integrate CASES.csv`: the airlight integral of each row of a file by a kernel."""

from pathlib import Path
from typing import Annotated

import typer

from reports.commands import completion


def integrate(
    cases: Annotated[
        Path,
        typer.Argument(
            metavar="CASES.csv",
            help="CSV with the columns of airlight_integral.csv; x1 may be inf.",
            show_default=False,
        ),
    ],
    kernel: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Airlight kernel, see `airlight list kernels`.",
            autocompletion=completion.kernels,
        ),
    ] = "exact",
    precision: Annotated[
        str,
        typer.Option(metavar="NAME", help="single or double.", autocompletion=completion.one_of("single", "double")),
    ] = "single",
    phase: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            show_default=False,
            help="Phase function of all rows, in place of the file's: hg:G, hg-draine:DIAMETER, "
            "mie:RADIUS:GAMMA:WAVELENGTH, mie-modified, ...",
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output", "-o", metavar="FILE", help="Write the rows with a column `result`.", show_default=False
        ),
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Integrate the airlight of each row of a CSV file by a kernel.

    Rows that have a value are compared with it.

    Results that are not finite are refused, with the first row.
    """
    from analytic.cases import read_cases
    from reference.storage.files import ensure_writable
    from reports.machine.environment import activate
    from reports.tables.terminal import print_json
    from validation.kernels.cases import check_results, integrate_cases, summary, write_results

    read = read_cases(cases, phase=phase)
    if output is not None:
        ensure_writable(output)
    activate()
    results = integrate_cases(read, kernel, precision)
    check_results(read, results, kernel)
    if output is not None:
        write_results(read, results, output)
    report = summary(read, results)
    if json:
        print_json(report)
        return
    print(f"{report['rows']} rows with {kernel} in {precision} precision")
    if report["compared"]:
        errors = ", ".join(f"{name} {report[name]:.3g}" for name in ("p50", "p99", "max"))
        print(
            f"relative error against `value`, {report['compared']} rows: {errors}; worst in row {report['worst_row']}"
        )
    if output is None and not report["compared"]:
        print("\n".join(f"{value:.9g}" for value in results))
