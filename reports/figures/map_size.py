# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the shadow map's size: the error of methods with a shadow map over its size, with the fitted slopes.

The lines are `validation.study.maps.fitted_slope`: error ~ size^-order; its docstring derives why the order is 1
or a little less.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import name_sizes, new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted, part_of
from reports.plotting.style import WIDTHS, method_style

NAME = "map-size"
SUMMARY = "error of the airlight against the size of the shadow map, with slopes"

#: The methods, with parameters for which only the map limits the accuracy.
METHODS: tuple[tuple[str, dict[str, Any]], ...] = (
    ("light-volumes", {}),
    ("min-max", {"sampling": "pixels", "slices": 4096}),
    ("ray-march", {"shadow": "map", "steps": 1600}),
)
SCENE = "sphere-spot"
SIZES = (32, 64, 128, 256, 512, 1024, 2048)
_HEADER = ("label", "method", "scene", "map", "relative_rmse", "relative_bias", "p99", "order", "order_se")


def compute(
    folder: Path | str,
    *,
    quick: bool = False,
    scene: str = SCENE,
    sizes: Sequence[int] | None = None,
    progress: Progress | None = None,
) -> None:
    """Write `map-size.csv` into a folder: the errors of each method for every size of the map, and its order.

    Parameters
    ----------
    quick
        A smaller image and fewer sizes.
    scene
        A built-in scene or the path of a Mitsuba XML file.
    sizes
        Of the shadow map [texels].
    """
    from validation.scenes.loading import load_scene
    from validation.study.maps import map_errors

    target = ensure_folder(folder)
    image = (96, 72) if quick else (160, 120)
    chosen = tuple(sizes or (SIZES[:5] if quick else SIZES))
    loaded = load_scene(scene, image)
    rows: list[tuple] = []
    for number, (method, parameters) in enumerate(METHODS):
        step = counted(part_of(progress, number / len(METHODS), (number + 1) / len(METHODS)))
        study = map_errors(loaded.scene, method, parameters=parameters, sizes=chosen, progress=step)
        order = (study.slope.order, study.slope.standard_error)
        name = study.configuration.label
        for size, error in zip(study.sizes, study.metrics):
            errors = (error.relative_rmse, error.relative_bias, error.p99)
            rows.append((name, method, loaded.name, size, *errors, *order))
    write_data(target, NAME, _HEADER, rows, scene=scene, image=image, sizes=chosen)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    figure = new_figure(width, 0.45 * width if column == "double" else 1.05 * width)
    panel = figure.subplots()
    for label in dict.fromkeys(row["label"] for row in rows):
        chosen = [row for row in rows if row["label"] == label]
        sizes, errors = np.array(values(chosen, "map")), np.array(values(chosen, "relative_rmse"))
        order, spread = (values(chosen, name)[0] for name in ("order", "order_se"))
        style = method_style(chosen[0]["method"])
        panel.plot(sizes, errors, linestyle="none", label=f"{label}: order {order:.2f} ± {spread:.2f}", **style)
        level = np.exp(np.mean(np.log(errors) + order * np.log(sizes)))
        panel.plot(sizes, level * sizes**-order, color=style["color"])
    panel.set(xscale="log", yscale="log", title=rows[0]["scene"])
    panel.set(xlabel="side of the shadow map [texels]", ylabel="relative RMSE of the airlight [1]")
    name_sizes(panel, values(rows, "map"))
    panel.legend(loc="best")
    return figure
