# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench [SCENE...]`: its options, and which table they ask for."""

from functools import partial
from pathlib import Path
from typing import Annotated

import typer

from reports.bench.decompose import print_decomposition
from reports.bench.diagnosis import print_diagnoses
from reports.bench.estimators import print_estimators
from reports.bench.interpolation import print_interpolation
from reports.bench.kernels import print_gradients, print_kernels
from reports.bench.methods import print_methods, steps
from reports.bench.octaves import print_octave_fits
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
    OldMethods,
    Ranges,
    Scenes,
    Settings,
    Size,
    drawn_from,
    named,
)


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
    gradients: Annotated[
        bool,
        typer.Option("--gradients", help="With --kernels: what their derivatives cost, in place of time and error."),
    ] = False,
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
    diagnosis: Annotated[
        bool, typer.Option("--diagnosis", help="Plant faults in scenes and count how often a diagnosis names them.")
    ] = False,
    octaves: Annotated[
        bool,
        typer.Option("--fit-octaves", help="Find the constants of cloud-octaves that fit a scene of clouds best."),
    ] = False,
    stages: Annotated[
        bool,
        typer.Option("--stages", help="Time the stages of cloud-collectors, and count searches without end."),
    ] = False,
    scaling: Annotated[
        str | None,
        typer.Option(
            metavar="KINDS",
            help="Time methods as their work grows: some of size,triangles,lights,media,map.",
            show_default=False,
        ),
    ] = None,
    interpolation: Annotated[
        bool,
        typer.Option(
            "--interpolation", help="Count the rays of interpolated images, between tiles and along epipolar lines."
        ),
    ] = False,
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="With --scaling: what its --json printed before; the baseline of the scene by default. With "
            "--fit-octaves: the truth, an EXR with the layer airlight; that of cloud-paths by default.",
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
    ] = 0.01,
    method_limit: MethodLimit = USUAL_LIMIT,
    force: Force = False,
    json: Json = False,
    markdown: Markdown = False,
    methods: OldMethods = None,
) -> None:
    """Print tables of speed against error: methods, or kernels.

    Every method is timed in every scene and compared with the truth, or with --kernels every kernel on many rays.

    `airlight` is the airlight alone (the kernel with its ray set-up), `frame` a frame with static geometry and light,
    `light moved` a frame after the light moved. Exit status 1 if single-scatter does not confirm the truth within
    +-0.05 %, or volpath within +- the margin, or if a method of your own is at fault.

    --fit-octaves prints the extinction, contribution and anisotropy of cloud-octaves with the least relative RMSE of
    the airlight, beside those that halve everything; other parameters come by --set.

    --stages prints what light maps, order 1 and frames of cloud-collectors take, stratocumulus by default, and in how
    many pixels a search is far from its end; parameters come by --set.

    --scaling prints times, memory and exponents by pixels, triangles, lights, bounded media or texels of the map, of
    colonnade and one configuration of each method with shadows by default. Exit status 1 if a time jumps, or grows with
    a higher power of the work than in the baseline.

    --interpolation prints with how many rays an image of colonnade by shadow-planes, or of other scenes and methods, is
    within 0.1 % where its airlight is interpolated between tiles or along epipolar lines.

    --decompose prints by which causes each image is wrong: parts that add up to its error, differences of renders in
    which one cause after the other is gone.
    """
    from analytic.errors import InputError

    if not 0 < margin < 1:
        raise InputError(f"--margin: got {margin:g}, wanted a share between 0 and 1, such as 0.002 for 0.2 %")
    if output is not None and not decompose:
        raise InputError("--output: got a folder without --decompose, which alone writes images; add --decompose")
    scenes = drawn_from(scenes or [], meshes, ranges) or None
    named_kernels = named("--kernel", kernel, "--kernel", None)
    if against is not None and not octaves and scaling is None:
        raise InputError("--against: got a file without --scaling or --fit-octaves, which take one; add one of them")
    if octaves:
        print_octave_fits(scenes, size=size, against=against, settings=settings, json=json, markdown=markdown)
        return
    if stages:
        from reports.commands.bench_stages import bench_stages

        bench_stages(scenes, size=size, settings=settings, json=json, markdown=markdown)
        return
    if kernels:
        _refuse_scenes(scenes)
        if gradients:
            print_gradients(named_kernels or None, phase=phase, json=json, markdown=markdown)
        else:
            print_kernels(named_kernels or None, phase=phase, json=json, markdown=markdown)
        return
    if gradients:
        raise InputError("--gradients: they are those of kernels; add --kernels")
    if phase is not None:
        raise InputError("--phase: it is for kernels; add --kernels, a scene has its own phase function")
    if diagnosis:
        print_diagnoses(scenes, size=size, json=json, markdown=markdown)
        return
    if estimators:
        print_estimators(scenes, size=size, force=force, json=json)
        return
    from realtime.scene.read_scene import read_scene
    from reports.commands.own_methods import named_configurations
    from reports.machine.environment import activate
    from reports.machine.own_process import in_own_process
    from reports.machine.printing import print_notes
    from validation.configurations.methods import rendered_lights
    from validation.frames.expected_work import check_work, frame_work, truth_work
    from validation.scaling.study import METHODS
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import FOG_SCENES

    chosen = named_configurations(
        named("--method", method, "--methods", methods),
        named_kernels,
        settings or [],
        usual=METHODS[:1] if interpolation else None if scaling is None else METHODS,
        limit=method_limit,
    )
    apart = partial(in_own_process, limit=method_limit)
    pixels = parse_size(size) if size else None
    if scaling is not None:
        print_scaling(scenes, scaling, size=pixels, chosen=chosen, against=against, json=json, markdown=markdown)
        return
    if interpolation:
        print_interpolation(scenes, size=pixels, chosen=chosen, json=json, markdown=markdown)
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


def _refuse_scenes(scenes: list[str] | None) -> None:
    """Refuse scenes beside --kernels, which needs none; in version 0.1 the words there were kernels."""
    from analytic.errors import InputError

    if not scenes:
        return
    known = completion.kernel_names()
    meant = [word for word in scenes if word.rpartition("-")[0] in known or word in known or ":" in word]
    if meant:
        options = " ".join(f"--kernel {word}" for word in meant)
        raise InputError(f"bench --kernels: {meant[0]!r} is a kernel and stands where scenes stand: write {options}")
    raise InputError(
        f"bench --kernels: got the scene {scenes[0]!r}, but kernels are timed without a scene: leave it out"
    )
