# SPDX-License-Identifier: BSD-3-Clause
"""The figure of the images: reference and methods in one exposure, two insets of each, and the signed relative error.

The insets are the two squares in which the methods are wrong the most, or those that are asked for. Exposure and error
maps are those of the report's page (`reports.plotting.pictures`).
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from analytic.errors import InputError, nearest
from reference.storage.files import ensure_folder
from reports.data.reader import load_report
from reports.figures.files import new_figure, read_data, value, write_data
from reports.figures.picture_grid import show_picture
from reports.figures.report import measured, report_origin
from reports.plotting.style import COLOURS, WIDTHS

NAME = "strip"
SUMMARY = "reference and methods of a scene in one exposure, with insets and error maps, from a report"

_MOST = 4  # most methods beside the reference
_INSET = 6  # shorter side of an image over the side of an inset
_HEADER = ("file", "label", "scene", "layer", "exposure", "relative_rmse", "x0", "y0", "x1", "y1", "side")
_FRAMES = (COLOURS["orange"], COLOURS["sky"])


def compute(
    folder: Path | str,
    *,
    report: Path | str,
    scene: str | None = None,
    methods: str | Sequence[str] | None = None,
    insets: Sequence[tuple[int, int]] | None = None,
) -> None:
    """Write `strip.csv` and an EXR file for each image into a folder.

    Parameters
    ----------
    scene
        Its name in the report; the first with shadows by default.
    methods
        Labels of the report, as a list or separated by ';'; the most accurate of each method by default.
    insets
        Columns and rows of the upper left corners of two insets [pixels]; chosen by the error by default.

    Raises
    ------
    InputError
        If the report has no such scene or method, or lacks an image.
    """
    from reference.storage.exr import Image, write_exr

    target = ensure_folder(folder)
    data, place = load_report(report)
    shown = _scene(data, scene)
    chosen = _methods(shown, methods)
    layer = chosen[0].get("layer", "airlight")
    images = [_pixels(place / shown["files"]["exr"], layer)]
    images += [_pixels(place / entry["files"]["exr"], layer) for entry in chosen]
    side = max(4, min(images[0].shape[:2]) // _INSET)
    corners = tuple(insets) if insets else _worst_squares(images, side)
    shared = (shown["name"], layer, _exposure(images[0]))
    rows = []
    for number, (image, entry) in enumerate(zip(images, [None, *chosen])):
        name = f"{NAME}-{number}.exr"
        write_exr(target / name, Image({layer: image}))
        error = entry["error"]["relative_rmse"] if entry else None
        label = entry["label"] if entry else "reference"
        rows.append((name, label, *shared, error, *corners[0], *corners[1], side))
    write_data(target, NAME, _HEADER, rows, **report_origin(place, data), scene=shown["name"])


def _scene(data: dict[str, Any], name: str | None) -> dict[str, Any]:

    scenes = {scene["name"]: scene for scene in data["scenes"] if _shown(scene, "airlight") or _shown(scene, "total")}
    if name is not None and name not in scenes:
        raise InputError(f"scene: got {name!r}, wanted one of {', '.join(scenes)}" + nearest(name, scenes))
    if not scenes:
        raise InputError("the report has no scene with an image of a method: nothing to show")
    shadowed = [scene for scene in scenes.values() if not str(scene["plan"].get("shadows", "none")).startswith("none")]
    return scenes[name] if name else (shadowed or list(scenes.values()))[0]


def _methods(scene: dict[str, Any], wanted: str | Sequence[str] | None) -> list[dict[str, Any]]:
    """Return the methods to show: those that were asked for, or the most accurate of each."""
    known = {entry["label"]: entry for layer in ("airlight", "total") for entry in _shown(scene, layer)}
    if wanted is None:
        best: dict[str, dict[str, Any]] = {}
        for entry in _shown(scene, "airlight") or _shown(scene, "total"):
            if entry["method"] not in best or _rank(entry) < _rank(best[entry["method"]]):
                best[entry["method"]] = entry
        kept = sorted(best.values(), key=_rank)[:_MOST]
        return [entry for entry in best.values() if entry in kept]
    labels = [word.strip() for word in wanted.split(";")] if isinstance(wanted, str) else list(wanted)
    for label in labels:
        if label not in known:
            names = "; ".join(known)
            raise InputError(f"--methods: got {label!r}, wanted some of {names}" + nearest(label, known))
    chosen = [known[label] for label in labels]
    if len({entry.get("layer", "airlight") for entry in chosen}) > 1:
        raise InputError("--methods: got images with airlight and images without layers; show them in two figures")
    return chosen


def _shown(scene: dict[str, Any], layer: str) -> list[dict[str, Any]]:
    """Return the methods of a scene that have an image."""
    return [entry for entry in measured(scene, layer) if entry["files"].get("exr")]


def _rank(entry: dict[str, Any]) -> float:
    error = entry["error"]["relative_rmse"]
    return float("inf") if error is None or entry["error"]["nonfinite"] else error


def _pixels(path: Path, name: str):
    from reference.storage.exr import layer, read_exr

    return layer(read_exr(path), name, path)


def _exposure(reference) -> float:
    import numpy as np

    from reports.plotting.pictures import exposure

    return exposure(np.asarray(reference, dtype=np.float64))


def _worst_squares(images, side: int) -> tuple[tuple[int, int], ...]:
    """Return the corners (column, row) of two squares that do not overlap, with the largest errors of all methods.

    Errors are divided by the largest of their method, so that every method counts.
    """
    import numpy as np

    reference = np.nan_to_num(np.asarray(images[0], dtype=np.float64))
    total = np.zeros(reference.shape[:2])
    for image in images[1:]:
        error = np.abs(np.nan_to_num(np.asarray(image, dtype=np.float64)) - reference).sum(axis=2)
        total += error / max(error.max(), np.finfo(float).tiny)
    sums = np.pad(total, ((1, 0), (1, 0))).cumsum(axis=0).cumsum(axis=1)
    inside = sums[side:, side:] - sums[:-side, side:] - sums[side:, :-side] + sums[:-side, :-side]
    corners = []
    for _ in range(2):
        row, column = (int(index) for index in np.unravel_index(int(inside.argmax()), inside.shape))
        corners.append((column, row))
        inside[max(0, row - side) : row + side, max(0, column - side) : column + side] = -1.0
    return tuple(corners)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    import numpy as np

    from reports.plotting.pictures import error_map, tone_mapped

    rows = read_data(folder, NAME)
    first = rows[0]
    images = [np.asarray(_pixels(folder / row["file"], row["layer"]), dtype=np.float64) for row in rows]
    corners = [(int(first["x0"]), int(first["y0"])), (int(first["x1"]), int(first["y1"]))]
    side, factor = int(first["side"]), value(first, "exposure") or 1.0
    height, width = images[0].shape[:2]
    wide = WIDTHS[column]
    each = wide / len(images)
    figure = new_figure(wide, each * (2 * height / width + 0.5) + 0.55)
    grid = figure.add_gridspec(3, 2 * len(images), height_ratios=[height / width, 0.5, height / width])
    for number, (row, image) in enumerate(zip(rows, images)):
        picture = tone_mapped(image, factor)
        panel = figure.add_subplot(grid[0, 2 * number : 2 * number + 2])
        _show(panel, picture)
        _title(panel, row, column)
        for corner, colour, place in zip(corners, _FRAMES, (0, 1)):
            _mark(panel, corner, side, colour)
            inset = figure.add_subplot(grid[1, 2 * number + place])
            _show(inset, picture[corner[1] : corner[1] + side, corner[0] : corner[0] + side], colour)
        below = figure.add_subplot(grid[2, 2 * number : 2 * number + 2])
        if number:
            _show(below, error_map(images[0], image))
        else:
            _scale(below, 6 if column == "double" else 4.5)
    figure.set_layout_engine("constrained", w_pad=0.015, h_pad=0.015, wspace=0.0, hspace=0.0)
    return figure


def _show(panel, picture, colour: str | None = None) -> None:
    show_picture(panel, picture)
    for spine in panel.spines.values():
        spine.set(edgecolor=colour or "black", linewidth=1.2 if colour else 0.4)


def _title(panel, row: dict[str, str], column: str) -> None:
    """Write the label, broken before its parameters, and the error."""
    error = value(row, "relative_rmse")
    name, _, rest = row["label"].partition(" (")
    lines = [name, rest.rstrip(")") if rest else "", f"RMSE {error:.1e}" if error is not None else row["scene"]]
    panel.set_title("\n".join(lines), fontsize=6 if column == "double" else 4.5, parse_math=False)


def _mark(panel, corner: tuple[int, int], side: int, colour: str) -> None:
    from matplotlib.patches import Rectangle

    place = (corner[0] - 0.5, corner[1] - 0.5)
    panel.add_patch(Rectangle(place, side, side, fill=False, edgecolor=colour, linewidth=1.0))


def _scale(panel, size: float) -> None:
    """Draw the colour scale of the error maps where the error of the reference would be."""
    from reports.plotting.pictures import ERROR_CEILING, ERROR_FLOOR, error_scale

    panel.set_axis_off()
    bar = panel.inset_axes([0.06, 0.45, 0.88, 0.16])
    bar.imshow(error_scale(), aspect="auto", extent=(-1, 1, 0, 1))
    bar.set_yticks([])
    bar.set_xticks([-1, 0, 1], [f"-{ERROR_CEILING:g}", f"±{ERROR_FLOOR:g}", f"+{ERROR_CEILING:g}"], fontsize=size)
    bar.grid(False)
    bar.set_title("relative error [1]", fontsize=size)
