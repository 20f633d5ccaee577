# SPDX-License-Identifier: BSD-3-Clause
"""Files of the project, and pictures of the gallery, each with the command that makes it."""

import json
from functools import cache
from pathlib import Path
from typing import Any

from airlight.reports.tables.table import number

FOLDER = Path(__file__).resolve().parents[2] / "gallery"
_METHODS = ("sketch", "method", "error")  # in the order of a page


def source(path: str) -> str:
    """Return a file of the project as code, without its licence line."""
    text = (FOLDER.parents[1] / path).read_text(encoding="utf-8")
    language = {".py": "python"}.get(Path(path).suffix, Path(path).suffix[1:])
    lines = [line for line in text.splitlines() if "SPDX-License-Identifier" not in line]
    return "\n".join([f"```{language}", *lines, "```"])


@cache
def kept() -> dict[str, Any]:
    """Return the record of each picture, by name."""
    return json.loads((FOLDER / "gallery.json").read_text(encoding="utf-8"))["pictures"]


def strip() -> str:
    """Return the four scenes at the top of the first page."""
    words = "Four scenes lit through fog: hall, clutter, three-media, windows"
    return f"![{words}](gallery/{kept()['strip']['file']})"


def pictures(method: str) -> str:
    """Return the picture of a method, its error and its sketch, side by side, with captions."""
    # A method may lack a sketch or an error; without any picture the section has none.
    shown = {kind: _of_method(method, kind) for kind in _METHODS}
    present = {kind: entry for kind, entry in shown.items() if entry}
    if not present:
        return ""
    words = {
        "method": f"The scene {present['method']['scene']} by {method}",
        "error": f"The relative error of {method}",
        "sketch": f"How {method} works, seen from the side",
    }
    # A table puts pictures side by side in every viewer.
    cells = [f"![{words[kind]}](gallery/{entry['file']})" for kind, entry in present.items()]
    row, rule = " | ".join(cells), " | ".join(["---"] * len(cells))
    return f"| {row} |\n| {rule} |\n\n*{_caption(present)}*"


def frame_and_error(method: str) -> str:
    """Return a frame and its error side by side, as README shows them."""
    frame, error = (_of_method(method, kind) for kind in ("method", "error"))
    assert frame
    assert error
    cells = [
        f"![The scene {frame['scene']} by {method}](docs/gallery/{frame['file']})",
        f"![Its relative error against the reference](docs/gallery/{error['file']})",
    ]
    said = (
        f"*`{frame['scene']}` by `{method}`, and its error against the reference: blue is too "
        f"dark, red too bright. {error['frame_ms']:.0f} ms a frame of 480 x 360 pixels on two "
        "threads.*"
    )
    return f"| {' | '.join(cells)} |\n| --- | --- |\n\n{said}"


def _of_method(method: str, kind: str) -> dict[str, Any] | None:
    name = f"method-{method}" if kind == "method" else f"method-{method}-{kind}"
    return kept().get(name)


def _caption(present: dict[str, dict[str, Any]]) -> str:
    # The caption names what stands there, from left to right.
    rendered, error = present["method"], present.get("error")
    if error is None:
        return f"Rendered by `{rendered['command']}`."
    text = (
        f"what it renders, `{rendered['command']}`, and its error: blue where it is too dark, red "
        "where it is too "
        f"bright, white below 1e-4 of the reference, full colour from 1 on; relative RMSE "
        f"{number(error['relative_rmse'], 2)} at {error['frame_ms']:.0f} ms a frame of 480 x 360 "
        "pixels, on two "
        "threads of a processor that also did other work."
    )
    if "sketch" not in present:
        return text[0].upper() + text[1:]
    how = (
        "How it works, in `sphere-spot` seen from the side: some rays of the camera, what is lit in "
        "yellow."
    )
    return f"{how} Next to it: {text}"


def scene_picture(name: str) -> str:
    """Return the picture of a scene with its command; nothing where it has none."""
    entry = kept().get(f"scene-{name}")
    return (
        ""
        if entry is None
        else f"![The scene {name}](gallery/{entry['file']})\n\n```sh\n{entry['command']}\n```\n"
    )
