# SPDX-License-Identifier: BSD-3-Clause
"""`airlight figures`: figures and tables for papers."""

from pathlib import Path
from typing import Annotated

import typer

_FIGURES = {"polynomials": "the airlight kernel over theta, beside Biri's polynomials, derived and as printed"}


def figures(
    names: Annotated[
        list[str] | None, typer.Argument(help=f"Figures: {', '.join(_FIGURES)}; all by default.", show_default=False)
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the figures.")] = Path("airlight-figures"),
    rays: Annotated[int, typer.Option(min=64, max=1_000_000, help="Rays that tables count.")] = 100_000,
) -> None:
    """Write figures for papers as PDF and PNG, with the data of each as CSV beside it."""
    from analytic.errors import InputError
    from reference.files import ensure_folder
    from reports import figure_polynomials
    from reports.environment import activate
    from reports.progress import progress_bar
    from validation.load import nearest

    for name in names or ():
        if name not in _FIGURES:
            raise InputError(f"figure: got {name!r}, wanted one of {', '.join(_FIGURES)}" + nearest(name, _FIGURES))
    folder = ensure_folder(output)
    activate()
    with progress_bar("figures") as tell:
        tell(0.0, figure_polynomials.NAME)
        figure_polynomials.compute(folder, rays=rays)
        figure_polynomials.plot(folder)
    print(f"{folder / figure_polynomials.NAME}.pdf, .png and .csv: {_FIGURES[figure_polynomials.NAME]}")
