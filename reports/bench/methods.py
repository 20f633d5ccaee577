# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench`: methods timed in scenes and compared with the truth."""

import sys

import typer

_BATCHES = 4096  # at most: a comparison ends earlier if its interval is narrow enough


def print_methods(names, pixels, chosen, *, margin: float | None, apart, json: bool, markdown: bool) -> None:
    """Print speed and error of configurations in scenes; exit status 1 if the truth is not confirmed."""
    from reports.data.own_faults import own_faults
    from reports.machine.environment import describe_environment
    from reports.machine.progress import part_of, progress_bar
    from reports.tables.terminal import print_json

    benched = []
    with progress_bar("bench") as progress:
        for number, name in enumerate(names):
            step = part_of(progress, number / len(names), (number + 1) / len(names))
            benched.append(_bench_scene(name, pixels, chosen, margin=margin, apart=apart, progress=step))
    if json:
        print_json({"environment": describe_environment(), "scenes": benched})
    else:
        _print_tables(benched, markdown=markdown)
    faults = own_faults({"scenes": benched})
    for fault in faults:
        print(f"airlight: error: {fault}", file=sys.stderr)
    agreed = [agreement["statistics"] for scene in benched for agreement in scene["agreement"].values()]
    if faults or not all(statistics["equivalent"] for statistics in agreed):
        raise typer.Exit(1)


def _bench_scene(name: str, pixels, chosen, *, margin: float | None, apart, progress) -> dict:
    from realtime.scene.read_scene import read_scene
    from reports.machine.progress import part_of
    from reports.report.scene import row_entry
    from validation.estimates.agreement import agreements
    from validation.estimates.quadrature import truth_image
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene
    from validation.study.reference import of_image
    from validation.study.run import run
    from validation.study.scene import configurations_for
    from validation.study.study import Cell, Measure, standard_study

    loaded = load_scene(name, pixels)
    share = 1.0 if margin is None else 0.6
    progress(0.0, f"{loaded.name}: the reference")
    scene, reference = read_scene(loaded.scene), of_image(truth_image(loaded.scene))
    size, useful, rows = (scene.camera.width, scene.camera.height), configurations_for(scene.features, chosen), []
    for number, each in enumerate(useful):
        progress(share * number / len(useful), f"{loaded.name}: {each.label}")
        cell = Cell(str(loaded.path or loaded.name), size, (), each, Measure("stages", every_metric=False))
        rows.append(row_entry(plain(run(cell, scene, reference, apart=apart)[0])))
    agreed = {}
    if margin is not None:
        agreed = plain(
            agreements(
                load_scene(name, (160, 120)).scene,
                {**standard_study("default").checks.margins, "volpath": margin},
                batches=_BATCHES,
                progress=part_of(progress, share, 1.0),
            )
        )
    return {"name": loaded.name, "size": list(size), "methods": rows, "agreement": agreed}


def _print_tables(scenes: list[dict], *, markdown: bool) -> None:
    """Print a table for each scene, and one for the truth."""
    from reports.machine.printing import print_heading, print_tables
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


def steps(chosen) -> float:
    """Return how many steps a configuration marches."""
    from validation.study.cost import steps_of

    return steps_of(chosen.parameters) if chosen.method == "ray-march" else 0
