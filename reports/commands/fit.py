# SPDX-License-Identifier: BSD-3-Clause
"""`airlight fit`: which parameters of the fog explain an image."""

from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import Holds, Json, Mask, PixelKind, listed


def fit(
    image: Annotated[Path, typer.Argument(help="The EXR file to explain.", show_default=False)],
    scene: Annotated[
        str,
        typer.Option(
            metavar="SCENE",
            help="What it shows, a built-in scene or a Mitsuba XML file; what is not looked for is taken from it.",
            show_default=False,
            autocompletion=completion.scenes_and_images,
        ),
    ],
    parameters: Annotated[
        str,
        typer.Option(
            metavar="NAMES",
            help="What is looked for: sigma_t, albedo (each also with .r, .g or .b), phase.g, intensity, exposure, "
            "light.x, light.y, light.z; of one medium or light NAME as sigma_t:NAME.",
        ),
    ] = "sigma_t,albedo",
    start: Annotated[
        str,
        typer.Option(
            metavar="NAME=VALUE,..",
            help="Values to begin with; the scene's own by default.",
            show_default=False,
        ),
    ] = "",
    layer: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Layer to explain, 'airlight' by default, or 'total', R/G/B.",
            show_default=False,
        ),
    ] = None,
    holds: Holds = None,
    pixel: PixelKind = None,
    mask: Mask = None,
    json: Json = False,
) -> None:
    """Find the parameters of the fog that explain an image.

    Each comes with its 95 % interval: parameters of media, lights and exposure. Pixels that disagree with what
    explains the others are left out. What the image cannot tell apart, such as albedo and intensity in the
    airlight, is said, with a way out. See docs/your-engine.md.
    """
    from analytic.errors import named_values
    from reference.storage.exr import read_exr
    from reports.machine.environment import activate
    from reports.machine.progress import progress_bar
    from reports.tables.fit import parameters_table
    from reports.tables.terminal import print_json, print_table

    names = listed("--parameters", parameters)
    words = listed("--start", start) if start.strip() else []
    starts = named_values("--start", words, float, "NAME=VALUE, such as sigma_t=0.1")
    read_exr(image)  # unreadable files are refused before Mitsuba starts
    activate()
    from validation.fit.fit import fit_file
    from validation.fit.fit_text import fit_lines

    options: dict[str, Any] = {"layer": layer, "holds": holds, "pixel": pixel, "mask": mask, "starts": starts}
    with progress_bar("fit") as progress:
        explained = fit_file(image, scene, names, progress=progress, **options)
    if json:
        print_json(explained.to_json())
        return
    print_table(parameters_table(explained.to_json()))
    print("\n" + "\n".join(fit_lines(explained)))
