# SPDX-License-Identifier: BSD-3-Clause
"""The tokens of a pbrt file, each with the line where it begins."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from airlight.errors import InputError

# A list of numbers is one token: meshes have millions of them.
_TOKEN = re.compile(
    r"""(?P<space>\s+) | (?P<comment>\#[^\n]*) | "(?P<string>(?:[^"\\\n]|\\.)*)"
    | \[(?P<list>[^\]"\#\[]*)\] | (?P<bracket>[\[\]]) | (?P<word>[^\s"\[\]\#]+)""",
    re.VERBOSE,
)


@dataclass(frozen=True)
class Place:
    """A line of a file."""

    file: Path
    line: int

    def __str__(self) -> str:
        return f"{self.file}, line {self.line}"


@dataclass(frozen=True)
class Token:
    """A token of a file."""

    kind: str  #: "string", "list" (of unquoted words), "bracket" or "word"
    text: str  #: without quotes and without the brackets of a list
    at: Place


def tokens(path: Path) -> Iterator[Token]:
    """Yield the tokens of a file; raises InputError for a file that is no text."""
    data = path.read_bytes()
    if b"\0" in data[:4096]:
        raise InputError(
            f"scene {path}: the file is no text; expected a scene of pbrt: unpack it, or give the "
            "scene itself"
        )
    text, place, line = data.decode("utf-8", errors="replace").removeprefix("\ufeff"), 0, 1
    while place < len(text):
        match = _TOKEN.match(text, place)
        if match is None:
            raise InputError(
                f"{path}, line {line}: a string has no end; expected a double quote on its line"
            )
        kind = match.lastgroup
        if kind not in ("space", "comment", None):
            yield Token(kind, match[kind], Place(path, line))
        line += match[0].count("\n")
        place = match.end()
