# SPDX-License-Identifier: BSD-3-Clause
"""Charts of a report, as SVG text."""

import io
from typing import Any

from reports.plotting.style import report_styles


def speed_error_chart(scenes: list[dict[str, Any]]) -> str:
    """Return speed against error as inline SVG: one panel a scene, one colour and marker a configuration everywhere.

    Parameters
    ----------
    scenes
        The scenes of report.json.
    """
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
    handles = [panels.flat[0].plot([], [], **_points(style), label=label)[0] for label, style in styles.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    return _svg(figure)


def _panel(panel, scene: dict[str, Any], styles: dict[str, dict[str, Any]]) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

    for measured in scene["methods"]:
        if not measured["times"] or not measured["error"] or not measured["error"]["relative_rmse"]:
            continue
        time = measured["times"]["frame"]
        spread = [[time["median_ms"] - time["low_ms"]], [time["high_ms"] - time["median_ms"]]]
        point = (time["median_ms"], measured["error"]["relative_rmse"])
        panel.errorbar(*point, xerr=spread, **_points(styles[measured["label"]]))
    panel.set(xscale="log", yscale="log", xlabel="time of a frame [ms]", ylabel="relative RMSE of the airlight [1]")
    # Times often span less than a decade: name 1, 2 and 5 of each, in plain numbers.
    panel.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    panel.xaxis.set_major_formatter(FuncFormatter(lambda value, position: f"{value:g}"))
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_title(scene["name"], fontsize=10, parse_math=False)  # a dollar in a file name must not begin a formula
    panel.grid(True, which="major", linewidth=0.4, alpha=0.5)


def _points(style: dict[str, Any]) -> dict[str, Any]:
    return style | {"linestyle": "none", "markersize": 7}


def _svg(figure) -> str:
    import matplotlib

    # A fixed salt and no date: the same data give the same bytes.
    with matplotlib.rc_context({"svg.hashsalt": "airlight", "svg.fonttype": "none", "font.size": 9}):
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg", metadata={"Date": None}, transparent=True)
    text = buffer.getvalue()
    return text[text.index("<svg") :]
