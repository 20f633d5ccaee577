# SPDX-License-Identifier: BSD-3-Clause
"""The rays of the kit in C, Rust, JavaScript, GLSL and JSON.

The data of `rows.py` say which rays are judged, and by which tolerance; the templates are the
spelling of the languages.
"""

import json
import textwrap
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from airlight.realtime.export.text import kernel_text
from airlight.realtime.scene.phase import named_phase
from airlight.reference.storage.build import build
from airlight.reports.kit.rows import DOUBLE, Column, Group, Row

if TYPE_CHECKING:
    import jinja2

TEMPLATES = Path(__file__).parent / "templates"
DOUBLE_REASON = (
    "certified values have 15 digits or more and inputs are exact; a quadrature that has converged "
    "reaches 1e-12, and no fault of an equation is as small as 1e-9"
)
#: The largest tolerance of a row in a shader, whose one tolerance is that of all its rows.
_SHADER = 1e-4
#: Columns of comments in the files.
_WIDTH = 96

#: The files of languages by their templates.
FILES = (
    "airlight_kit.h",
    "example.c",
    "example_more.c",
    "airlight_kit.rs",
    "airlight_kit.mjs",
    "example.mjs",
    "airlight_kit.glsl",
)


def language_files(groups: Sequence[Group]) -> dict[str, str]:
    """Return the texts of the files of languages, by name."""
    environment = templates()
    # Every template gets the same data; GLSL has the exported kernel too.
    foot = next(group for group in groups if group.name == "foot")
    chosen = _shader(foot)
    told: dict[str, Any] = {
        "build": build().words,
        "groups": groups,
        "double": DOUBLE,
        "double_reason": DOUBLE_REASON,
        "words": _words(groups),
        "foot": foot,
        "kernel": kernel_text("exact", named_phase("hg"), "glsl"),
        "shader": chosen,
        "tolerance": max(row.single for row in chosen),
        "largest": _SHADER,
    }
    texts = {}
    for name in FILES:
        cells = _CELLS[name.rpartition(".")[2]]
        texts[name] = environment.get_template(f"{name}.j2").render(told, cells=cells)
    return texts | {"airlight_kit.json": _json(groups)}


def templates() -> "jinja2.Environment":
    """Return the templates of the kit."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters["wrap"] = _wrapped
    return environment


def _wrapped(words: str, prefix: str) -> str:
    """Return words as lines of a comment; the prefix begins all but the first."""
    return f"\n{prefix}".join(textwrap.wrap(words, _WIDTH - len(prefix)))


def _words(groups: Sequence[Group]) -> list[Column]:
    """Return the columns that hold words, each once, with all words that a group has for it."""
    found: dict[str, Column] = {}
    for column in (column for group in groups for column in group.columns if column.words):
        before = found[column.name].words if column.name in found else ()
        words = dict.fromkeys((*before, *column.words))
        found[column.name] = Column(column.name, column.meaning, tuple(words))
    return list(found.values())


def _cells(group: Group, row: Row, word: Callable[[str, str], str], infinity: str) -> list[str]:
    """Return the inputs of a row as literals of a language."""
    return [
        word(column.name, cell) if column.words else infinity if cell == "inf" else cell
        for column, cell in zip(group.columns, row.cells, strict=True)
    ]


def _in_c(group: Group, row: Row) -> list[str]:
    return _cells(group, row, lambda column, word: f"AL_{column}_{word}".upper(), "INFINITY")


def _in_rust(group: Group, row: Row) -> list[str]:
    literals = _cells(group, row, lambda column, word: f'"{word}"', "f64::INFINITY")
    # Rust has no whole numbers where a float is expected.
    return [f"{word}.0" if word.isdecimal() else word for word in literals]


def _in_javascript(group: Group, row: Row) -> list[str]:
    return _cells(group, row, lambda column, word: f'"{word}"', "Infinity")


def _shader(group: Group) -> list[Row]:
    """Return the rows of a shader: those of the exported kernel's one phase function, Henyey and
    Greenstein's, which is isotropic for g = 0.
    """
    return [
        row
        for row in group.rows
        if group.cells(row)["phase"] != "rayleigh" and row.single <= _SHADER
    ]


def _in_shader(group: Group, row: Row) -> list[str]:
    """Return the inputs of a row and its value for a shader, in float32; 3e38 is without an end."""
    cells = group.cells(row)
    names = ("foot", "height", "x0", "x1", "sigma_t", "g")
    numbers = [min(float(cells[name]), 3e38) for name in names]
    # Nine digits name a float32; a literal without a point would be an integer.
    words = [f"{number:.9g}" for number in (*numbers, float(row.value))]
    return [word if set(word) & set(".e") else f"{word}.0" for word in words]


_CELLS: dict[str, Callable[[Group, Row], list[str]]] = {
    "h": _in_c,
    "c": _in_c,
    "rs": _in_rust,
    "mjs": _in_javascript,
    "glsl": _in_shader,
}


def _json(groups: Sequence[Group]) -> str:
    """Return all rows as JSON, one a line; numbers are the words of the certified files."""
    parts = []
    for group in groups:
        head: dict[str, Any] = {
            "name": group.name,
            "value": group.value,
            "file": group.file,
            "choice": group.choice,
            "reason": group.reason,
            "columns": {column.name: column.meaning for column in group.columns},
        }
        rows = ",\n".join(f"   {_json_row(group, row)}" for row in group.rows)
        parts.append(f'  {json.dumps(head)[:-1]},\n  "rows": [\n{rows}\n  ]}}')
    about: dict[str, Any] = {
        "schema": "airlight-kit/1",
        "license": "MIT-0",
        "build": build().words,
        "double": DOUBLE,
        "double_reason": DOUBLE_REASON,
        "infinity": "null",
    }
    return f'{json.dumps(about)[:-1]}, "groups": [\n' + ",\n".join(parts) + "\n]}\n"


def _json_row(group: Group, row: Row) -> str:
    names = [column.name for column in group.columns]
    cells = _cells(group, row, lambda column, word: f'"{word}"', "null")
    inputs = ", ".join(f'"{name}": {cell}' for name, cell in zip(names, cells, strict=True))
    return f'{{"line": {row.line}, {inputs}, "value": {row.value}, "single": {row.single}}}'
