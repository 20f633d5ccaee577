# SPDX-License-Identifier: BSD-3-Clause
"""The figures of engines that others wrote: of the kept captures, and of changed shaders."""

import json
from dataclasses import replace
from functools import cache
from typing import Any

from airlight.reports.engines.record import FILE, JUDGED, STATUS_WORDS, Engines, read_engines
from airlight.reports.engines.tables import (
    EXPLANATION,
    engine_sentences,
    engines_table,
    percent_words,
)
from airlight.reports.tables.drawing import markdown
from parts.listed import table
from parts.measured import DATA


@cache
def _judged() -> Engines:
    """Return the report on the captures that the repository keeps."""
    return read_engines(DATA / "captures" / FILE)


def engines_strip(folder: str) -> str:
    """Return the strip of engines, for a page from which the gallery lies in `folder`."""
    data = _judged()
    cells = data.of_scene(data.shown_best)
    names = ", ".join(cell.captured.engine for cell in cells if cell.captured)
    return (
        f"![{data.shown_best} by the reference and by {names}]({folder}/engines.jpg)\n\n"
        f"*`{data.shown_best}` by the reference and by {names}, how far each is off physics, and its "
        f"error against its own equation. {_made(data)}*"
    )


def engines_judged() -> str:
    """Return a sentence on each engine, and the errors over blocks."""
    data = _judged()
    shown = engines_table(data)
    rows = tuple(row for row in shown.rows if not row.reason)
    sentences = "\n".join(f"- {words}" for words in engine_sentences(data))
    devices = sorted({cell.captured.device for cell in data.cells if cell.captured} - {""})
    return "\n\n".join(
        [
            sentences,
            f"{EXPLANATION} {_made(data)} Drawn on a processor by {'; '.join(devices)}.",
            markdown(replace(shown, title="", explanation="", rows=rows)).strip(),
            "No image:",
            "\n".join(f"- {_without(data, engine)}" for engine in data.engines),
        ]
    )


def engine_headlines() -> str:
    """Return what the diagnosis said of each image against physics."""
    data = _judged()
    rows = [
        [f"`{cell.scene}`", data.title_of(cell.engine), cell.headline.replace("|", "\\|")]
        for cell in data.cells
        if cell.headline
    ]
    return table(("scene", "engine", "the diagnosis"), rows, words=3)


def engine_figures(engine: str) -> str:
    """Return the errors of one engine, and why it has no image of a scene."""
    data = _judged()
    rows = [
        [f"`{cell.scene}`", layer.layer, *(percent_words(each) for each in layer.blocks.values())]
        for cell in data.cells
        if cell.engine == engine
        for layer in cell.layers
    ]
    head = ("scene", "layer", "equation against physics", "image against equation", "together")
    said = f"{data.title_of(engine)}, errors over blocks of 8 x 8 pixels. {_made(data)}"
    return f"{said}\n\n{table(head, rows, words=2)}\nNo image: {_without(data, engine)}"


def _without(data: Engines, engine: str) -> str:
    """Return the scenes of which an engine has no image, by the reason."""
    reasons: dict[str, list[str]] = {}
    for cell in data.cells:
        if cell.engine == engine and cell.status != JUDGED:
            words = f"{STATUS_WORDS[cell.status]}: {cell.reason}"
            reasons.setdefault(words, []).append(f"`{cell.scene}`")
    said = [f"{', '.join(scenes)} ({words})" for words, scenes in reasons.items()]
    return f"{data.title_of(engine)}, {', '.join(said) or 'none'}."


def _made(data: Engines) -> str:
    """Return the size, the date and the commit of the kept report."""
    width, height = data.scenes[0].size
    return f"{width} x {height} pixels, {data.created[:10]}, airlight {data.environment.airlight}."


def finding(name: str) -> str:
    """Return the figures of a finding on an engine, and the pictures."""
    record = json.loads((DATA / "engine-findings.json").read_text("utf-8"))
    found, (width, height) = record["findings"][name], record["size"]
    head = tuple(_HEADS.get(key, key) for key in found["rows"][0])
    signed = name == "eevee"  # a bias, and no ratio

    def cell(key: str, value: float) -> str:
        if key in ("lights", "intensity", "slices"):
            return f"{value:g}"
        return f"{100 * value:+.2f} %" if signed else f"{value:.4f}"

    rows = [[cell(key, value) for key, value in row.items()] for row in found["rows"]]
    return (
        f"{table(head, rows)}\n*`{found['scene']}`, {width} x {height} pixels, {found['engine']} "
        f"{found['version']}, {found['measured'][:10]}, on a processor ({found['device']}).*"
    )


_HEADS = {
    "lights": "lights, times",
    "mean": "mean of the airlight over lights, times that of the first row",
    "airlight": "airlight, times that of intensity 1",
    "R": "bias, R",
    "G": "bias, G",
    "B": "bias, B",
}


def changed_shaders() -> str:
    """Return what the comparison said of the base, and the diagnosis of each change."""
    record: dict[str, Any] = json.loads((DATA / "changed-shaders.json").read_text("utf-8"))
    base, changes = record["base"], record["changes"]
    # A change that is no fault of physics must get no name of one.
    faults = [row for row in changes if row["injected"] not in ("right", "unexplained")]
    width, height = record["size"]
    said = (
        f"{sum(row['right'] for row in faults)} of {len(faults)} changes are named first, and the "
        f"base is right in {sum(row['right'] for row in base)} of {len(base)} scenes "
        f"({record['engine']} {record['version']}, {width} x {height} pixels, {record['measured']}, "
        "`python docs/tools/changed_shaders.py`)."
    )
    rows = [
        ["the base", row["scene"], "`right`", _named(row), percent_words(row["blocks"]), ""]
        for row in base
    ]
    rows += [
        [
            row["words"],
            row["scene"],
            f"`{row['injected']}`",
            f"`{row['first']}`" if row["right"] else f"**`{row['first']}`**",
            percent_words(row["residual"]),
            percent_words(row["left"]),
        ]
        for row in changes
    ]
    head = ("change", "scene", "expected", "named first", "error", "left")
    return (
        f"{said}\n\n{table(head, rows, words=4)}\n*Error* is that over blocks for the base and the "
        "mean relative one for changes, *left* that without the named fault. A wrong answer is bold."
    )


def _named(row: dict[str, Any]) -> str:
    return "`right`" if row["right"] else f"**{row['verdict']}**"
