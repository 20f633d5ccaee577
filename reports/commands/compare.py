# SPDX-License-Identifier: BSD-3-Clause
"""`airlight compare`: how far an image is from another, or from the truth of a scene."""

from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import Holds, Json, Mask, PixelKind


def compare(
    files: Annotated[
        list[str],
        typer.Argument(
            help="What to compare with, an EXR file or a scene (built-in or a Mitsuba XML file), and the EXR file "
            "to judge.",
            metavar="REFERENCE|SCENE TEST",
            show_default=False,
            autocompletion=completion.scenes_and_images,
        ),
    ],
    layer: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="Layer to compare, 'airlight' by default; 'total' is R/G/B, the default where there is no airlight.",
            show_default=False,
        ),
    ] = None,
    holds: Holds = None,
    pixel: PixelKind = None,
    difference: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="Write the difference: a .png file shows the signed relative error of each pixel in false colours, an "
            ".exr file has the values.",
            show_default=False,
        ),
    ] = None,
    margin: Annotated[
        float | None,
        typer.Option(
            metavar="SHARE", help="Largest relative bias that counts as agreement, such as 0.005.", show_default=False
        ),
    ] = None,
    mask: Mask = None,
    by_order: Annotated[
        bool,
        typer.Option("--by-order", help="Compare the layers by order of scattering too, such as airlight_3_4."),
    ] = False,
    metrics: Annotated[
        str,
        typer.Option(
            metavar="WHICH",
            help="'all' adds the errors of other tools and the colour differences.",
            autocompletion=completion.one_of("basic", "all"),
        ),
    ] = "basic",
    flip: Annotated[bool, typer.Option("--flip", help="Add HDR-FLIP, by the package flip-evaluator.")] = False,
    exposure: Annotated[
        float | None,
        typer.Option(
            metavar="STOPS",
            help="For the colour differences and FLIP; from the reference by default.",
            show_default=False,
        ),
    ] = None,
    diagnose: Annotated[
        bool,
        typer.Option("--diagnose", help="With a scene: say what is wrong with the image, in place of how far it is."),
    ] = False,
    json: Json = False,
) -> None:
    """Compare an image with another, or with the truth of a scene.

    Prints bias and error quantiles, statistics if there are standard errors, and with a scene also the best-fitting
    factor, what may be wrong with the image as a whole, where most of the error lies, and whether the image is right.
    Exit status 1 if the test image has values that are negative or not finite, or if the bias is not shown to be within
    the margin.

    --diagnose predicts the image that each of some sixty faults would make, of medium, lights, camera and encoding, and
    ranks them by evidence: what is wrong, by how much, and what is left over. See docs/your-engine.md.
    """
    from analytic.errors import InputError
    from reports.interchange.difference import check_difference, write_difference
    from reports.tables.terminal import print_json
    from validation.comparison.images import read_mask

    scene, paths = _scene_and_files(files)
    if metrics not in ("basic", "all"):
        raise InputError(f"--metrics {metrics}; wanted 'basic' or 'all'")
    for option, value, known in (
        ("--pixel", pixel, ("centre", "area")),
        ("--as", holds, ("airlight", "surface", "total")),
    ):
        if value is not None and value not in known:
            raise InputError(f"{option} {value}; wanted {', '.join(map(repr, known[:-1]))} or {known[-1]!r}")
        if value is not None and scene is None:
            raise InputError(f"{option}: the pixels of a file are what they are; this option goes with a scene")
    if difference is not None:
        check_difference("--difference", difference)
    if by_order and scene is not None:
        raise InputError(
            "--by-order: compares two files; make the truth by airlight reference SCENE --estimator cloud-paths"
        )
    if diagnose:
        if scene is None:
            raise InputError("--diagnose: it goes with a scene: airlight compare SCENE TEST.exr --diagnose")
        given = {"--difference": difference, "--margin": margin, "--mask": mask, "--exposure": exposure}
        others = [option for option, value in given.items() if value is not None] + ["--flip"] * flip
        if others or metrics != "basic":
            raise InputError(f"--diagnose: {', '.join(others) or '--metrics'} is about a comparison; leave one out")
        _diagnose(scene, paths[0], layer=layer, holds=holds, pixel=pixel, json=json)
        return
    options: dict[str, Any] = {
        "mask": mask,
        "margin": margin,
        "all_metrics": metrics == "all",
        "flip": flip,
        "exposure": exposure,
    }
    if scene is None:
        comparison: Any = _two_files(paths, layer, by_order=by_order, **options)
    else:
        comparison = _with_scene(scene, paths[0], layer=layer, holds=holds, pixel=pixel, **options)
    written = {}
    if difference is not None:
        images = _images(paths, comparison.layer) if scene is None else (comparison.truth, comparison.image)
        kept = None if mask is None else read_mask(mask)
        written = {"difference": str(difference)}
        shown = write_difference(difference, *images, kept=kept)
    if json:
        print_json(comparison.to_json() | written)
    else:
        print(comparison.summary())
        if written:
            print(f"wrote            {difference}: {shown}")
    if comparison.failures:
        raise typer.Exit(1)


def _diagnose(scene: str, file: Path, *, json: bool, **options) -> None:
    """Print what is wrong with an image of a scene."""
    from reference.storage.exr import read_exr
    from reports.machine.environment import activate
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json

    read_exr(file)  # unreadable files are refused before Mitsuba starts
    activate()
    from validation.diagnosis.diagnose import diagnose_file
    from validation.diagnosis.diagnosis_text import diagnosis_lines

    with progress_bar("diagnosis") as progress:
        diagnosis = diagnose_file(file, scene, progress=progress, **options)
    print_json(diagnosis.to_json()) if json else print("\n".join(diagnosis_lines(diagnosis)))


def _scene_and_files(words: list[str]) -> tuple[str | None, list[Path]]:
    """Return the scene, if the first word is one, and the files."""
    from analytic.errors import InputError

    if len(words) != 2:
        files = f"{len(words)} file{'s' * (len(words) != 1)}"
        raise InputError(f"compare: got {files}, wanted REFERENCE.exr TEST.exr, or SCENE TEST.exr")
    if _names_scene(words[0]):
        return words[0], [Path(words[1])]
    if _names_scene(words[1]) and not Path(words[1]).is_file():
        raise InputError(f"compare: the scene stands first: airlight compare {words[1]} {words[0]}")
    return None, [Path(word) for word in words]


def _names_scene(word: str) -> bool:
    """Return whether a word is meant as a scene: a built-in or random one, an XML file, or a name that no file has."""
    path = Path(word)
    known = word in completion.scene_names() or word.startswith("random:")
    return known or path.suffix.lower() == ".xml" or not (path.suffix or path.exists())


def _images(paths: list[Path], layer: str):
    """Return a layer of both files."""
    from reference.storage.exr import layer as image_layer
    from reference.storage.exr import read_exr

    return tuple(image_layer(read_exr(path), layer, path) for path in paths)


def _two_files(files: list[Path], layer: str | None, **options):
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
