# SPDX-License-Identifier: BSD-3-Clause
"""Figures for papers: an empty one, pictures in a grid, and how a figure becomes a file.

Files hold nothing that varies from run to run, such as the date: the same
numbers give the same bytes.
"""

import io
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.reference.storage.files import write_bytes
from airlight.reports.data.records import Scene
from airlight.reports.plotting.style import WIDTHS, figure_style, report_styles
from airlight.validation.study.row import Row

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

#: Metadata without anything that differs from one run to the next.
_METADATA: Mapping[str, dict[str, Any]] = {
    ".pdf": {"CreationDate": None},
    ".png": {"Software": None},
}
ENDINGS = tuple(_METADATA)


def save_figure(path: Path, draw: Callable[[str], "Figure"], column: str = "double") -> Path:
    """Write a figure for a column, 'single' or 'double', as PDF or PNG, by the ending of
    the path; return the path.
    """
    with figure_style(column):
        write_bytes(path, file_bytes(draw(column), path.suffix.lower()))
    return path


def file_bytes(figure: "Figure", ending: str, **how: Any) -> bytes:
    """Return a figure as a file, the same bytes for the same figure."""
    buffer = io.BytesIO()
    # Without dates and versions in it a file changes only when its figure does.
    figure.savefig(buffer, format=ending[1:], metadata=_METADATA[ending], **how)
    return buffer.getvalue()


def new_figure(width: float, height: float) -> "Figure":
    """Return an empty figure of this size [inches], without overlaps, window or global state."""
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def picture_grid(pictures: Sequence[tuple[str, Any]], column: str, *, across: int = 3) -> "Figure":
    """Return a figure of pictures with titles, in rows of `across`, for a
    column, 'single' or 'double'.

    Pictures are (height, width, 3) in 8 bits, or (height, width) for shades of grey.
    """
    # Inches: each row is as high as its pictures, with 0.36 for a title of two lines.
    wide, down = WIDTHS[column], -(-len(pictures) // across)
    height, width = pictures[0][1].shape[:2]
    figure = new_figure(wide, down * (wide / across * height / width + 0.36))
    panels = figure.subplots(down, across, squeeze=False).ravel()
    for panel in panels:
        panel.set_axis_off()
    for panel, (title, picture) in zip(panels, pictures):
        show_picture(panel, picture, title, 6 if column == "double" else 4.5)
    return figure


def show_picture(panel: "Axes", picture: Any, title: str = "", size: float = 6) -> None:
    """Show a picture in a panel without ticks, pixel by pixel."""
    panel.imshow(picture, interpolation="nearest", cmap="gray" if picture.ndim == 2 else None)
    panel.set(xticks=[], yticks=[])
    panel.grid(False)
    # a dollar in a name must not begin a formula
    panel.set_title(title, fontsize=size, parse_math=False)


def has_point(entry: Row) -> bool:
    """Return whether a method has a time and an error; an error of 0 has no
    place on a logarithmic axis.
    """
    return bool(entry.times and entry.error and entry.error.relative_rmse)


def drawn_error(entry: Row) -> float:
    """Return the relative RMSE at which a method with a point stands: of one that draws random
    numbers the mean over its runs.
    """
    assert entry.error
    assert entry.error.relative_rmse is not None
    return entry.error.relative_rmse if entry.noise is None else entry.noise.rmse


def speed_chart(
    scenes: Sequence[Scene], width: float, *, across: int, tallest: float, **marks: Any
) -> "Figure":
    """Return times of frames against errors, a panel for each scene that has any, and one legend.

    A figure is `width` wide, a panel at most `tallest` high [inches]. Styles follow from all labels
    of a report, with or without a point, and `marks` change them.
    """
    # A legend for all panels has only labels that some panel draws; their styles were assigned over
    # all labels, so that every chart of a report agrees.
    timed = [scene for scene in scenes if any(map(has_point, scene.methods))]
    there = {entry.label for scene in timed for entry in scene.methods if has_point(entry)}
    rows = ((row.method, row.label) for scene in scenes for row in scene.methods)
    styles = {
        label: style | marks for label, style in report_styles(rows).items() if label in there
    }
    across = min(len(timed), across)
    down, lines = -(-len(timed) // across), -(-len(styles) // min(3, across))
    figure = new_figure(width, down * min(0.75 * width / across, tallest) + 0.14 * lines + 0.1)
    panels = figure.subplots(down, across, squeeze=False)
    for panel, scene in zip(panels.flat, timed):
        speed_panel(panel, scene.name, scene.methods, styles)
        # Frames may be timed at another size than that of the images whose errors are shown.
        if scene.timed != scene.size:
            panel.set_xlabel("time of a frame of {} x {} [ms]".format(*scene.timed))
    for panel in panels.flat[len(timed) :]:
        panel.set_axis_off()
    figure.supylabel("relative RMSE of the airlight [1]", fontsize="medium")
    legend_below(figure, panels.flat[0], styles, columns=min(3, across))
    return figure


def legend_below(
    figure: "Figure", panel: "Axes", styles: Mapping[str, Mapping[str, Any]], *, columns: int
) -> None:
    """Put the markers of labels below a figure."""
    # Empty plots make the markers, and only those: curves and bars of errors stay out of the
    # legend.
    handles = [
        panel.plot([], [], **style, linestyle="none", label=short(label))[0]
        for label, style in styles.items()
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=columns)


def speed_panel(
    panel: "Axes", title: str, entries: Iterable[Row], styles: Mapping[str, Mapping[str, Any]]
) -> dict[str, Any]:
    """Draw times of frames, with quartiles, against errors of methods that have both;
    return their points by label.

    For a method that draws random numbers a bar goes down from its error to its bias, or to the
    largest possible bias. A time that another program measured is hollow, and says so: it is of
    another run than the others. An error of other light than the airlight says so, too.
    """
    points = {}
    for entry in filter(has_point, entries):
        assert entry.times
        # Distances to the quartiles, which matplotlib takes as lengths of bars.
        frame, error = entry.times.frame, drawn_error(entry)
        spread = [[frame.median_ms - frame.low_ms], [frame.high_ms - frame.median_ms]]
        style = {**styles[entry.label], "linestyle": "none"}
        # A noisy method would get better with every frame averaged: its point is the error of one
        # frame, its bar reaches to the bias that remains.
        if noise := entry.noise:
            bias = noise.most_bias if noise.root_bias is None else noise.root_bias
            if bias is not None:
                style["yerr"] = [[max(error - bias, 0.0)], [0.0]]
        # Not measured in turns with the others, or not of the light that the axis names.
        remarks = [] if entry.layer == "airlight" else [f"error of the {entry.layer}"]
        if entry.times.run is None:
            style["markerfacecolor"] = "none"
            remarks.append("timed elsewhere")
        if remarks:
            panel.annotate(
                ", ".join(remarks),
                (frame.median_ms, error),
                (0, 5),
                textcoords="offset points",
                fontsize=5,
            )
        points[entry.label] = panel.errorbar(
            [frame.median_ms], [error], xerr=spread, **style
        ).lines[0]
    panel.set(xscale="log", yscale="log", xlabel="time of a frame [ms]")
    panel.set_title(title, parse_math=False)  # a dollar in a file name must not begin a formula
    plain_times(panel)
    return points


def plain_times(panel: "Axes") -> None:
    """Name 1, 2 and 5 of each decade, in plain numbers: times often span less than one."""
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    # With many decades 2 and 5 of each would collide.
    low, high = panel.get_xlim()
    panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5) if high < 50 * low else (1,)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())


def short(label: str, most: int = 56) -> str:
    """Return a label that leaves room for others."""
    return (
        label if len(label) <= most else label[: most - 1].rstrip(" ,") + "\N{HORIZONTAL ELLIPSIS}"
    )
