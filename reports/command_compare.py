# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare REFERENCE.exr TEST.exr`: how far an image is from another."""

from pathlib import Path
from typing import Annotated

import typer


def compare(
    reference: Annotated[Path, typer.Argument(help="The EXR file to compare with.", show_default=False)],
    test: Annotated[Path, typer.Argument(help="The EXR file to judge.", show_default=False)],
    layer: Annotated[str, typer.Option(help="Layer to compare; 'total' is R/G/B.")] = "airlight",
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Compare two EXR images: bias, error quantiles, and statistics where the reference has standard errors.

    Exit status 1 if the test image has values that are not finite or negative.
    """
    from reports.tables import print_json
    from validation.compare import compare_files

    comparison = compare_files(reference, test, layer)
    if json:
        print_json(comparison.to_json())
    else:
        print(comparison.summary())
    if comparison.metrics.nonfinite or comparison.metrics.negative:
        raise typer.Exit(1)
