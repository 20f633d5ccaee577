# SPDX-License-Identifier: BSD-3-Clause
"""`airlight reference SCENE`: the ground truth of a scene, with its error."""

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer


class Estimator(StrEnum):
    """The estimators of the truth."""

    quadrature = "quadrature"
    volpath = "volpath"


def reference(
    scene: Annotated[str, typer.Argument(help="A built-in scene or a Mitsuba XML file.", show_default=False)],
    output: Annotated[Path, typer.Option("--output", "-o", help="The EXR file to write.")] = Path("reference.exr"),
    estimator: Annotated[Estimator, typer.Option(help="How to compute it.")] = Estimator.quadrature,
    spp: Annotated[int, typer.Option(min=64, help="volpath: samples a pixel, in batches of 32 to 256.")] = 2048,
    seed: Annotated[int, typer.Option(min=0, help="volpath: seed of the first batch.")] = 0,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the scene's own by default.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print a summary as JSON.")] = False,
) -> None:
    """Compute the ground truth of a scene and write it as layered EXR, with its error."""
    from reference.exr import write_exr
    from reference.files import ensure_writable
    from reports.environment import activate, stamped
    from reports.progress import progress_bar
    from reports.tables import print_json
    from validation.load import load_scene, parse_size
    from validation.references import quadrature_reference, volpath_reference

    ensure_writable(output)
    activate()
    loaded = load_scene(scene, parse_size(size) if size else None)
    with progress_bar(f"{loaded.name}: {estimator}") as tell:
        if estimator is Estimator.quadrature:
            image = quadrature_reference(loaded, progress=tell)
        else:
            image = volpath_reference(loaded, samples=spp, seed=seed, progress=tell)
    write_exr(output, stamped(image))
    means = {name: layer.mean(axis=(0, 1)).tolist() for name, layer in image.layers.items()}
    if json:
        print_json({"scene": loaded.name, "output": str(output), "estimator": str(estimator), "means": means})
    else:
        print(f"{output}: {loaded.name} by {estimator}")
        for name, mean in means.items():
            print(f"  {name}: mean {', '.join(f'{value:.6g}' for value in mean)} W/(m^2 sr)")
