# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare REFERENCE.exr TEST.exr`: how far an image is from another."""

from pathlib import Path
from typing import Annotated

import typer


def compare(
    reference: Annotated[Path, typer.Argument(help="The EXR file to compare with.", show_default=False)],
    test: Annotated[Path, typer.Argument(help="The EXR file to judge.", show_default=False)],
    layer: Annotated[str, typer.Option(help="Layer to compare; 'total' is R/G/B.")] = "airlight",
    margin: Annotated[
        float | None, typer.Option(help="Largest relative bias that counts as agreement, such as 0.005.")
    ] = None,
    mask: Annotated[Path | None, typer.Option(help="EXR file that is 0 in pixels to leave out.")] = None,
    metrics: Annotated[
        str, typer.Option(help="'all' adds the errors of other tools and the colour differences.")
    ] = "basic",
    flip: Annotated[bool, typer.Option("--flip", help="Add HDR-FLIP, by the package flip-evaluator.")] = False,
    exposure: Annotated[
        float | None, typer.Option(help="Stops, for the colour differences and FLIP; from the reference by default.")
    ] = None,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare two EXR images: bias, error quantiles, and statistics where the reference has standard errors.

    Exit status 1 if the test image has values that are not finite or negative, or the bias is not shown to be within
    the margin.
    """
    from analytic.errors import InputError
    from reports.tables import print_json
    from validation.compare import compare_files

    if metrics not in ("basic", "all"):
        raise InputError(f"--metrics {metrics}; wanted 'basic' or 'all'")
    comparison = compare_files(
        reference,
        test,
        layer,
        mask=mask,
        margin=margin,
        all_metrics=metrics == "all",
        flip=flip,
        exposure=exposure,
    )
    if json:
        print_json(comparison.to_json())
    else:
        print(comparison.summary())
    if comparison.failures:
        raise typer.Exit(1)
