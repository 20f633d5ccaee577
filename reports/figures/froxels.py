# SPDX-License-Identifier: BSD-3-Clause
"""The figure of froxel fog: its error over columns and over slices, and the ghost of a light that moves."""

from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder
from reports.figures.files import new_figure, read_data, values, write_data
from reports.machine.progress import Progress, counted
from reports.plotting.style import COLOURS, WIDTHS

NAME = "froxels"
SUMMARY = "froxel fog: error over columns and slices, and the ghost of a light that moves, over frames"

SCENE = "penumbra-plane"
COLUMNS = (20, 40, 80, 160)
SLICES = (16, 32, 64, 128)
#: Weights of the history, and whether it is cut off at what the neighbours hold.
HISTORIES = ((0.5, False), (0.8, False), (0.9, False), (0.95, False), (0.95, True))
GHOST = (80, 45, 32)  #: froxels under the light that moves
TURN = 0.1  #: of the light in a frame [rad]
FRAMES = (10, 30)  #: in which the light moves, and in which it rests
_POINTS, _AVERAGED = 4, 16
_HEADER = ("panel", "series", "x", "relative_rmse", "p50")
_PANELS = {
    "columns": ("columns of froxels", "relative RMSE of the airlight [1]"),
    "slices": ("slices", "relative RMSE of the airlight [1]"),
    "ghost": ("frame", "RMS of the ghost over the mean [1]"),
}
_STYLES = tuple((COLOURS[name], marker) for name, marker in zip(("orange", "blue", "green", "wine", "purple"), "hsDX^"))


def compute(folder: Path | str, *, quick: bool = False, scene: str = SCENE, progress: Progress | None = None) -> None:
    """Write `froxels.csv` into a folder: errors by grid, and the ghosts of histories by frame.

    Parameters
    ----------
    quick
        A smaller image and fewer sizes.
    scene
        A built-in scene or the path of a Mitsuba XML file.
    """
    from realtime.scene.read_scene import read_scene
    from validation.frames.froxel_study import ghosts, grid_errors
    from validation.scenes.loading import load_scene

    target = ensure_folder(folder)
    image = (64, 48) if quick else (120, 90)
    columns, slices = (COLUMNS[:2], SLICES[:2]) if quick else (COLUMNS, SLICES)
    loaded = load_scene(scene, image)
    read = read_scene(loaded.scene)
    tell = counted(progress) if progress is not None else lambda done, total, words: None
    rows: list[tuple[Any, ...]] = []
    across = [(width, width * 9 // 16, 64) for width in columns]
    deep = [(160, 90, count) for count in slices]
    for number, (panel, sizes, grids) in enumerate((("columns", columns, across), ("slices", slices, deep))):
        for frames, name in ((1, "one frame"), (_AVERAGED, f"jitter, {_AVERAGED} frames")):
            errors = grid_errors(read, grids, points=_POINTS, frames=frames)
            rows += [(panel, name, size, each.relative_rmse, each.p50) for size, each in zip(sizes, errors)]
        tell(number + 1, 3, panel)
    by_weight = ghosts(read, loaded.animation, HISTORIES, grid=GHOST, points=_POINTS, turn=TURN, frames=FRAMES)
    for ghost in by_weight:
        name = f"history={ghost.weight:g}" + (", clamp" if ghost.clamp else "")
        rows += [("ghost", name, number, error, None) for number, error in enumerate(ghost.errors)]
    tell(3, 3, "ghost")
    about = {"scene": scene, "image": image, "points": _POINTS, "turn": TURN, "frames": FRAMES}
    write_data(target, NAME, _HEADER, rows, **about)


def draw(folder: Path, column: str):
    """Return the figure, see `reports.figures.files.plot`."""
    from reports.figures.files import name_sizes

    rows = read_data(folder, NAME)
    width = WIDTHS[column]
    figure = new_figure(width, 0.36 * width if column == "double" else 2.4 * width)
    panels = figure.subplots(1, 3) if column == "double" else figure.subplots(3, 1)
    for panel, (name, (across, upward)) in zip(panels, _PANELS.items()):
        chosen = [row for row in rows if row["panel"] == name]
        for series, (colour, marker) in zip(dict.fromkeys(row["series"] for row in chosen), _STYLES):
            line = [row for row in chosen if row["series"] == series]
            every = {"markevery": 4} if name == "ghost" else {}
            panel.plot(
                values(line, "x"), values(line, "relative_rmse"), color=colour, marker=marker, label=series, **every
            )
        panel.set(yscale="log", xlabel=across, ylabel=upward)
        if name != "ghost":
            panel.set(xscale="log")
            name_sizes(panel, values(chosen, "x"))
        else:
            panel.axvline(FRAMES[0], color="black", linewidth=0.6, linestyle=":")
            panel.set_ylim(1e-4, None)
        panel.legend(loc="best")
    return figure
