# SPDX-License-Identifier: BSD-3-Clause
"""`airlight bench --decompose`: the error of every method by its causes."""

from functools import cache, partial
from pathlib import Path
from typing import Any


def print_decomposition(names, pixels, chosen, *, apart, output: Path | None, json: bool, markdown: bool) -> None:
    """Print the errors of configurations by cause, and write their images."""
    import reports.figures.decomposition as figure
    from reference.storage.files import ensure_folder
    from reports.figures.files import plot
    from reports.machine.environment import describe_environment
    from reports.machine.printing import print_heading, print_tables
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
    from validation.metrics.errors import plain
    from validation.scenes.loading import load_scene
    from validation.study.decompose import decompose, exact_sum, part_numbers
    from validation.study.run import frame_of
    from validation.study.scene import configurations_for
    from validation.study.study import Cell

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
            cell = Cell(str(loaded.path or loaded.name), size, (), configuration)
            return apart(frame_of, cell, name=each.method).airlight

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
