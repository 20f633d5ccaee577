# SPDX-License-Identifier: BSD-3-Clause
"""How numbers are written on the page of a report, and the sentences that the page makes of its data."""

import re
from collections.abc import Callable, Mapping
from typing import Any

from reports.data.records import Report
from reports.tables.drawing import DASH, sentence_in_html, typeset
from reports.tables.table import number as plain_number

#: Kinds of claims as the page names them.
KINDS = {
    "reference": "Reference",
    "left-out": "Left out",
    "image": "Engine",
    "failed": "Failed",
    "published": "Published peer",
    "refused": "Refused",
    "growth": "As the work grows",
    "not-measured": "Not measured",
}
#: By whether a claim is good: a mark, and its words for screen readers.
MARKS = {True: ("✓", "holds"), False: ("✗", "does not hold"), None: ("·", "")}


def number(value: float | None, digits: int = 3) -> str:
    """Return a number with some significant digits, an en dash for none."""
    return typeset(plain_number(value, digits))


def percent(value: float | None, digits: int = 3) -> str:
    """Return a relative value in per cent."""
    return DASH if value is None else f"{number(100 * value, digits)} %"


def words(value: Any) -> str:
    """Return any value of report.json in a line."""
    if value is None:
        return DASH
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:g}"
    if isinstance(value, Mapping):
        return ", ".join(f"{key} {words(entry)}" for key, entry in value.items())
    if isinstance(value, list | tuple):
        size = len(value) == 2 and all(isinstance(entry, int) for entry in value)  # width and height
        return (" \N{MULTIPLICATION SIGN} " if size else ", ").join(words(entry) for entry in value) or DASH
    return str(value)


def sentence(text: str) -> str:
    """Return a text with a capital at its beginning."""
    return text[:1].upper() + text[1:]


def unbroken(text: str) -> str:
    """Return a text in which no line ends before a unit."""
    return re.sub(r"(?<=\d) (?=%|ms\b|frames/s)", "\N{NO-BREAK SPACE}", text)


def with_code(text: str) -> str:
    """Return a sentence as HTML, in which what stands in backticks is code."""
    from markupsafe import Markup

    return Markup(sentence_in_html(text))


def kept_words(report: Report) -> str:
    """Return how many results of a report are cached from earlier runs; empty where none was."""
    if not report.cached:
        return ""
    whole = report.cached + report.computed
    return f"{report.cached} of {whole} results are cached from earlier runs on this machine with the same code"


def viewer_words(index: Mapping[str, Any]) -> str:
    """Return how many pixels the images of a scene have on the page, and their exposure."""
    stride, (width, height) = index["stride"], index["full"]
    size = f"{width} \N{MULTIPLICATION SIGN} {height} pixels"
    if stride > 1:
        size += f", of which the page holds one in {stride} along both axes to stay small; the files have all"
    exposure = f"Exposure {number(index['exposure'])}\N{MULTIPLICATION SIGN} at 0 stops."
    return f"{size}. {exposure}"


FILTERS: Mapping[str, Callable[..., str]] = {
    "number": number,
    "percent": percent,
    "words": words,
    "sentence": sentence,
    "unbroken": unbroken,
    "with_code": with_code,
}
