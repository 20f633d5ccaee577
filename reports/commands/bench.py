# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench [SCENE...]`: speed against error, and errors by their causes."""

import sys
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Any

import typer

from reports.commands import completion
from reports.commands.options import (
    USUAL_LIMIT,
    Force,
    Json,
    Markdown,
    MethodLimit,
    Methods,
    OldMethods,
    Scenes,
    Settings,
    Size,
    named,
)

_SMALL = "64x48"  # of images in which faults are planted: thousands of pixels are enough
_FIT_SIZE, _FIT_SAMPLES = (160, 120), 512  # of the truth of a fit that is not given
_BATCHES = 4096  # at most: a comparison ends earlier if its interval is narrow enough


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
    against: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="With --fit-octaves: the truth, an EXR with the layer airlight; that of cloud-paths by default.",
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

    --decompose prints by which causes each image is wrong: parts that add up to its error, differences of renders in
    which one cause after the other is gone.
    """
    from analytic.errors import InputError

    if not 0 < margin < 1:
        raise InputError(f"--margin: got {margin:g}, wanted a share between 0 and 1, such as 0.002 for 0.2 %")
    if output is not None and not decompose:
        raise InputError("--output: got a folder without --decompose, which alone writes images; add --decompose")
    named_kernels = named("--kernel", kernel, "--kernel", None)
    if against is not None and not octaves:
        raise InputError("--against: got an image without --fit-octaves, which alone takes one; add --fit-octaves")
    if octaves:
        _fit_octaves(scenes, size=size, against=against, settings=settings, json=json, markdown=markdown)
        return
    if stages:
        from reports.commands.bench_stages import bench_stages

        bench_stages(scenes, size=size, settings=settings, json=json, markdown=markdown)
        return
    if kernels:
        _refuse_scenes(scenes)
        if gradients:
            _bench_gradients(named_kernels or None, phase=phase, json=json, markdown=markdown)
        else:
            _bench_kernels(named_kernels or None, phase=phase, json=json, markdown=markdown)
        return
    if gradients:
        raise InputError("--gradients: they are those of kernels; add --kernels")
    if phase is not None:
        raise InputError("--phase: it is for kernels; add --kernels, a scene has its own phase function")
    if diagnosis:
        _bench_diagnosis(scenes, size=size, json=json, markdown=markdown)
        return
    if estimators:
        _bench_estimators(scenes, size=size, force=force, json=json)
        return
    from realtime.scene.read_scene import read_scene
    from reports.commands.own_methods import named_configurations
    from reports.commands.printing import print_notes
    from reports.data.own_faults import own_faults
    from reports.machine.environment import activate
    from reports.machine.own_process import in_own_process
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.terminal import print_json
    from validation.configurations.methods import rendered_lights
    from validation.frames.expected_work import check_work, frame_work, truth_work
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import FOG_SCENES

    chosen = named_configurations(
        named("--method", method, "--methods", methods), named_kernels, settings or [], limit=method_limit
    )
    apart = partial(in_own_process, limit=method_limit)
    pixels = parse_size(size) if size else None
    activate()
    names = scenes or list(FOG_SCENES)
    works = []
    for name in names:  # refuses unusable input before an hour of work, not after
        scene = read_scene(load_scene(name, pixels).scene)
        print_notes(scene.features.notes)
        at = scene.camera.width, scene.camera.height
        works.append(truth_work(at, lights=len(scene.lights) + len(scene.area_lights)))
        works += [frame_work(at, lights=rendered_lights(scene, each), steps=_steps(each)) for each in chosen]
    check_work("bench", works, force=force)
    if decompose:
        _decompose(names, pixels, chosen, apart=apart, output=output, json=json, markdown=markdown)
        return
    benched = []
    with progress_bar("bench") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            asked = margin if truth else None
            benched.append(_bench_scene(name, pixels, chosen, margin=asked, apart=apart, progress=step))
    if json:
        from reports.machine.environment import describe_environment

        print_json({"environment": describe_environment(), "scenes": benched})
    else:
        _print_bench(benched, markdown=markdown)
    faults = own_faults({"scenes": benched})
    for fault in faults:
        print(f"airlight: error: {fault}", file=sys.stderr)
    agreed = [agreement["statistics"] for scene in benched for agreement in scene["agreement"].values()]
    if faults or not all(statistics["equivalent"] for statistics in agreed):
        raise typer.Exit(1)


def _decompose(names, pixels, chosen, *, apart, output: Path | None, json: bool, markdown: bool) -> None:
    """Print the errors of configurations by cause, and write their images."""
    import reports.figures.decomposition as figure
    from reference.storage.files import ensure_folder
    from reports.commands.printing import print_heading, print_tables
    from reports.figures.files import plot
    from reports.machine.environment import describe_environment
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.decomposition import decomposition_table
    from reports.tables.terminal import print_json

    folder = None if output is None else ensure_folder(output)
    scenes = []
    with progress_bar("bench --decompose") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            scene, decomposed = _decomposed_scene(name, pixels, chosen, apart=apart, progress=step)
            scenes.append(scene)
            if folder is not None and decomposed:
                place = ensure_folder(folder / scene["name"])
                figure.write_parts(place, scene["name"], decomposed)
                plot(figure, place)
    if json:
        print_json({"environment": describe_environment(), "scenes": scenes})
        return
    if markdown:
        print_heading()
    titles = [
        "{}, {} x {}: the error of the airlight by cause".format(scene["name"], *scene["size"]) for scene in scenes
    ]
    tables = [decomposition_table(title, scene["methods"]) for title, scene in zip(titles, scenes, strict=True)]
    print_tables(tables, as_markdown=markdown)


def _decomposed_scene(name: str, pixels, chosen, *, apart, progress) -> tuple[dict[str, Any], list[Any]]:
    """Return the errors of a scene by cause, JSON-ready and with their images."""
    from realtime.errors import InputError
    from realtime.scene.read_scene import read_scene
    from validation.estimates.quadrature import truth_image
    from validation.frames.benchmark import configurations_for, render_by_name
    from validation.frames.decomposition import decompose, exact_sum, part_numbers
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene

    loaded = load_scene(name, pixels)
    scene = read_scene(loaded.scene)
    size = scene.camera.width, scene.camera.height
    progress(0.0, f"{loaded.name}: the truth")
    truth = truth_image(loaded.scene).airlight
    exact = cache(partial(exact_sum, scene))
    entries, decomposed = [], []
    configurations = configurations_for(scene.features, chosen)
    for number, each in enumerate(configurations):
        progress((1 + number) / (1 + len(configurations)), f"{loaded.name}: {each.label}")

        def own(configuration, each=each):
            path = str(loaded.path or loaded.name)
            return apart(render_by_name, path, size, configuration, name=each.method).airlight

        entry = {
            "label": each.label,
            "method": each.method,
            "kernel": each.kernel,
            "parameters": dict(each.parameters),
        }
        try:
            split = decompose(scene, each, truth, render=own, exact=exact)
        except InputError as error:
            entries.append(entry | {"refused": str(error)})
            continue
        decomposed.append(split)
        parts = [plain(part_numbers(part)) for part in (split.whole, *split.parts)]
        entries.append(entry | {"refused": None, "whole": parts[0], "parts": parts[1:]})
    return {"name": loaded.name, "size": list(size), "methods": entries}, decomposed


def _steps(chosen) -> float:
    """Return how many steps a configuration marches."""
    from validation.frames.expected_work import steps_of

    return steps_of(chosen.parameters) if chosen.method == "ray-march" else 0


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


def _bench_scene(name: str, pixels, chosen, *, margin: float | None, apart, progress) -> dict:
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
    for scene, measured in run(loaded, chosen, apart=apart, progress=counted(part_of(progress, 0.0, share))):
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


def _bench_kernels(names: list[str] | None, *, phase: str | None, json: bool, markdown: bool) -> None:
    from analytic.phase import phase_from_words
    from realtime.kernels.registry import KERNELS
    from reports.commands.printing import print_heading, print_tables
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import counted, progress_bar
    from reports.tables.kernels import convergence_data, kernel_tables, order_table
    from reports.tables.terminal import print_json
    from validation.configurations.kernel_names import split_name
    from validation.kernels.benchmark import PHASES, bench_kernels
    from validation.kernels.convergence import convergence, declared
    from validation.metrics.errors import plain

    wanted = [split_name(name)[0].name for name in names] if names else list(KERNELS)
    phases = PHASES if phase is None else ((phase, phase_from_words(phase).g),)
    activate()
    with progress_bar("bench") as progress:
        costs = bench_kernels(names, phases=phases, progress=counted(progress))
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


def _bench_gradients(names: list[str] | None, *, phase: str | None, json: bool, markdown: bool) -> None:
    """Print what derivatives of kernels cost beside their values."""
    from analytic.phase import phase_from_words
    from realtime.kernels.registry import KERNELS
    from reports.commands.printing import print_heading, print_tables
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import counted, progress_bar
    from reports.tables.kernels import gradient_table
    from reports.tables.terminal import print_json
    from validation.kernels.gradient_cost import PHASES, gradient_costs
    from validation.metrics.errors import plain

    phases = PHASES if phase is None else ((phase, phase_from_words(phase).g),)
    activate()
    with progress_bar("bench --gradients") as progress:
        costs = plain(gradient_costs(names or list(KERNELS), phases, progress=counted(progress)))
    if json:
        print_json({"environment": describe_environment(), "gradients": costs})
        return
    if markdown:
        print_heading()
    print_tables([gradient_table(costs)], as_markdown=markdown)
    print(
        "ns/ray, medians of the kernels alone by Dr.Jit's history; all: by foot, height, both distances, sigma_t and g."
    )


def _bench_diagnosis(scenes: list[str] | None, *, size: str | None, json: bool, markdown: bool) -> None:
    """Print which planted faults a diagnosis names; exit status 1 if it names a fault of a right image."""
    from reports.commands.printing import print_heading, print_tables
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.diagnosis import answers_sentence, answers_table
    from reports.tables.terminal import print_json
    from validation.scenes.loading import parse_size
    from validation.scenes.registry import SCENES

    pixels = parse_size(size or _SMALL)
    activate()
    from validation.diagnosis.planted import planted_answers

    with progress_bar("bench --diagnosis") as progress:
        rows = planted_answers(scenes or list(SCENES), pixels, progress=progress)
    if json:
        print_json({"environment": describe_environment(), "size": list(pixels), "diagnosis": rows})
    else:
        if markdown:
            print_heading()
        print_tables([answers_table(rows)], as_markdown=markdown)
        print(f"\n{answers_sentence(rows)}")
    if any(row["planted"] == "right" and not row["right"] for row in rows):
        raise typer.Exit(1)


def _bench_estimators(scenes: list[str] | None, *, size: str | None, force: bool, json: bool) -> None:
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import progress_bar
    from reports.tables.terminal import print_json
    from validation.estimates.efficiency import efficiency_lines, scene_efficiency, thin_fog
    from validation.frames.expected_work import check_work, sampled_work
    from validation.scenes.loading import load_scene, parse_size
    from validation.scenes.registry import FOG_SCENES

    pixels = parse_size(size) if size else (160, 120)
    activate()
    names = list(scenes or FOG_SCENES)
    loaded = {name: load_scene(name, pixels).scene for name in names}  # refuses unusable input before any work
    if not scenes:
        loaded = {"open-fog, optical depth 0.2": thin_fog(pixels)} | loaded
    check_work("bench --estimators", [sampled_work(pixels, 1024) for _ in loaded], force=force)
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


def _fit_octaves(
    scenes: list[str] | None, *, size: str | None, against: Path | None, settings, json: bool, markdown: bool
) -> None:
    """Print the constants of octaves that fit scenes of clouds best."""
    from analytic.errors import InputError
    from reference.storage.exr import read_exr
    from reports.commands.printing import print_heading, print_tables
    from reports.machine.environment import activate, describe_environment
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.octave_fit import octave_table
    from reports.tables.terminal import print_json
    from validation.configurations.methods import configuration, parse_settings
    from validation.metrics.errors import plain
    from validation.scenes.loading import parse_size
    from validation.scenes.registry import SCENES

    names = scenes or [name for name, record in SCENES.items() if record.clouds]
    if against is not None and len(names) != 1:
        raise InputError(f"--against: got one image for {len(names)} scenes; name its scene")
    if against is not None:
        read_exr(against)  # unreadable files are refused before Mitsuba starts
    parameters = dict(configuration("cloud-octaves", None, parse_settings(settings or [])).parameters)
    pixels = parse_size(size) if size else None
    activate()
    fits = []
    with progress_bar("bench --fit-octaves") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            fits.append(_octave_fit(name, pixels, against, parameters, step))
    if json:
        print_json({"environment": describe_environment(), "fits": plain(fits)})
        return
    if markdown:
        print_heading()
    print_tables([octave_table(plain(fits))], as_markdown=markdown)
    for fit in fits:
        best = " ".join(f"--set {key}={fit['fitted'][key]:.3g}" for key in ("extinction", "contribution", "anisotropy"))
        print(f"{fit['scene']}: airlight render {fit['scene']} --method cloud-octaves {best}")


def _octave_fit(name: str, pixels, against: Path | None, parameters: dict[str, Any], progress) -> dict[str, Any]:
    """Return the fit of one scene, at the size of the truth that is given."""
    from dataclasses import asdict

    from realtime.scene.read_scene import read_scene
    from reference.storage.exr import layer, read_exr
    from reports.commands.printing import print_notes
    from reports.machine.progress import counted, part_of
    from validation.estimates.budget import Budget
    from validation.estimates.images import cloud_orders, monte_carlo_reference
    from validation.frames.octave_fit import fit_octaves
    from validation.scenes.loading import load_scene

    if against is None:
        loaded = load_scene(name, pixels or _FIT_SIZE)
        part = part_of(progress, 0.0, 0.8)
        budget, orders = Budget(samples=_FIT_SAMPLES), cloud_orders("sets")
        image = monte_carlo_reference(loaded, "cloud-paths", budget=budget, orders=orders, progress=part).image
    else:
        image = read_exr(against)
        height, width = layer(image, "airlight", str(against)).shape[:2]
        loaded = load_scene(name, pixels or (width, height))
    scene = read_scene(loaded.scene)
    print_notes(scene.features.notes)
    truth = layer(image, "airlight", str(against or name))
    part = part_of(progress, 0.8 if against is None else 0.0, 1.0)
    error = image.layers.get("airlight_se")
    fit = fit_octaves(scene, truth, standard_error=error, parameters=parameters, progress=counted(part))
    size = [scene.camera.width, scene.camera.height]
    return {"scene": loaded.name, "size": size, "truth": str(against or "cloud-paths")} | asdict(fit)
