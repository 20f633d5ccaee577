# SPDX-License-Identifier: BSD-3-Clause
"""Charts of a report, as SVG text."""

import io
import re
from collections.abc import Sequence
from html import escape
from typing import Any

from airlight.reports.data.records import Scene
from airlight.reports.plotting.figure import (
    drawn_error,
    has_point,
    legend_below,
    new_figure,
    speed_chart,
    speed_panel,
)
from airlight.reports.plotting.style import page_style, report_styles

_SIZE = {"markersize": 7}


@page_style()
def speed_error_chart(scenes: Sequence[Scene]) -> str:
    """Return speed against error of all scenes as inline SVG; nothing where nothing was timed."""
    if not any(has_point(entry) for scene in scenes for entry in scene.methods):
        return ""
    return svg_text(speed_chart(scenes, 5.1 * min(2, len(scenes)), across=2, tallest=3.5, **_SIZE))


@page_style()
def scene_chart(scenes: Sequence[Scene], place: int) -> str:
    """Return speed against error in one of the scenes as inline SVG, in the
    styles of the whole report.

    The point of the n-th method that has images has the name "point-n", and says what
    it is under the pointer.
    """
    rows = ((row.method, row.label) for scene in scenes for row in scene.methods)
    styles, scene = (
        {label: style | _SIZE for label, style in report_styles(rows).items()},
        scenes[place],
    )
    figure = new_figure(5.2, 3.0)
    panel = figure.subplots()
    points = speed_panel(panel, scene.name, scene.methods, styles)
    panel.set_ylabel("relative RMSE of the airlight [1]")
    titles = {}
    for number, entry in enumerate(entry for entry in scene.methods if entry.files):
        if entry.label in points:
            name = f"point-{number}"
            points[entry.label].set_gid(name)
            assert entry.times
            time, error = entry.times.frame.median_ms, drawn_error(entry)
            titles[name] = escape(f"{entry.label}: {time:.3g} ms, relative RMSE {error:.2g}")
    # The first variant of a method stands for all: the strip of the errors beside
    # the chart names every one.
    methods: dict[str, Any] = {}
    for entry in scene.methods:
        if entry.label in points:
            methods.setdefault(entry.method, styles[entry.label])
    legend_below(figure, panel, methods, columns=4)
    svg = svg_text(figure, "airlight, one scene")
    for name, words in titles.items():
        svg = svg.replace(f'<g id="{name}">', f'<g id="{name}"><title>{words}</title>')
    return svg


def svg_text(figure, salt: str = "airlight") -> str:
    """Return a figure of matplotlib as inline SVG, the same bytes for the same figure;
    each chart has its salt.
    """
    import matplotlib

    # A fixed salt, another for each chart of a page, and no date: the same
    # data give the same bytes.
    with matplotlib.rc_context({"svg.hashsalt": salt, "svg.fonttype": "none", "font.size": 9}):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    # The names that matplotlib counts would be there twice on a page of two charts, and so
    # would those of equal images.
    return re.sub(r' id="([\w.]+_\d+|image[0-9a-f]+)"', "", text[text.index("<svg") :])
