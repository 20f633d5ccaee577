# SPDX-License-Identifier: BSD-3-Clause
"""The figure of errors by cause: the image of each method, its error, and the parts that add up to it.

All error maps have the scale of the report's page (`reports.plotting.pictures`). `airlight bench --decompose -o FOLDER`
writes the same figure of the scenes and methods that it is asked for.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, value, write_data
from reports.machine.progress import Progress, counted
from reports.plotting.style import WIDTHS

if TYPE_CHECKING:
    from validation.study.decompose import Decomposition

NAME = "decomposition"
SUMMARY = "images of methods with their error and its parts by cause, which add up to it"

SCENE = "colonnade"
#: The methods and their parameters.
METHODS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("ray-march", {"steps": 16, "shadow": "map"}),
    ("min-max", {}),
    ("froxel-fog", {}),
)
_HEADER = ("file", "label", "scene", "exposure", "layer", "cause", "relative_rmse", "share")


def compute(folder: Path | str, *, quick: bool = False, scene: str = SCENE, progress: Progress | None = None) -> None:
    """Write `decomposition.csv` and an EXR file for each method into a folder.

    Parameters
    ----------
    quick
        A smaller image.
    scene
        A built-in scene or the path of a Mitsuba XML file.
    """
    from realtime.scene.read_scene import read_scene
    from validation.estimates.quadrature import truth_image
    from validation.scenes.loading import load_scene
    from validation.study.configuration import configuration
    from validation.study.decompose import decompose

    loaded = load_scene(scene, (96, 72) if quick else (240, 180))
    read, truth = read_scene(loaded.scene), truth_image(loaded.scene).airlight
    decomposed = []
    for number, (method, parameters) in enumerate(METHODS):
        decomposed.append(decompose(read, configuration(method, parameters=parameters), truth))
        if progress is not None:
            counted(progress)(number + 1, len(METHODS), method)
    write_parts(ensure_folder(folder), loaded.name, decomposed)


def write_parts(folder: Path, scene: str, decomposed: Sequence["Decomposition"]) -> None:
    """Write the data of the figure: truth, image, error and parts of each as layers of an EXR file, and their list.

    Parameters
    ----------
    folder
        Where they go; it exists.
    scene
        Its name.
    decomposed
        The errors of its methods.
    """
    from reference.storage.exr import Image, write_exr
    from reports.plotting.pictures import exposure

    rows: list[tuple] = []
    for number, each in enumerate(decomposed):
        name, label = f"{NAME}-{number}.exr", each.configuration.label
        parts = (each.whole, *each.parts)
        layers = {"truth": each.truth, "image": each.image} | {_layer(part.cause): part.image for part in parts}
        write_exr(folder / name, Image(layers, attributes={"airlight:method": label}))
        shared = (name, label, scene, exposure(each.truth))
        rows += [(*shared, _layer(part.cause), part.cause, part.relative_rmse, part.share) for part in parts]
    write_data(folder, NAME, _HEADER, rows, scene=scene)


def _layer(cause: str) -> str:
    return "error-" + cause.replace(" ", "-")


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    from reference.storage.exr import read_exr
    from reports.plotting.pictures import error_map, tone_mapped

    rows = read_data(folder, NAME)
    files = list(dict.fromkeys(row["file"] for row in rows))
    parts = {file: [row for row in rows if row["file"] == file] for file in files}
    across = 2 + max(map(len, parts.values()))
    wide, size = WIDTHS[column], 6 if column == "double" else 4.5
    images = {file: read_exr(folder / file).layers for file in files}
    height, width = images[files[0]]["truth"].shape[:2]
    figure = new_figure(wide, len(files) * (wide / across * height / width + 0.36))
    panels = figure.subplots(len(files), across, squeeze=False)
    for file, line in zip(files, panels):
        layers = {name: np.asarray(layer, dtype=np.float64) for name, layer in images[file].items()}
        truth, factor = layers["truth"], value(parts[file][0], "exposure") or 1.0
        shown = [("truth", tone_mapped(truth, factor))]
        shown.append((parts[file][0]["label"].replace(" (", "\n("), tone_mapped(layers["image"], factor)))
        for row in parts[file]:
            share = value(row, "share")
            words = "" if share is None or row["cause"] == "whole" else f", {100 * share:.0f} %"
            title = f"{row['cause']}\n{value(row, 'relative_rmse') or 0:.1e}{words}"
            shown.append((title, error_map(truth, truth + layers[row["layer"]])))
        for panel in line:
            panel.set_axis_off()
        for panel, (title, picture) in zip(line, shown):
            panel.imshow(picture, interpolation="nearest")
            panel.set_title(title, fontsize=size, parse_math=False)
    return figure
