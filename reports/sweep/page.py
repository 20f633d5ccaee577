# SPDX-License-Identifier: BSD-3-Clause
"""The files that say what a sweep says, made from its Parquet alone: its page,
its figures and its claims.

The page is one HTML file that needs no network. A sweep has a thousand scenes and a dozen
configurations or more: no panel tells a dozen colours apart, so every configuration has a line of
the figure.
"""

import base64
import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from airlight.reference.storage.build import build
from airlight.reference.storage.files import ensure_folder, write_bytes, write_text
from airlight.reports.page.chart import svg_text
from airlight.reports.page.filters import drawn, facts, percent, unbroken
from airlight.reports.page.render import page_environment, template_text
from airlight.reports.plotting.figure import (
    file_bytes,
    legend_below,
    new_figure,
    plain_times,
    short,
)
from airlight.reports.plotting.style import page_style, report_styles
from airlight.reports.sweep import tables
from airlight.reports.sweep.claims import LEAST, NAMED, SAME, TARGETS, property_words
from airlight.reports.sweep.samples import Numbers, Sample, read_sweep
from airlight.reports.sweep.summary import Summary, sound_words, summary_of
from airlight.validation.columns import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

PAGE, CLAIMS, FIGURES = "sweep.html", "sweep.json", "figures"  #: in the folder of a sweep
PICTURES = 400  #: most on a page, of some 20 kB each

_TABLES = ("errors", "speed", "correlations", "refusals", "checks", "faults")

_EXACT = 1e-8  #: errors below are drawn here: float32 cannot tell them from none
#: errors above are drawn here: a series that left its range has 1e22, and no
#: other point could be told
_WRONG = 1e3
_LABEL = 38  # letters of a label, which may be a path of a user's: room is left for the panel

ERROR = "relative RMSE of the airlight [1]"
TIME = "time of a frame [ms]"


def write_sweep(source: Path, target: Path | None = None) -> tuple[Summary, Path]:
    """Write what a sweep says, from its Parquet alone; return that and the path of its page.

    `source` is the folder of a sweep or its Parquet, `target` the folder of the files, the one
    with the Parquet by default.
    """
    said = summary_of(read_sweep(source))
    folder = ensure_folder(said.sweep.path.parent if target is None else target)
    # Every figure as SVG for the page and as PDF for a paper; claims as JSON; the page last, as it
    # holds the figures.
    charts = {}
    for name, figure in drawn_figures(said):
        charts[name] = svg_text(figure, name)
        write_text(folder / FIGURES / f"{name}.svg", charts[name])
        write_bytes(folder / FIGURES / f"{name}.pdf", file_bytes(figure, ".pdf", dpi=320))
    # A figure for which these rows have no data would be that of earlier ones.
    for name in _DRAWN.keys() - charts.keys():
        for ending in (".svg", ".pdf"):
            (folder / FIGURES / f"{name}{ending}").unlink(missing_ok=True)
    write_text(
        folder / CLAIMS,
        json.dumps(plain(said), indent=1, ensure_ascii=False, allow_nan=False) + "\n",
    )
    write_text(folder / PAGE, render_sweep(said, charts))
    return said, folder / PAGE


def render_sweep(said: Summary, charts: Mapping[str, str]) -> str:
    """Return the HTML page of a sweep, with its figures as SVG by name, and
    pictures of the worst scenes.
    """
    from markupsafe import Markup

    # The templates and the style of reports.
    environment = page_environment()
    environment.filters["error"] = error_words
    environment.globals |= {
        f"{name}_table": drawn(getattr(tables, f"{name}_table")) for name in _TABLES
    }
    environment.globals |= {"facts_table": drawn(facts), "property_words": property_words}
    template = environment.get_template("sweep.html.j2")
    worst = _worst_keys(said)
    # Pictures of worst scenes are limited, and the page says how many it leaves out.
    content = {
        "pictures": _pictures(said, worst[:PICTURES]),
        "omitted": max(0, len(worst) - PICTURES),
        "said": said,
        "scenes": f"{said.scenes} {'random ' * said.drawn}scene{'s' * (said.scenes != 1)}",
        "charts": {name: Markup(chart) for name, chart in charts.items()},
        "sound": sound_words(said),
        "source": said.sweep.path.name,
        "folder": said.sweep.path.parent,
        "timed": sum(sample.timed for sample in said.samples),
        "undecided": sum(each.undecided for each in said.claims),
        "decided": len(TARGETS) * sum(sample.count("done") for sample in said.samples),
        "same": SAME,
        "named": NAMED,
        "least": LEAST,
        "version": build().words,
        "css": Markup(template_text("report.css") + template_text("sweep.css")),
    }

    return template.render(content)


def error_words(value: float | None) -> str:
    """Return an error in per cent, or that it is none that a number could say."""
    if value is None:
        return "without a number"
    return unbroken(f"{100 * value:.0f} %" if 1 <= value < 1000 else percent(value, 2))


def _worst_keys(said: Summary) -> list[str]:
    """Return the keys of the worst scenes' rows, the worst of every configuration first."""
    # Rank by rank over the configurations: a limit then cuts each of them alike.
    ranks = max((len(several) for several in said.worst.values()), default=0)
    return [
        several[rank].key
        for rank in range(ranks)
        for several in said.worst.values()
        if rank < len(several)
    ]


def _pictures(said: Summary, keys: list[str]) -> dict[str, str]:
    """Return pictures of rows as addresses that hold them, by key."""
    kept: dict[str, Any] = said.sweep.pictures(keys)
    return {
        key: f"data:image/webp;base64,{base64.b64encode(kept[key]).decode()}"
        for key in keys
        if key in kept
    }


# Figures: for the page as SVG, for papers as PDF


@page_style()
def distribution(said: Summary) -> "Figure | None":
    """Return how the errors of each configuration are spread over the scenes: a
    line each, the best above.

    None if nothing was measured.
    """
    # The best median at the top.
    shown = [sample for sample in said.samples if _errors(sample).size]
    if not shown:
        return None
    shown.sort(key=lambda sample: float(np.median(_errors(sample))))
    figure = _figure(0.26 * len(shown) + 1.0)
    panel = figure.subplots()
    styles = report_styles((sample.method, sample.label) for sample in said.samples)
    for place, sample in enumerate(shown):
        errors, colour = _errors(sample), styles[sample.label]["color"]
        # A thin line from 5 % to 95 %, a thick one over the quartiles, a mark at the median, and
        # each scene outside as a tick. Nearest values, as a mean of two errors may lie where no
        # scene does.
        low, first, middle, third, high = np.quantile(
            errors, (0.05, 0.25, 0.5, 0.75, 0.95), method="nearest"
        )
        outside = errors[(errors < low) | (errors > high)]
        panel.plot(
            outside,
            np.full(len(outside), place),
            "|",
            color=colour,
            markersize=5,
            alpha=0.5,
            rasterized=True,
        )
        panel.plot((low, high), (place, place), color=colour, linewidth=1.2)
        panel.plot(
            (first, third),
            (place, place),
            color=colour,
            linewidth=7,
            alpha=0.55,
            solid_capstyle="butt",
        )
        panel.plot(middle, place, "|", color="black", markersize=9, markeredgewidth=1.6)
    # The errors that claims are about.
    for target in TARGETS:
        panel.axvline(target, color="#666a72", linewidth=0.8, linestyle=":", zorder=0)
    panel.set_yticks(range(len(shown)), [_with_count(sample) for sample in shown], parse_math=False)
    panel.set(xscale="log", xlabel=ERROR, ylim=(len(shown) - 0.4, -0.6))
    panel.grid(False, axis="y")
    panel.spines[["top", "right", "left"]].set_visible(False)
    panel.tick_params(axis="y", length=0)
    return figure


@page_style()
def medians(said: Summary) -> "Figure | None":
    """Return speed against error, each configuration as its median and its
    quartiles over the scenes.

    None if nothing was timed with the machine to itself.
    """
    # Times of one host with the machine to itself.
    shown = [sample for sample in said.samples if _points(sample)[0].size]
    if not shown:
        return None
    figure = _figure(4.0 + 0.16 * -(-len(shown) // 3))
    panel = figure.subplots()
    styles = report_styles((sample.method, sample.label) for sample in said.samples)
    for sample in shown:
        times, errors = _points(sample)
        (x0, x, x1), (y0, y, y1) = (
            np.quantile(each, (0.25, 0.5, 0.75), method="nearest") for each in (times, errors)
        )
        style = styles[sample.label] | {"linestyle": "none", "markersize": 8}
        panel.errorbar(
            x, y, xerr=[[x - x0], [x1 - x]], yerr=[[y - y0], [y1 - y]], elinewidth=0.8, **style
        )
    panel.set(xscale="log", yscale="log", xlabel=TIME, ylabel=ERROR)
    plain_times(panel)
    keys = {short(each.label, _LABEL): styles[each.label] for each in shown}
    legend_below(figure, panel, keys, columns=3)
    return figure


_DRAWN = {"sweep-errors": distribution, "sweep-medians": medians}


def drawn_figures(said: Summary) -> Iterator[tuple[str, "Figure"]]:
    """Yield the figures that the sweep has data for, with the names of their files and
    their places on the page.
    """
    for name, draw in _DRAWN.items():
        figure = draw(said)
        if figure is not None:
            yield name, figure


def _figure(height: float) -> "Figure":
    figure = new_figure(10.2, height)  # inches; the page scales it
    # Thousands of points would be megabytes as shapes, and are drawn as pixels: dots per inch.
    figure.set_dpi(160)
    return figure


def _errors(sample: Sample) -> Numbers:
    """Return the finite errors of a configuration, within what is drawn."""
    return np.clip(sample.errors[np.isfinite(sample.errors)], _EXACT, _WRONG)


def _points(sample: Sample) -> tuple[Numbers, Numbers]:
    """Return times and errors of the scenes that have both."""
    both = np.isfinite(sample.times) & np.isfinite(sample.errors)
    return sample.times[both], np.clip(sample.errors[both], _EXACT, _WRONG)


def _with_count(sample: Sample) -> str:
    """Return the name of a configuration, and how many of its scenes
    have no place in the figure.
    """
    # An error that is infinite has no place on the axis.
    away = {"refused": sample.count("refused"), "infinite": int(np.isinf(sample.errors).sum())}
    words = ", ".join(f"{count} {what}" for what, count in away.items() if count)
    return f"{short(sample.label, _LABEL)}{f' [{words}]' if words else ''}"
