# SPDX-License-Identifier: BSD-3-Clause
"""The page of a report on engines, one self-contained HTML file, and the strip of its pictures."""

import base64
import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from airlight.reports.engines.record import JUDGED, STATUS_WORDS, Cell, Engines, EngineScene
from airlight.reports.engines.tables import (
    engine_sentences,
    engines_table,
    numbers_table,
    percent_words,
)
from airlight.reports.page.filters import drawn, facts
from airlight.reports.page.render import page_environment, template_text
from airlight.reports.plotting.figure import file_bytes, picture_grid

_PICTURES = ("picture", "error", "algorithm")  #: of a cell, in the order of the page


def render_engines(data: Engines, folder: Path) -> str:
    """Return the HTML page of a report on engines whose files lie in a folder."""
    environment = page_environment()
    environment.globals |= {
        "engines_table": drawn(engines_table),
        "numbers_table": drawn(numbers_table),
        "facts_table": drawn(facts),
    }
    environment.filters["error"] = percent_words
    return environment.get_template("engines.html.j2").render(
        data=data,
        claims=engine_sentences(data),
        scenes=[_scene(data, scene, folder) for scene in data.scenes],
        devices=sorted({cell.captured.device for cell in data.cells if cell.captured} - {""}),
        css=template_text("report.css"),
    )


def _scene(data: Engines, scene: EngineScene, folder: Path) -> dict[str, Any]:
    """Return the values of the template of a scene: its columns, an engine each."""
    return {
        "record": scene,
        "picture": _inline(folder, scene.files, "picture"),
        "columns": [
            _column(data, cell, folder)
            for cell in data.of_scene(scene.name)
            if cell.status == JUDGED
        ],
        "without": [
            f"{data.title_of(cell.engine)}: {STATUS_WORDS[cell.status]}. {cell.reason}"
            for cell in data.of_scene(scene.name)
            if cell.status != JUDGED
        ],
    }


def _column(data: Engines, cell: Cell, folder: Path) -> dict[str, Any]:
    """Return the values of the template of a column."""
    airlight = cell.layer("airlight")
    errors = airlight.errors if airlight else None
    return {
        "cell": cell,
        "title": data.title_of(cell.engine),
        "pictures": {kind: _inline(folder, cell.files, kind) for kind in _PICTURES},
        # The settings in full stand behind a click.
        "settings": ", ".join(f"{key}={value}" for key, value in cell.captured.settings.items())
        if cell.captured
        else "",
        "equation": errors.terms.replace(",", ", ") if errors else "",
        "alone": [each for each in errors.terms_alone if each.mean and abs(each.mean) > 1e-4]
        if errors
        else [],
        "words": errors.words if errors else "",
    }


def _inline(folder: Path, files: Mapping[str, str], kind: str) -> str:
    """Return a picture as an address that holds it; empty where there is none."""
    if kind not in files:
        return ""
    data = (folder / files[kind]).read_bytes()
    return f"data:image/png;base64,{base64.b64encode(data).decode('ascii')}"


def strip_bytes(data: Engines, folder: Path) -> bytes:
    """Return a PNG file with the reference and the engines side by side, and their errors below, in
    the scene of which most layers were judged; empty where none was.
    """
    name = data.shown_best
    scene = next((each for each in data.scenes if each.name == name and each.files), None)
    if scene is None:
        return b""
    cells = [cell for cell in data.of_scene(name) if cell.status == JUDGED]
    # The upper row has images, the lower one errors against physics and what is left of them.
    titles = [f"{cell.captured.engine}\n{_words(cell, 'total')}" for cell in cells if cell.captured]
    upper = [(f"the reference\n{name}", _read(folder, scene.files["picture"]))]
    upper += [(title, _read(folder, cell.files["picture"])) for title, cell in zip(titles, cells)]
    lower = [("against its\nown equation:", _blank(upper[0][1]))]
    lower += [
        (_words(cell, "algorithm"), _read(folder, cell.files["algorithm"]))
        if cell.told
        else ("not known", lower[0][1])
        for cell in cells
    ]
    figure = picture_grid([*upper, *lower], "double", across=len(upper))
    return file_bytes(figure, ".png", dpi=200)


def _words(cell: Cell, part: str) -> str:
    layer = cell.layer("airlight")
    return f"{percent_words(layer.blocks[part] if layer else None)} off"


def _read(folder: Path, name: str) -> Any:
    import numpy as np
    from PIL import Image

    return np.asarray(Image.open(io.BytesIO((folder / name).read_bytes())).convert("RGB"))


def _blank(picture: Any) -> Any:
    import numpy as np

    return np.full_like(picture, 255)
