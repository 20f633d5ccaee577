# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare`: how far an image is from another, or from the truth of a scene."""

from pathlib import Path
from typing import Annotated, Any

import typer


def compare(
    files: Annotated[
        list[Path],
        typer.Argument(
            help="The EXR file to compare with and the one to judge; with --scene the one to judge.",
            metavar="[REFERENCE] TEST",
            show_default=False,
        ),
    ],
    scene: Annotated[
        str | None,
        typer.Option(
            help="Compare with the truth of this scene, a built-in one or a Mitsuba XML file.", show_default=False
        ),
    ] = None,
    layer: Annotated[
        str | None,
        typer.Option(
            help="Layer to compare, 'airlight' by default; 'total' is R/G/B, the default with --scene where there is "
            "no airlight.",
            show_default=False,
        ),
    ] = None,
    holds: Annotated[
        str | None,
        typer.Option(
            "--as",
            help="With --scene: what the layer holds, 'airlight', 'surface' or 'total'; what its name says by default.",
            show_default=False,
        ),
    ] = None,
    pixel: Annotated[
        str | None,
        typer.Option(
            help="With --scene: the truth at the 'centre' of each pixel, or its mean over the 'area'. By default both "
            "are computed and kept and what fits is used; the means take several times as long as the centres.",
            show_default=False,
        ),
    ] = None,
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
    """Compare two EXR images, or one with the truth of a scene, as `airlight describe SCENE` wants it.

    Prints bias and error quantiles, statistics if there are standard errors, and with --scene also the best-fitting
    factor, what may be wrong with the image as a whole, where most of the error lies, and whether the image is right.
    Exit status 1 if the test image has values that are negative or not finite, or if the bias is not shown to be within
    the margin.
    """
    from analytic.errors import InputError
    from reports.tables.terminal import print_json

    wanted = 2 if scene is None else 1
    if len(files) != wanted:
        usage = "REFERENCE.exr TEST.exr" if scene is None else "one EXR file beside --scene"
        hint = "; or name a scene by --scene" if scene is None else ""
        raise InputError(f"compare: got {len(files)} file{'s' * (len(files) != 1)}, wanted {usage}{hint}")
    if metrics not in ("basic", "all"):
        raise InputError(f"--metrics {metrics}; wanted 'basic' or 'all'")
    for option, value, known in (
        ("--pixel", pixel, ("centre", "area")),
        ("--as", holds, ("airlight", "surface", "total")),
    ):
        if value is not None and value not in known:
            raise InputError(f"{option} {value}; wanted {', '.join(map(repr, known[:-1]))} or {known[-1]!r}")
        if value is not None and scene is None:
            raise InputError(f"{option}: the pixels of a file are what they are; this option goes with --scene")
    options: dict[str, Any] = {
        "mask": mask,
        "margin": margin,
        "all_metrics": metrics == "all",
        "flip": flip,
        "exposure": exposure,
    }
    if scene is None:
        comparison: Any = _two_files(files, "airlight" if layer is None else layer, **options)
    else:
        comparison = _with_scene(scene, files[0], layer=layer, holds=holds, pixel=pixel, **options)
    print_json(comparison.to_json()) if json else print(comparison.summary())
    if comparison.failures:
        raise typer.Exit(1)


def _two_files(files: list[Path], layer: str, **options):
    from validation.comparison.images import compare_files

    return compare_files(files[0], files[1], layer, **options)


def _with_scene(scene: str, file: Path, **options):
    from reference.storage.exr import read_exr
    from reports.machine.environment import activate
    from reports.machine.progress import progress_bar
    from validation.comparison.engine_compare import compare_scene

    read_exr(file)  # unreadable files are refused before Mitsuba starts
    activate()
    with progress_bar("the truth") as progress:
        return compare_scene(scene, file, progress=progress, **options)
