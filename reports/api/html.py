# SPDX-License-Identifier: BSD-3-Clause
"""Pieces of HTML for results in a notebook: tables and pictures, without scripts, in the colours of the page."""

import base64
from collections.abc import Sequence
from html import escape

from reports.tables.drawing import html, sentence_in_html
from reports.tables.table import Column
from reports.tables.table import table as make_table

#: Pictures narrower than this are enlarged by a whole factor, so that single pixels can be seen [CSS pixels].
_NARROW = 240


def block(title: str, *parts: str) -> str:
    """Return a titled block; the title is plain text, the parts are HTML."""
    return f'<div class="airlight"><p><strong>{escape(title)}</strong></p>{"".join(parts)}</div>'


def paragraph(text: str) -> str:
    """Return a paragraph of plain text."""
    return f"<p>{escape(text)}</p>"


def bullets(items: Sequence[str]) -> str:
    """Return a list of sentences, in which what stands in backticks is code; nothing for no items."""
    inside = "".join(f"<li>{sentence_in_html(item)}</li>" for item in items)
    return f"<ul>{inside}</ul>" if items else ""


def table(rows: Sequence[Sequence[str]]) -> str:
    """Return a table of names and their values."""
    columns = (Column("name", "", words=True), Column("value", "", words=True))
    return html(make_table("", columns, rows))


def picture(png: bytes, width: int, *, alt: str, caption: str) -> str:
    """Return a PNG file of that width [pixels] as a figure that carries it inside."""
    times = max(1, -(-_NARROW // width))
    style = "width:100%;height:auto" + (";image-rendering:pixelated" if times > 1 else "")
    source = "data:image/png;base64," + base64.b64encode(png).decode("ascii")
    return (
        f'<figure style="display:inline-block;width:{times * width}px;max-width:100%;margin:0 1em 0.5em 0;'
        'vertical-align:top">'
        f'<img src="{source}" alt="{escape(alt)}" style="{style}">'
        f"<figcaption>{escape(caption)}</figcaption></figure>"
    )


def link(target: str, text: str) -> str:
    """Return a link."""
    return f'<a href="{escape(target)}">{escape(text)}</a>'
