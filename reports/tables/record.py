# SPDX-License-Identifier: BSD-3-Clause
"""The results of public functions, with their tables, words and data.

A terminal, a notebook, Markdown and JSON show the same result; `reports.commands.main` prints it,
and ends with the status 1 where it did not pass.
"""

import base64
import os
import shutil
import sys
from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

from airlight.reports.tables.drawing import html, sentence_in_html, sentence_in_text, text
from airlight.reports.tables.table import Table


def colours_wanted() -> bool:
    """Return whether colours and bold letters may be printed: NO_COLOR is not set, or
    empty (https://no-color.org).
    """
    return not os.environ.get("NO_COLOR")


def terminal_width() -> int | None:
    """Return how wide the terminal is that is printed to [characters]; None where it is none."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def print_json(data: Any) -> None:
    """Print data as JSON; a number that is not finite is refused: what has none is None."""
    import json

    try:
        # JSON has no NaN: other programs could not read it.
        text = json.dumps(data, indent=2, ensure_ascii=False, allow_nan=False)
    except ValueError:
        from airlight.errors import InputError

        raise InputError(
            "a result is not finite, and is not printed; a number of the input may be too large"
        ) from None
    try:
        # An output in ASCII gets escapes in place of the characters that it lacks.
        text.encode(sys.stdout.encoding or "utf-8")
    except UnicodeEncodeError:
        text = json.dumps(data, indent=2, allow_nan=False)
    print(text)


SCHEMA = 1  #: of what commands print as JSON, see `Result.enveloped`
#: Pictures narrower than this are enlarged by a whole factor, so that single pixels
#: can be seen [CSS pixels].
_NARROW = 240


class Result:
    """The result of a function: what a terminal, a notebook and JSON show of it."""

    @property
    @abstractmethod
    def title(self) -> str:
        """Title of the output."""

    @property
    def claims(self) -> Sequence[str]:
        """Sentences that stand above the tables."""
        return ()

    @property
    def tables(self) -> Sequence[Table]:
        """Its tables."""
        return ()

    @property
    @abstractmethod
    def lines(self) -> Sequence[str]:
        """Sentences that stand below the tables."""

    @property
    def scene_name(self) -> str | None:
        """The scene that it is about; None where it is about none, or about several."""
        return None

    @property
    def notes(self) -> Sequence[str]:
        """Remarks on the scene and on how it was read."""
        return ()

    @property
    def faults(self) -> Sequence[str]:
        """Faults, for the error stream."""
        return ()

    @property
    def failures(self) -> Sequence[str]:
        """All for which the result does not pass, the faults among them."""
        return self.faults

    @property
    def passed(self) -> bool:
        """Whether all that was checked is as it should be."""
        return not self.failures

    @property
    def status(self) -> int:
        """The exit status of a command that ends with it."""
        return 0 if self.passed else 1

    def to_dict(self) -> Any:
        """Return its data, as JSON has them: the fields of the record by default."""
        from airlight.validation.columns import plain

        return plain(self)

    def enveloped(self, command: str, **more: Any) -> dict[str, Any]:
        """Return the data that a command prints as JSON: `result` is of the command, and all else
        is the same for every command.
        """
        from airlight.reference.storage.build import build

        built, data = build(), self.to_dict()
        return {
            "schema": SCHEMA,
            "command": command,
            "airlight": built.airlight,
            "commit": built.commit,
            "scene": self.scene_name,
            "result": {**data, **more} if more else data,
            "notes": list(self.notes),
            "failures": list(self.failures),
        }

    def text(self, *, width: int | None = None, styled: bool = False) -> str:
        """Return the claims, tables and lines for a terminal."""
        # Claims above, tables, then lines, with an empty line between tables and lines.
        claims = "".join(f"- {sentence_in_text(claim)}\n" for claim in self.claims)
        drawn = [text(table, width=width, styled=styled) for table in self.tables]
        lines = [*([""] if drawn and self.lines else []), *self.lines]
        return claims + "".join(drawn) + "".join(f"{line}\n" for line in lines)

    def _repr_html_(self) -> str:
        return block(self.title, bullets(self.claims), *map(html, self.tables), bullets(self.lines))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.title})"


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OfScene(Result):
    """A result that is about one scene."""

    scene: str  #: name of the scene

    @property
    def scene_name(self) -> str:
        """The scene."""
        return self.scene


# Pieces of HTML for notebooks, without scripts.


def block(title: str, *parts: str) -> str:
    """Return a titled block; the title is plain text, the parts are HTML."""
    return f'<div class="airlight"><p><strong>{escape(title)}</strong></p>{"".join(parts)}</div>'


def paragraph(words: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(words)}</p>"


def bullets(items: Sequence[str]) -> str:
    """Return a list of sentences, in which what stands in backticks is
    code; nothing for no items.
    """
    inside = "".join(f"<li>{sentence_in_html(item)}</li>" for item in items)
    return f"<ul>{inside}</ul>" if items else ""


def picture(png: bytes, width: int, *, alt: str, caption: str) -> str:
    """Return a PNG file of that width [pixels] as a figure that carries it inside."""
    # A whole factor, so that every pixel stays a square of one size.
    times = max(1, -(-_NARROW // width))
    style = "width:100%;height:auto" + (";image-rendering:pixelated" if times > 1 else "")
    source = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
    return (
        f'<figure style="display:inline-block;width:{times * width}px;max-width:100%;margin:0 1em '
        "0.5em 0;"
        'vertical-align:top">'
        f'<img src="{source}" alt="{escape(alt)}" style="{style}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )
