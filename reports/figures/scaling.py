# SPDX-License-Identifier: BSD-3-Clause
"""The figure of scaling: the time of a frame over its work, by kind of work, with the fitted exponents and the floor.

The lines are those of `validation.study.growth`: time ~ work^exponent.
"""

from collections.abc import Sequence
from pathlib import Path

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted, part_of
from reports.plotting.style import WIDTHS, method_style
from reports.tables.scaling import TIMES, WORK

NAME = "scaling"
SUMMARY = "time of a frame against pixels, triangles, lights and texels, with exponents"

SCENE = "colonnade"
KINDS = ("size", "triangles", "lights", "map")
_HEADER = ("label", "method", "scene", "kind", "work", *TIMES, "rays", "memory", "exponent", "exponent_se")


def compute(
    folder: Path | str,
    *,
    quick: bool = False,
    scene: str = SCENE,
    kinds: Sequence[str] | None = None,
    size: tuple[int, int] | None = None,
    progress: Progress | None = None,
) -> None:
    """Write `scaling.csv` into a folder: the times of each method by the work of each kind, and its exponent.

    Parameters
    ----------
    quick
        A smaller image, and pixels and lights alone.
    scene
        A built-in scene or the path of a Mitsuba XML file.
    kinds
        Of `validation.study.ladders.KINDS`.
    size
        Of the image [pixels].
    """
    from validation.study.growth import METHODS, study_scaling
    from validation.study.ladders import ladder

    target = ensure_folder(folder)
    image = size or ((160, 120) if quick else (800, 600))
    chosen = tuple(kinds or (("size", "lights") if quick else KINDS))
    rows: list[tuple] = []
    for number, kind in enumerate(chosen):
        step = counted(part_of(progress, number / len(chosen), (number + 1) / len(chosen)))
        for found in study_scaling(kind, ladder(kind, scene, image), METHODS, progress=step):
            fit = found.growth["frame"]
            for cost in found.costs:
                times = (getattr(cost, name).median_ms for name in (*TIMES, "rays"))
                what = (found.configuration.label, found.configuration.method, Path(scene).stem, kind, cost.work)
                rows.append((*what, *times, cost.memory, fit.exponent, fit.standard_error))
    write_data(target, NAME, _HEADER, rows, scene=scene, image=image, kinds=chosen)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    rows = read_data(folder, NAME)
    kinds = list(dict.fromkeys(row["kind"] for row in rows))
    width = WIDTHS[column]
    across = min(len(kinds), 2 if column == "double" else 1)
    down = -(-len(kinds) // across)
    figure = new_figure(width, (0.42 if column == "double" else 0.9) * width * down)
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel, kind in zip(panels, kinds):
        own = [row for row in rows if row["kind"] == kind]
        for label in dict.fromkeys(row["label"] for row in own):
            chosen = [row for row in own if row["label"] == label]
            exponent = values(chosen, "exponent")[0]
            style = method_style(chosen[0]["method"])
            panel.plot(values(chosen, "work"), values(chosen, "frame"), label=f"{label}: power {exponent:.2f}", **style)
        panel.plot(values(chosen, "work"), values(chosen, "rays"), color="0.6", linestyle=":", label="camera rays")
        panel.set(xscale="log", yscale="log", xlabel=f"{WORK[kind]} [1]", ylabel="time of a frame [ms]")
        panel.legend(loc="best")
    for panel in panels[len(kinds) :]:
        panel.remove()
    figure.suptitle(rows[0]["scene"])
    return figure
