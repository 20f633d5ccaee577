# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench [SCENE...]`: its options, and which table they ask for."""

from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from reports.bench.decompose import print_decomposition
from reports.bench.estimators import print_estimators
from reports.bench.kernels import print_kernels
from reports.bench.methods import print_methods, steps
from reports.bench.scaling import print_scaling
from reports.commands import completion
from reports.commands.options import (
    USUAL_LIMIT,
    Force,
    Json,
    Markdown,
    Meshes,
    MethodLimit,
    Methods,
    Ranges,
    Scenes,
    Settings,
    Size,
    drawn_from,
)

_MARGIN = 0.01  # relative bias of volpath that counts as agreement
_OF_METHODS = {"a scene", "--method", "--kernel", "--set", "--size", "--meshes", "--ranges", "--method-limit"}
#: What each table takes of the options that only some take; "" is the table of methods.
_TAKES = {
    "": {*_OF_METHODS, "--no-truth", "--margin", "--force", "--markdown"},
    "--kernels": {"--kernel", "--phase", "--markdown"},
    "--estimators": {"a scene", "--size", "--meshes", "--ranges", "--force"},
    "--decompose": {*_OF_METHODS, "--output", "--force", "--markdown"},
    "--scaling": {*_OF_METHODS, "--against", "--markdown"},
}


def bench(
    scenes: Scenes = None,
    method: Methods = None,
    kernel: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Airlight kernel of the methods, or with --kernels a kernel to time; may be given several times.",
            show_default=False,
            autocompletion=completion.kernels,
        ),
    ] = None,
    settings: Settings = None,
    size: Size = None,
    meshes: Meshes = None,
    ranges: Ranges = None,
    kernels: Annotated[bool, typer.Option("--kernels", help="Time the kernels alone, on 480 000 rays.")] = False,
    phase: Annotated[
        str | None,
        typer.Option(
            metavar="NAME",
            help="With --kernels: the only phase function, such as hg-draine:12 or mie:6.",
            show_default=False,
        ),
    ] = None,
    estimators: Annotated[
        bool, typer.Option("--estimators", help="Time single-scatter and volpath at equal error.")
    ] = False,
    decompose: Annotated[
        bool, typer.Option("--decompose", help="Split the error of every method by its causes, in place of timing it.")
    ] = False,
    scaling: Annotated[
        str | None,
        typer.Option(
            metavar="KINDS",
            help="Time methods as their work grows: some of size,triangles,lights,media,map.",
            show_default=False,
        ),
    ] = None,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="With --scaling: what its --json printed before; the baseline of the scene by default.",
            show_default=False,
        ),
    ] = None,
    output: Annotated[
        Path | None,
        typer.Option(
            "--output",
            "-o",
            metavar="DIR",
            help="With --decompose: write images of the parts into this folder, by scene.",
            show_default=False,
        ),
    ] = None,
    truth: Annotated[bool, typer.Option(help="Also compare the truth with single-scatter and volpath.")] = True,
    margin: Annotated[
        float,
        typer.Option(
            metavar="SHARE",
            help="Relative bias of volpath that counts as agreement; the time grows like 1/margin^2.",
        ),
    ] = _MARGIN,
    method_limit: MethodLimit = USUAL_LIMIT,
    force: Force = False,
    json: Json = False,
    markdown: Markdown = False,
) -> None:
    """Print tables of speed against error: methods, or kernels.

    Every method is timed in every scene and compared with the truth, or with --kernels every kernel on many rays.
    --kernels, --estimators, --decompose and --scaling are tables of their own: one of them may be given.

    `airlight` is the airlight alone (the kernel with its ray set-up), `frame` a frame with static geometry and light,
    `light moved` a frame after the light moved. Exit status 1 if single-scatter does not confirm the truth within
    +-0.05 %, or volpath within +- the margin, or if a method of your own is at fault.

    --scaling prints times, memory and exponents by pixels, triangles, lights, bounded media or texels of the map, of
    colonnade and one configuration of each method with shadows by default. Exit status 1 if a time jumps, or grows with
    a higher power of the work than in the baseline.

    --decompose prints by which causes each image is wrong: parts that add up to its error, differences of renders in
    which one cause after the other is gone.
    """
    from analytic.errors import InputError

    tables = {
        "--kernels": kernels,
        "--estimators": estimators,
        "--decompose": decompose,
        "--scaling": scaling is not None,
    }
    given = {
        "a scene": scenes,
        "--method": method,
        "--kernel": kernel,
        "--set": settings,
        "--size": size,
        "--meshes": meshes,
        "--ranges": ranges,
        "--method-limit": method_limit != USUAL_LIMIT,
        "--phase": phase,
        "--against": against,
        "--output": output,
        "--no-truth": not truth,
        "--margin": margin != _MARGIN,
        "--force": force,
        "--markdown": markdown,
    }
    _check_options(tables, given)
    if not 0 < margin < 1:
        raise InputError(f"--margin: got {margin:g}, wanted a share between 0 and 1, such as 0.002 for 0.2 %")
    if kernels:
        print_kernels(kernel, phase=phase, json=json, markdown=markdown)
        return
    scenes = drawn_from(scenes or [], meshes, ranges) or None
    if estimators:
        print_estimators(scenes, size=size, force=force, json=json)
        return
    from realtime.scene.read_scene import read_scene
    from reports.commands.own_methods import named_configurations
    from reports.machine.environment import activate
    from reports.machine.own_process import in_own_process
    from reports.machine.printing import print_notes
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import FOG_SCENES
    from validation.study.configuration import rendered_lights
    from validation.study.cost import check_work, frame_work, truth_work
    from validation.study.growth import METHODS

    chosen = named_configurations(
        method or [],
        kernel or [],
        settings or [],
        usual=None if scaling is None else METHODS,
        limit=method_limit,
    )
    apart = partial(in_own_process, limit=method_limit)
    pixels = parse_size(size) if size else None
    if scaling is not None:
        print_scaling(scenes, scaling, size=pixels, chosen=chosen, against=against, json=json, markdown=markdown)
        return
    activate()
    names = scenes or list(FOG_SCENES)
    works = []
    for name in names:  # refuses unusable input before an hour of work, not after
        scene = read_scene(load_scene(name, pixels).scene)
        print_notes(scene.features.notes)
        at = scene.camera.width, scene.camera.height
        works.append(truth_work(at, lights=len(scene.lights) + len(scene.area_lights)))
        works += [frame_work(at, lights=rendered_lights(scene, each), steps=steps(each)) for each in chosen]
    check_work("bench", works, force=force)
    if decompose:
        print_decomposition(names, pixels, chosen, apart=apart, output=output, json=json, markdown=markdown)
        return
    print_methods(names, pixels, chosen, margin=margin if truth else None, apart=apart, json=json, markdown=markdown)


def _check_options(tables: dict[str, bool], given: dict[str, Any]) -> None:
    """Refuse two tables at once, and options that the table does not take: nothing is dropped in silence."""
    from analytic.errors import InputError

    asked = [name for name, wanted in tables.items() if wanted]
    if len(asked) > 1:
        raise InputError(f"bench: got {' and '.join(asked)}, which print tables of their own; wanted one of them")
    name = asked[0] if asked else ""
    for option, value in given.items():
        if value and option not in _TAKES[name]:
            takers = " and ".join(f"bench {table}".strip() for table, takes in _TAKES.items() if option in takes)
            raise InputError(f"{f'bench {name}'.strip()}: got {option}, which is for {takers}; leave it out")
    if given["--no-truth"] and given["--margin"]:
        raise InputError("bench: got --no-truth and --margin, but the margin is that of the comparison; leave one out")
