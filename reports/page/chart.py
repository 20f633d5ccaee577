# SPDX-License-Identifier: BSD-3-Clause
"""Charts of a report, as SVG text."""

import io
import re
from html import escape
from typing import Any

from reports.plotting.style import report_styles


def speed_error_chart(scenes: list[dict[str, Any]]) -> str:
    """Return speed against error as inline SVG: one panel a scene, one colour and marker a configuration everywhere."""
    from matplotlib.figure import Figure

    styles = report_styles(scenes)
    columns = min(2, len(scenes))
    rows = -(-len(scenes) // columns)
    figure = Figure(figsize=(5.1 * columns, 3.3 * rows + 0.9), layout="constrained")
    panels = figure.subplots(rows, columns, squeeze=False)
    for panel, scene in zip(panels.flat, scenes):
        _panel(panel, scene, styles)
    for panel in list(panels.flat)[len(scenes) :]:
        panel.set_visible(False)
    _legend(figure, panels.flat[0], styles, columns=3)
    return svg_text(figure)


def scene_chart(scenes: list[dict[str, Any]], place: int) -> str:
    """Return speed against error in one of the scenes as inline SVG, in the styles of the whole report.

    The point of the n-th method that has images has the name "point-n".
    """
    from matplotlib.figure import Figure

    styles, scene = report_styles(scenes), scenes[place]
    figure = Figure(figsize=(5.2, 3.0), layout="constrained")
    panel = figure.subplots()
    _panel(panel, scene, styles, named=True)
    # The first variant of a method stands for all: the strip of the errors beside the chart names every one.
    methods = {entry["method"]: styles[entry["label"]] for entry in reversed(scene["methods"]) if _has_point(entry)}
    _legend(figure, panel, dict(reversed(methods.items())), columns=4)
    return _with_titles(svg_text(figure, "airlight, one scene"), scene)


def _legend(figure, panel, styles: dict[str, dict[str, Any]], *, columns: int) -> None:
    handles = [panel.plot([], [], **_points(style), label=short(label))[0] for label, style in styles.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=columns, fontsize=8, frameon=False)


def short(label: str, most: int = 56) -> str:
    """Return a label that leaves room for others."""
    return label if len(label) <= most else label[: most - 1].rstrip(" ,") + "\N{HORIZONTAL ELLIPSIS}"


def _with_titles(svg: str, scene: dict[str, Any]) -> str:
    """Return a chart whose named points say what they are, as a browser shows it under the pointer."""
    for number, entry in enumerate(entry for entry in scene["methods"] if entry["files"]):
        if _has_point(entry):
            time, error = entry["times"]["frame"]["median_ms"], entry["error"]["relative_rmse"]
            words = escape(f"{entry['label']}: {time:.3g} ms, relative RMSE {error:.2g}")
            svg = svg.replace(f'<g id="point-{number}">', f'<g id="point-{number}"><title>{words}</title>')
    return svg


def _has_point(entry: dict[str, Any]) -> bool:
    """Return whether a method has a place on the logarithmic axes."""
    return bool(entry["times"] and entry["error"] and entry["error"]["relative_rmse"])


def _panel(panel, scene: dict[str, Any], styles: dict[str, dict[str, Any]], *, named: bool = False) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    shown = [entry for entry in scene["methods"] if entry["files"]]
    for measured in scene["methods"]:
        if not _has_point(measured):
            continue
        time = measured["times"]["frame"]
        spread = [[time["median_ms"] - time["low_ms"]], [time["high_ms"] - time["median_ms"]]]
        point = (time["median_ms"], measured["error"]["relative_rmse"])
        drawn = panel.errorbar(*point, xerr=spread, **_points(styles[measured["label"]]))
        if named and measured in shown:
            drawn.lines[0].set_gid(f"point-{shown.index(measured)}")
    panel.set(xscale="log", yscale="log", xlabel="time of a frame [ms]", ylabel="relative RMSE of the airlight [1]")
    # Times often span less than a decade: name 1, 2 and 5 of each, in plain numbers.
    panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_title(scene["name"], fontsize=10, parse_math=False)  # a dollar in a file name must not begin a formula
    panel.grid(True, which="major", linewidth=0.4, alpha=0.5)


def _points(style: dict[str, Any]) -> dict[str, Any]:
    return style | {"linestyle": "none", "markersize": 7}


def svg_text(figure, salt: str = "airlight") -> str:
    """Return a figure of matplotlib as inline SVG, the same bytes for the same figure; each chart has its salt."""
    import matplotlib

    # A fixed salt, another for each chart of a page, and no date: the same data give the same bytes.
    with matplotlib.rc_context({"svg.hashsalt": salt, "svg.fonttype": "none", "font.size": 9}):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    # The names that matplotlib counts would be there twice on a page of two charts, and so would those of equal images.
    return re.sub(r' id="([\w.]+_\d+|image[0-9a-f]+)"', "", text[text.index("<svg") :])
