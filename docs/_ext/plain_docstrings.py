# SPDX-License-Identifier: BSD-3-Clause
"""Docstrings are plain text with formulas: what reStructuredText would take for markup is shown as it stands."""

import re

from sphinx.application import Sphinx

_CODE = re.compile(r"``.+?``|`[^`]+`")
_EMPHASIS = re.compile(r"(?<![\w*])\*(?=[^\s*])[^*]*[^\s*]\*(?![\w*])")
_ATTRIBUTES = ("attribute", "data", "property")
_COLON = "\0"  # stands for a colon that napoleon must not see
_ITEM = re.compile(r"\s*[*-] \S")
_RAISES = re.compile(r"^:raises InputError:")


def _indent(line: str) -> int:
    return len(line) - len(line.lstrip())


def formulas_as_blocks(lines: list[str]) -> list[str]:
    """Return lines in which text that is set in by four or more after a blank line is a literal block."""
    marked: list[str] = []
    inside: int | None = None  # least indentation of the open block
    before = 0  # indentation of the last line that was not blank
    for number, line in enumerate(lines):
        if not line.strip():
            marked.append(line)
            continue
        if inside is not None and _indent(line) < inside:
            inside = None
        elif inside is None and number and not lines[number - 1].strip() and _indent(line) >= before + 4:
            if not marked or not any(earlier.rstrip().endswith("::") for earlier in marked[-2:]):
                marked += [" " * before + "::", ""]
            inside = _indent(line)
        marked.append(line)
        before = _indent(line) if inside is None else before
    return marked


def hanging_lists(lines: list[str]) -> list[str]:
    """Return lines in which an item's further lines are set in under its text."""
    indented: list[str] = []
    marker: int | None = None
    for line in lines:
        item = _ITEM.match(line)
        if item:
            marker = _indent(line)
        elif marker is not None and (not line.strip() or _indent(line) != marker):
            marker = None if not line.strip() else marker
        elif marker is not None:
            line = "  " + line
        indented.append(line)
    return indented


def escaped(paragraph: str) -> str:
    """Return a paragraph of prose whose bars and lone asterisks mean themselves."""
    spans = sorted([match.span() for pattern in (_CODE, _EMPHASIS) for match in pattern.finditer(paragraph)])
    pieces, at = [], 0
    for begin, end in spans:
        if begin < at:
            continue
        pieces += [_escape(paragraph[at:begin]), paragraph[begin:end]]
        at = end
    return "".join([*pieces, _escape(paragraph[at:])])


def _escape(text: str) -> str:
    text = re.sub(r"([*|])(?=\S)", r"\\\1", text)
    return re.sub(r"(?<=\w)_(?!\w)", r"\\_", text)  # else a link


def _prose(lines: list[str]) -> list[str]:
    """Escape every paragraph that is not in a literal block."""
    escaped_lines: list[str] = []
    paragraph: list[str] = []
    inside: int | None = None
    marked = False
    for line in [*lines, ""]:
        if inside is not None and line.strip() and _indent(line) < inside:
            inside = None
        if inside is None and marked and line.strip():
            inside, marked = _indent(line), False
        if inside is None and line.strip():
            paragraph.append(line)
            continue
        if paragraph:
            marked = paragraph[-1].rstrip().endswith("::")
            escaped_lines += escaped("\n".join(paragraph)).split("\n")
            paragraph = []
        escaped_lines.append(line)
    return escaped_lines


def before_napoleon(app: Sphinx, what: str, name: str, obj, options, lines: list[str]) -> None:
    """Make formulas blocks; an attribute's comment has no type before a colon, as napoleon would have it."""
    lines[:] = _prose(formulas_as_blocks(hanging_lists(lines)))
    if what in _ATTRIBUTES:
        lines[:] = [line.replace(":", _COLON) for line in lines]


def after_napoleon(app: Sphinx, what: str, name: str, obj, options, lines: list[str]) -> None:
    """Say which of the two classes of the user's mistakes is meant."""
    owner = "realtime" if name.startswith("realtime.") else "analytic"
    lines[:] = [_RAISES.sub(f":raises ~{owner}.errors.InputError:", line.replace(_COLON, ":")) for line in lines]


def setup(app: Sphinx) -> dict[str, bool]:
    """Give Sphinx the two steps, one before and one after those of `sphinx.ext.napoleon`."""
    app.connect("autodoc-process-docstring", before_napoleon, priority=100)
    app.connect("autodoc-process-docstring", after_napoleon, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
