# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench [SCENE...]`: speed against error."""

from typing import Annotated

import typer

_BATCHES = 4096  # at most: a comparison ends earlier if its interval is narrow enough


def bench(
    scenes: Annotated[
        list[str] | None, typer.Argument(help="Scenes, or with --kernels kernels; all built-in ones by default.")
    ] = None,
    kernels: Annotated[bool, typer.Option("--kernels", help="Time the kernels alone, on 480 000 rays.")] = False,
    estimators: Annotated[
        bool, typer.Option("--estimators", help="Time single-scatter and volpath at equal error.")
    ] = False,
    methods: Annotated[
        str | None, typer.Option(help="Comma-separated methods, also your own MODULE:FUNCTION; all by default.")
    ] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the scene's own by default.")] = None,
    truth: Annotated[bool, typer.Option(help="Also compare the truth with single-scatter and volpath.")] = True,
    margin: Annotated[
        float, typer.Option(help="Relative bias of volpath that counts as agreement; the time grows like 1/margin^2.")
    ] = 0.01,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
    markdown: Annotated[bool, typer.Option("--markdown", help="Print tables for a README, dated.")] = False,
) -> None:
    """Time every method in every scene, or every kernel on many rays, and compare it with the truth.

    `airlight` is the airlight alone (the kernel with its ray set-up), `frame` a frame with static geometry and light,
    `light moved` a frame after the light moved. Exit status 1 if single-scatter does not confirm the truth within
    +-0.05 %, or volpath within +- the margin.
    """
    if not 0 < margin < 1:
        from analytic.errors import InputError

        raise InputError(f"--margin: got {margin:g}, wanted a share between 0 and 1, such as 0.002 for 0.2 %")
    if kernels:
        _bench_kernels(scenes, json=json, markdown=markdown)
        return
    if estimators:
        _bench_estimators(scenes, size=size, json=json)
        return
    from realtime.methods.registry import METHODS
    from realtime.scene.read_scene import read_scene
    from reports.commands.printing import print_notes
    from reports.machine.environment import activate
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.terminal import print_json
    from validation.configurations.methods import chosen_configurations
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import SCENES

    names = methods.split(",") if methods else list(METHODS)
    if any(":" in name for name in names):
        activate()  # a user's module may create arrays when it is imported
    chosen = chosen_configurations([name.strip() for name in names])
    pixels = parse_size(size) if size else None
    activate()
    names = scenes or list(SCENES)
    for name in names:  # refuses unusable input before an hour of work, not after
        print_notes(read_scene(load_scene(name, pixels).scene).features.notes)
    benched = []
    with progress_bar("bench") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            benched.append(_bench_scene(name, pixels, chosen, margin=margin if truth else None, progress=step))
    if json:
        from reports.machine.environment import describe_environment

        print_json({"environment": describe_environment(), "scenes": benched})
    else:
        _print_bench(benched, markdown=markdown)
    if any(not agreement["statistics"]["equivalent"] for scene in benched for agreement in scene["agreement"].values()):
        raise typer.Exit(1)


def _print_bench(scenes: list[dict], *, markdown: bool) -> None:
    """Print a table for each scene, and one for the truth."""
    from reports.commands.printing import print_heading, print_tables
    from reports.tables.agreement import agreement_table
    from reports.tables.methods import methods_table

    tables = [methods_table("{}, {} x {}".format(scene["name"], *scene["size"]), scene["methods"]) for scene in scenes]
    compared = [(f"{scene['name']}, {each['layer']}", each) for scene in scenes for each in scene["agreement"].values()]
    if compared:
        title = "Monte Carlo against the quadrature truth; volpath corrected for its shadow-ray epsilon"
        tables.append(agreement_table(title, compared))
    if markdown:
        print_heading()
    print_tables(tables, as_markdown=markdown)


def _bench_scene(name: str, pixels, chosen, *, margin: float | None, progress) -> dict:
    from reports.data.serialize import measurement_data
    from reports.machine.progress import counted, part_of
    from validation.estimates.agreement import agreements
    from validation.frames.benchmark import bench as run
    from validation.frames.scene_study import EFFORTS
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene

    loaded = load_scene(name, pixels)
    share = 1.0 if margin is None else 0.6
    rows, camera = [], None
    progress(0.0, f"{loaded.name}: the truth")
    for scene, measured in run(loaded, chosen, progress=counted(part_of(progress, 0.0, share))):
        rows.append(measurement_data(measured))
        camera = scene.camera
    agreed = {}
    if margin is not None:
        margins = {**EFFORTS["default"].margins, "volpath": margin}
        agreed = plain(
            agreements(
                load_scene(name, (160, 120)).scene,
                margins,
                batches=_BATCHES,
                progress=part_of(progress, share, 1.0),
            )
        )
    size = [camera.width, camera.height] if camera else None
    return {"name": loaded.name, "size": size, "methods": rows, "agreement": agreed}


def _bench_kernels(names: list[str] | None, *, json: bool, markdown: bool) -> None:
    from realtime.kernels.registry import KERNELS
    from reports.commands.printing import print_heading, print_tables
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import counted, progress_bar
    from reports.tables.kernels import convergence_data, kernel_tables, order_table
    from reports.tables.terminal import print_json
    from validation.configurations.kernel_names import split_name
    from validation.kernels.benchmark import bench_kernels
    from validation.kernels.convergence import convergence, declared
    from validation.metrics.errors import plain

    wanted = [split_name(name)[0].name for name in names] if names else list(KERNELS)
    activate()
    with progress_bar("bench") as progress:
        costs = bench_kernels(names, progress=counted(progress))
        rates = [convergence(name) for name in declared() if name in wanted]
    measured, orders = plain(costs), [convergence_data(rate) for rate in rates]
    if json:
        print_json({"environment": describe_environment(), "kernels": measured, "convergence": orders})
        return
    if markdown:
        print_heading()
    print_tables(kernel_tables(measured["costs"], measured["levels"]), as_markdown=markdown)
    print("ns/ray: the kernel alone by Dr.Jit's history, median; ~ is extrapolated from fewer steps.")
    if orders:
        print_tables([order_table(orders)], as_markdown=markdown)


def _bench_estimators(scenes: list[str] | None, *, size: str | None, json: bool) -> None:
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json
    from validation.estimates.efficiency import efficiency_lines, scene_efficiency, thin_fog
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import SCENES

    pixels = parse_size(size) if size else (160, 120)
    activate()
    names = list(scenes or SCENES)
    loaded = {name: load_scene(name, pixels).scene for name in names}  # refuses unusable input before any work
    if not scenes:
        loaded = {"open-fog, optical depth 0.2": thin_fog(pixels)} | loaded
    efficiencies = {}
    with progress_bar("bench") as progress:
        for number, (name, scene) in enumerate(loaded.items()):
            progress(number / len(loaded), name)
            efficiencies[name] = scene_efficiency(scene)
    if json:
        from validation.metrics.errors import plain

        print_json({"environment": describe_environment(), "estimators": plain(efficiencies)})
        return
    for name, efficiency in efficiencies.items():
        print(f"{name}, {pixels[0]} x {pixels[1]}")
        print("\n".join(f"  {line}" for line in efficiency_lines(efficiency)))
