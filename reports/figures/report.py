# SPDX-License-Identifier: BSD-3-Clause
"""Figures of a report for papers: time against error, images with insets and error maps,
a LaTeX table of methods.

They are drawn from report.json and the EXR files beside it, without Mitsuba.
"""

import math
import textwrap
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from airlight.errors import InputError, nearest
from airlight.reference.storage.exr import layer as image_layer
from airlight.reference.storage.exr import read_exr
from airlight.reference.storage.files import write_text
from airlight.reports.data.records import Method, Report, Scene, load_report
from airlight.reports.plotting.figure import (
    ENDINGS,
    has_point,
    new_figure,
    save_figure,
    show_picture,
    speed_chart,
)
from airlight.reports.plotting.pictures import (
    ERROR_CEILING,
    ERROR_FLOOR,
    error_map,
    error_scale,
    exposure,
    tone_mapped,
)
from airlight.reports.plotting.style import COLOURS, WIDTHS
from airlight.reports.tables.drawing import latex
from airlight.reports.tables.methods import method_row, methods_table
from airlight.reports.tables.table import Row, number
from airlight.validation.study.row import Row as CellRow

_TIMES = ("frame", "light_moved", "objects_moved")
_ERRORS = ("relative_rmse", "relative_bias", "p99")
_FRAMES = (COLOURS["orange"], COLOURS["sky"])


def write_figures(
    folder: Path, column: str, *, scene: str | None = None, labels: Sequence[str] | None = None
) -> tuple[str, ...]:
    """Write the figures of a report into its folder, for a 'single' or 'double' column;
    return the names of the files.

    The strip shows `scene` and `labels`: by default the first scene with shadows and the most
    accurate of each method.
    """
    report, place = load_report(folder)
    drawn: dict[str, Callable[[str], Any]] = {}
    # A report of --quick may have no times, a report of refusals no images: only figures with
    # something to show are drawn.
    if any(has_point(entry) for each in report.scenes for entry in each.methods):
        drawn["frame-speed"] = partial(draw_speed, report.scenes)
    if (
        scene
        or labels
        or any(_shown(each, name) for each in report.scenes for name in ("airlight", "total"))
    ):
        drawn["strip"] = partial(draw_strip, *_strip(report, place, scene, labels))
    paths = [
        save_figure(folder / f"{name}{end}", draw, column)
        for name, draw in drawn.items()
        for end in ENDINGS
    ]
    write_text(folder / "methods-table.tex", latex_table(report.scenes))
    return tuple(str(path) for path in (*paths, folder / "methods-table.tex"))


def latex_table(scenes: Sequence[Scene]) -> str:
    """Return the LaTeX table of times and errors of every method in every scene."""
    comment = (
        "Times: medians with the distances to the quartiles, kernels compiled before.",
        "Errors of the airlight against the quadrature reference; p99: quantile of |error| / "
        "max(ref, mean / 1000).",
    )
    tables = []
    # The accuracy of the reference stands in the table, as no error below it means anything.
    for scene in scenes:
        error = scene.reference.relative_error
        known = f", reference known to {number(error, 2, zeros=True)}" if error else ""
        about = _size(scene.size) + known
        about += f", frames timed at {_size(scene.timed)}" if scene.timed != scene.size else ""
        rows = [_latex_row(entry) for entry in scene.methods]
        tables.append(
            methods_table(scene.name, rows, "label", *_TIMES, *_ERRORS, explanation=about)
        )
    return latex(tables, comment=comment)


def _size(size: tuple[int, int]) -> str:
    return "{} \N{MULTIPLICATION SIGN} {}".format(*size)


def _latex_row(entry: CellRow) -> Row:
    # A refusal is a row without numbers.
    if entry.reason:
        return Row({"label": entry.label}, "refused")
    keys = ("label", *_TIMES, *_ERRORS)
    values = {key: value for key, value in method_row(entry).values.items() if key in keys}
    bad = entry.error.nonfinite if entry.error else 0
    remarks = [] if entry.layer == "airlight" else [entry.layer]
    return Row(values, remarks=(*remarks, *([f"{bad:.0f} pixels not finite"] if bad else [])))


# Time against error


def draw_speed(scenes: Sequence[Scene], column: str) -> Any:
    """Return the time of a frame against the error of the airlight, a panel for each scene."""
    return speed_chart(scenes, WIDTHS[column], across=3 if column == "double" else 1, tallest=2.4)


# Images with insets: the two squares in which the methods are wrong the most


def _strip(
    report: Report, place: Path, name: str | None, labels: Sequence[str] | None
) -> tuple[Any, ...]:
    """Return the scene, the methods to show, and the images of the reference and of each."""
    scene = _scene(report, name)
    chosen = _chosen(scene, labels)
    files = [scene.files.exr, *(each.files["exr"] for each in chosen)]
    return scene.name, chosen, [_pixels(place / file, chosen[0].layer) for file in files]


def _scene(report: Report, name: str | None) -> Scene:
    scenes = {
        scene.name: scene
        for scene in report.scenes
        if _shown(scene, "airlight") or _shown(scene, "total")
    }
    # Only scenes with an image can be shown, and the message lists those.
    if name is not None and name not in scenes:
        raise InputError(
            f"scene: got {name!r}, expected one of {', '.join(scenes)}" + nearest(name, scenes)
        )
    if not scenes:
        raise InputError("the report has no scene with an image of a method: nothing to show")
    # A scene without shadows shows no difference between methods: the first scene with shadows is
    # the default.
    shadowed = [
        scene
        for scene in scenes.values()
        if not scene.plan.get("shadows", "none").startswith("none")
    ]
    return scenes[name] if name else (shadowed or list(scenes.values()))[0]


def _chosen(scene: Scene, wanted: Sequence[str] | None) -> list[Method]:
    """Return the methods to show: the requested ones, or the most accurate of each."""
    known = {
        entry.label: entry for layer in ("airlight", "total") for entry in _shown(scene, layer)
    }
    # By default one image of each method, its most accurate; the four most accurate of these stay,
    # in the order of the report.
    if wanted is None:
        best: dict[str, Method] = {}
        for entry in _shown(scene, "airlight") or _shown(scene, "total"):
            if entry.method not in best or _rank(entry) < _rank(best[entry.method]):
                best[entry.method] = entry
        kept = sorted(best.values(), key=_rank)[:4]
        return [entry for entry in best.values() if entry in kept]
    for label in wanted:
        if label not in known:
            names = "; ".join(known)
            raise InputError(
                f"method: got {label!r}, expected some of {names}" + nearest(label, known)
            )
    chosen = [known[label] for label in wanted]
    # Errors of airlight and of all light have different scales, and one exposure fits only one of
    # them.
    if len({entry.layer for entry in chosen}) > 1:
        raise InputError(
            "method: got images with airlight and images without layers; show them in two figures"
        )
    return chosen


def _shown(scene: Scene, layer: str) -> list[Method]:
    """Return the methods of a scene that have an image whose error is of a layer."""
    return [
        entry
        for entry in scene.methods
        if "exr" in entry.files and entry.error and entry.layer == layer
    ]


def _rank(entry: CellRow) -> float:
    rmse = _rmse(entry)
    return math.inf if math.isnan(rmse) or (entry.error and entry.error.nonfinite) else rmse


def _rmse(entry: CellRow) -> float:
    rmse = None if entry.error is None else entry.error.relative_rmse
    return math.nan if rmse is None else rmse


def _pixels(path: Path, name: str) -> Any:
    return np.asarray(image_layer(read_exr(path), name, path), dtype=np.float64)


def worst_squares(images: Sequence[Any], side: int) -> tuple[tuple[int, int], ...]:
    """Return the corners (column, row) of two squares that do not overlap, with the
    largest errors of all methods; of one where there is no room for another.

    Errors are divided by the largest of their method, so that every method counts.
    """
    # Errors of all methods, (height, width), each over its largest.
    reference = np.nan_to_num(images[0])
    total = np.zeros(reference.shape[:2])
    for image in images[1:]:
        error = np.abs(np.nan_to_num(image) - reference).sum(axis=2)
        total += error / max(error.max(), np.finfo(float).tiny)
    # Sums over all squares of `side` pixels at once, from the table of sums over rectangles at the
    # upper left corner.
    sums = np.pad(total, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    corners = []
    for _ in range(2):
        # The square with the largest error; corners whose squares would overlap it are then out of
        # question.
        if np.all(inside == -1.0):
            break
        row, column = (int(index) for index in np.unravel_index(int(inside.argmax()), inside.shape))
        corners.append((column, row))
        inside[max(0, row - side) : row + side, max(0, column - side) : column + side] = -1.0
    return tuple(corners)


def draw_strip(scene: str, methods: Sequence[CellRow], images: Sequence[Any], column: str) -> Any:
    """Return reference and methods in one exposure, two insets of each, and
    the signed relative error.
    """
    height, width = images[0].shape[:2]
    # An inset shows a sixth of the image's shorter side, of a tiny image all of that.
    side = min(max(4, min(height, width) // 6), height, width)
    corners, factor = worst_squares(images, side), exposure(images[0])
    # Inches and points. Each image has a picture, two insets of half its width below, and an error
    # map.
    wide, size = WIDTHS[column], 6 if column == "double" else 4.5
    # A character is about half as wide as the letters are high: titles keep to their column.
    letters = int(72 * wide / len(images) / (0.55 * size))
    about = f"reference\n{methods[0].layer}\n{scene}"
    titles = [about, *(_words(entry, letters) for entry in methods)]
    lines = max(title.count("\n") for title in titles) + 1
    above = lines * 1.25 * size / 72 + 0.2
    figure = new_figure(wide, wide / len(images) * (2 * height / width + 0.5) + above)
    grid = figure.add_gridspec(
        3, 2 * len(images), height_ratios=[height / width, 0.5, height / width]
    )
    for at, (entry, title, image) in enumerate(zip([None, *methods], titles, images)):
        picture = tone_mapped(image, factor)
        panel = figure.add_subplot(grid[0, 2 * at : 2 * at + 2])
        _show(panel, picture, title, size)
        for corner, colour, place in zip(corners, _FRAMES, (0, 1)):
            _mark(panel, corner, side, colour)
            inset = figure.add_subplot(grid[1, 2 * at + place])
            _show(
                inset,
                picture[corner[1] : corner[1] + side, corner[0] : corner[0] + side],
                frame=colour,
            )
        below = figure.add_subplot(grid[2, 2 * at : 2 * at + 2])
        # The reference has no error: the colour scale takes the place of its map.
        if entry is None:
            _scale(below, size)
        else:
            _show(below, error_map(images[0], image))
    figure.set_layout_engine("constrained", w_pad=0.015, h_pad=0.015, wspace=0.0, hspace=0.0)
    return figure


def _words(entry: CellRow, letters: int) -> str:
    """Return a label, its parameters, the error and the time, in lines of so many letters."""
    name, _, rest = entry.label.partition(" (")
    time = f", {number(entry.times.frame.median_ms)} ms" if entry.times else ""
    parts = (name, rest.rstrip(")"), f"rel. RMSE {_rmse(entry):.1e}{time}")
    return "\n".join(textwrap.fill(part, letters) for part in parts)


def _show(
    panel: Any, picture: Any, title: str = "", size: float = 6, frame: str | None = None
) -> None:
    show_picture(panel, picture, title, size)
    for spine in panel.spines.values():
        spine.set(edgecolor=frame or "black", linewidth=1.2 if frame else 0.4)


def _mark(panel: Any, corner: tuple[int, int], side: int, colour: str) -> None:
    from matplotlib.patches import Rectangle

    place = (corner[0] - 0.5, corner[1] - 0.5)
    panel.add_patch(Rectangle(place, side, side, fill=False, edgecolor=colour, linewidth=1.0))


def _scale(panel: Any, size: float) -> None:
    """Draw the colour scale of the error maps where the error of the reference would be."""
    panel.set_axis_off()
    bar = panel.inset_axes([0.06, 0.45, 0.88, 0.16])
    bar.imshow(error_scale(), aspect="auto", extent=(-1, 1, 0, 1))
    bar.set_yticks([])
    bar.set_xticks(
        [-1, 0, 1],
        [f"-{ERROR_CEILING:g}", f"±{ERROR_FLOOR:g}", f"+{ERROR_CEILING:g}"],
        fontsize=size,
    )
    bar.grid(False)
    bar.set_title("relative error [1]", fontsize=size)
