# SPDX-License-Identifier: BSD-3-Clause
"""The files that say what a sweep says, made from its Parquet alone: its page, its figures and its claims.

The page is one HTML file that needs no network.
"""

import base64
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from reference.storage.files import ensure_folder, write_bytes, write_text
from reports import __version__
from reports.page.chart import svg_text
from reports.page.filters import drawn, facts, percent, unbroken
from reports.page.render import page_environment, template_text
from reports.plotting.figure import file_bytes
from reports.sweep import tables
from reports.sweep.claims import LEAST, NAMED, SAME, TARGETS, property_words
from reports.sweep.figures import drawn as drawn_figures
from reports.sweep.samples import read_sweep
from reports.sweep.summary import Summary, sound_words, summary_of
from validation.columns import plain

PAGE, CLAIMS, FIGURES = "sweep.html", "sweep.json", "figures"  #: in the folder of a sweep
PICTURES = 400  #: most on a page, of some 20 kB each

_TABLES = ("errors", "speed", "correlations", "refusals", "checks", "faults")


def write_sweep(source: Path, target: Path | None = None) -> tuple[Summary, Path]:
    """Write what a sweep says, from its Parquet alone; return that and the path of its page.

    `source` is the folder of a sweep or its Parquet, `target` the folder of the files, the one with the Parquet by
    default.
    """
    said = summary_of(read_sweep(source))
    folder = ensure_folder(said.sweep.path.parent if target is None else target)
    charts = {}
    for name, figure in drawn_figures(said):
        charts[name] = svg_text(figure, name)
        write_text(folder / FIGURES / f"{name}.svg", charts[name])
        write_bytes(folder / FIGURES / f"{name}.pdf", file_bytes(figure, ".pdf", dpi=320))
    write_text(folder / CLAIMS, json.dumps(plain(said), indent=1, ensure_ascii=False, allow_nan=False) + "\n")
    write_text(folder / PAGE, render_sweep(said, charts))
    return said, folder / PAGE


def render_sweep(said: Summary, charts: Mapping[str, str]) -> str:
    """Return the HTML page of a sweep, with its figures as SVG by name, and pictures of the worst scenes."""
    from markupsafe import Markup

    environment = page_environment()
    environment.filters["error"] = error_words
    environment.globals |= {f"{name}_table": drawn(getattr(tables, f"{name}_table")) for name in _TABLES}
    environment.globals |= {"facts_table": drawn(facts), "property_words": property_words}
    template = environment.get_template("sweep.html.j2")
    worst = _worst_keys(said)
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
        "version": __version__,
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
    ranks = max((len(several) for several in said.worst.values()), default=0)
    return [several[rank].key for rank in range(ranks) for several in said.worst.values() if rank < len(several)]


def _pictures(said: Summary, keys: list[str]) -> dict[str, str]:
    """Return pictures of rows as addresses that hold them, by key."""
    kept: dict[str, Any] = said.sweep.pictures(keys)
    return {key: f"data:image/webp;base64,{base64.b64encode(kept[key]).decode()}" for key in keys if key in kept}
