# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench [SCENE...]`: speed against error."""

from typing import Annotated

import typer


def bench(
    scenes: Annotated[list[str] | None, typer.Argument(help="Scenes; all built-in ones by default.")] = None,
    methods: Annotated[str | None, typer.Option(help="Comma-separated methods; all by default.")] = None,
    size: Annotated[str | None, typer.Option(help="WIDTHxHEIGHT in pixels; the scene's own by default.")] = None,
    truth: Annotated[bool, typer.Option(help="Also compare the truth with volpath.")] = True,
    json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Time every method in every scene and compare it with the quadrature truth.

    `airlight` is the airlight alone (the kernel with its ray set-up), `frame` a frame with static geometry, `rebuilt` a
    frame after everything moved. Exit status 1 if volpath does not confirm the truth within +-0.5 %.
    """
    from realtime.methods import METHODS
    from realtime.scene import read_scene
    from reports.environment import activate
    from reports.progress import progress_bar
    from reports.tables import print_json
    from validation.configurations import chosen_configurations
    from validation.load import load_scene, parse_size
    from validation.scenes import SCENES

    names = methods.split(",") if methods else list(METHODS)
    chosen = chosen_configurations([name.strip() for name in names])
    pixels = parse_size(size) if size else None
    activate()
    names = scenes or list(SCENES)
    for name in names:  # refuse what cannot be used before an hour of work, not after
        read_scene(load_scene(name, pixels).scene)
    found = []
    with progress_bar("bench") as tell:
        for number, name in enumerate(names):

            def scene_progress(share: float, what: str, number: int = number) -> None:
                tell((number + share) / len(names), what)

            found.append(_bench_scene(name, pixels, chosen, with_truth=truth, tell=scene_progress))
    if json:
        from reports.environment import describe_environment

        print_json({"environment": describe_environment(), "scenes": found})
    else:
        _print(found)
    if any(not one["statistics"]["equivalent"] for scene in found for one in scene["agreement"].values()):
        raise typer.Exit(1)


def _bench_scene(name: str, pixels, chosen, *, with_truth: bool, tell) -> dict:
    from reports.data import agreement_data, measurement_data
    from validation.agreement import agreement
    from validation.bench import bench as run
    from validation.load import load_scene

    loaded = load_scene(name, pixels)
    share = 0.6 if with_truth else 1.0
    rows, camera = [], None
    tell(0.0, f"{loaded.name}: the truth")
    for scene, measured in run(loaded, chosen, progress=lambda done, total, what: tell(share * done / total, what)):
        rows.append(measurement_data(measured))
        camera = scene.camera
    agreed = {}
    if with_truth:
        small = load_scene(name, (160, 120)).scene
        compared = agreement(small, progress=lambda done, total, what: tell(share + (1 - share) * done / total, what))
        agreed = {layer: agreement_data(one) for layer, one in compared.items()}
    size = [camera.width, camera.height] if camera else None
    return {"name": loaded.name, "size": size, "methods": rows, "agreement": agreed}


def _print(found: list[dict]) -> None:
    from reports.tables import number, print_table

    headers = ("method", "frame ms", "quartiles", "frames/s", "airlight ms", "airlight/s", "rebuilt ms", "rel. RMSE",
               "rel. bias", "p99", "max")  # fmt: skip
    for scene in found:
        rows = []
        for one in scene["methods"]:
            if one["refused"]:
                print(f"{one['label']}: refused: {one['refused']}")
                continue
            frame, airlight = one["times"]["frame"], one["times"]["airlight"]["median_ms"]
            error = one["error"]
            rows.append(
                (
                    one["label"],
                    number(frame["median_ms"]),
                    f"{number(frame['low_ms'])}..{number(frame['high_ms'])}",
                    number(1000 / frame["median_ms"]),
                    number(airlight),
                    number(1000 / airlight),
                    number(one["times"]["rebuild"]["median_ms"]),
                    number(error["relative_rmse"], 2),
                    number(error["relative_bias"], 2),
                    number(error["p99"], 2),
                    number(error["max"], 2),
                )
            )
        print_table(headers, rows, title=f"{scene['name']}, {scene['size'][0]} x {scene['size'][1]}")
    rows = [_agreement_row(scene["name"], one) for scene in found for one in scene["agreement"].values()]
    if rows:
        headers = ("truth against volpath", "samples", "bias", "95 % interval", "detectable", "uncorrected", "agree")
        print_table(headers, rows, title="corrected for the shadow-ray epsilon; margin +-0.5 %")


def _agreement_row(name: str, one: dict) -> tuple[str, ...]:
    statistics = one["statistics"]
    low, high = statistics["relative_bias_ci"]
    samples = one["width"] * one["height"] * one["batches"] * one["samples"]
    return (
        f"{name}, {one['layer']}",
        f"{samples / 1e6:.0f} M",
        f"{100 * statistics['relative_bias']:+.3f} %",
        f"{100 * low:+.3f} .. {100 * high:+.3f} %",
        f"{100 * statistics['detectable_bias']:.2g} %",
        f"{100 * one['uncorrected_bias']:+.3f} %",
        "yes" if statistics["equivalent"] else "NO",
    )
