# SPDX-License-Identifier: BSD-3-Clause
"""`airlight maps [SCENE...]`: error and flicker against the size of the shadow map."""

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import USUAL_LIMIT, Force, Json, Kernel, Markdown, MethodLimit, Scenes, Settings

if TYPE_CHECKING:
    from validation.study.maps import MapErrors, MapFlicker


def maps(
    scenes: Scenes = None,
    method: Annotated[
        str,
        typer.Option(metavar="NAME", help="A method with a shadow map.", autocompletion=completion.methods),
    ] = "light-volumes",
    kernel: Kernel = None,
    settings: Settings = None,
    sizes: Annotated[
        str, typer.Option(metavar="SIZES", help="Comma-separated sizes of the shadow map [texels].")
    ] = "32,64,128,256,512,1024,2048,4096",
    size: Annotated[str, typer.Option(metavar="WxH", help="Width and height of the image in pixels.")] = "160x120",
    flicker: Annotated[
        bool, typer.Option("--flicker", help="Also move the light and measure how it flickers.")
    ] = False,
    frames: Annotated[int, typer.Option(min=2, metavar="N", help="Frames of the moving light.")] = 9,
    step: Annotated[
        float, typer.Option(metavar="RAD", help="By how much the light turns from frame to frame [rad].")
    ] = 1e-3,
    method_limit: MethodLimit = USUAL_LIMIT,
    force: Force = False,
    json: Json = False,
    markdown: Markdown = False,
) -> None:
    """Measure error and flicker against the size of the shadow map.

    The error is against the quadrature reference. Also prints the slope of the relative RMSE, fitted to the logarithms.
    With --flicker the light circles slowly, and the change of the image from frame to frame is measured, less that
    of the truth.
    """
    from analytic.errors import InputError
    from reports.commands.own_methods import checked_configuration
    from reports.machine.environment import activate, describe_environment
    from reports.machine.own_process import in_own_process
    from reports.machine.printing import print_heading
    from reports.tables.terminal import print_json
    from validation.metrics.errors import plain
    from validation.scenes.loading import parse_size
    from validation.scenes.registry import FOG_SCENES
    from validation.study.configuration import parse_settings

    pixels = parse_size(size)
    texels = parse_map_sizes("--sizes", sizes)
    parameters = parse_settings(settings or [])
    if "map" in parameters:
        raise InputError(f"--set: got map={parameters['map']}, wanted it in --sizes: the map's size is what varies")
    largest = checked_configuration(method, kernel, parameters | {"map": texels[-1]}, limit=method_limit)
    activate()
    call: Any = partial(in_own_process, _studied, name=method, limit=method_limit) if largest.own else _studied
    moves = {"frames": frames, "step": step} if flicker else None
    studied = call(scenes or list(FOG_SCENES), pixels, texels, method, kernel, parameters, moves, force)
    if json:
        scenes_data = [
            {"name": name, "method": errors.configuration.label, "errors": plain(errors), "flicker": plain(moving)}
            for name, errors, moving in studied
        ]
        print_json({"environment": describe_environment(), "size": list(pixels), "scenes": scenes_data})
        return
    if markdown:
        print_heading()
    for name, errors, moving in studied:
        title = f"{name}, {pixels[0]} x {pixels[1]}, {errors.configuration.label}"
        _print_scene(title, errors, moving, markdown=markdown)


def _studied(
    names: list[str],
    pixels: tuple[int, int],
    texels: list[int],
    method: str,
    kernel: str | None,
    parameters: dict[str, Any],
    moves: dict[str, Any] | None,
    force: bool,
) -> list[tuple[str, "MapErrors", "MapFlicker | None"]]:
    """Return of every scene its name, the errors, and the flicker where the light moves."""
    from realtime.scene.read_scene import read_scene
    from reports.machine.progress import counted, part_of, progress_bar
    from validation.scenes.loading import load_scene
    from validation.study.configuration import configuration, prepared
    from validation.study.cost import check_work, frame_work, truth_work
    from validation.study.maps import map_errors, map_flicker

    loaded = [load_scene(name, pixels) for name in names]
    images = 1 + (moves["frames"] if moves else 0)
    works = [truth_work(pixels, lights=len(opened.scene.emitters()), images=images) for opened in loaded]
    works += [frame_work(pixels, frames=images * len(texels)) for _ in loaded]
    check_work(f"maps, {pixels[0]} x {pixels[1]}", works, force=force)
    largest = configuration(method, kernel, parameters | {"map": texels[-1]})
    for opened in loaded:  # refuse unusable scenes, and maps that exceed the memory, before any work
        prepared(read_scene(opened.scene), largest)
    studied = []
    with progress_bar("maps") as progress:
        for number, opened in enumerate(loaded):
            studies: list[Any] = [partial(map_errors, opened.scene, method)]
            if moves:
                studies.append(partial(map_flicker, opened.scene, method, about=opened.animation.about, **moves))
            results = []
            for study in studies:
                part = part_of(progress, number / len(loaded), (number + 1) / len(loaded), before=f"{opened.name}, ")
                results.append(study(kernel=kernel, parameters=parameters, sizes=texels, progress=counted(part)))
            studied.append((opened.name, results[0], results[1] if moves else None))
    return studied


def _print_scene(title: str, errors: "MapErrors", flicker: "MapFlicker | None", *, markdown: bool) -> None:
    from reports.tables.map_size import error_sentence, error_table, flicker_sentence, flicker_table
    from reports.tables.terminal import print_table

    print_table(error_table(title, errors), as_markdown=markdown)
    print(f"\n{error_sentence(errors)}")
    if flicker is not None:
        print_table(flicker_table(title, flicker), as_markdown=markdown)
        print(f"\n{flicker_sentence(flicker)}")


def parse_map_sizes(option: str, words: str) -> list[int]:
    """Return the sizes of shadow maps that an option names, ascending.

    Raises
    ------
    InputError
        If one of them is not a size of a map.
    """
    from analytic.errors import InputError
    from realtime.shadow_maps.shadow_map import check_size

    try:
        sizes = [int(word) for word in words.split(",")]
    except ValueError:
        raise InputError(f"{option}: got {words!r}, wanted sizes in texels, for example 128,256,512") from None
    for size in sizes:
        check_size(size)
    return sorted(set(sizes))
