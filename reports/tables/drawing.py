# SPDX-License-Identifier: BSD-3-Clause
r"""One table drawn five ways: `text` for a terminal, `markdown`, `html`, `latex`, `csv`.

All five show the same cells. Where a cell has no room for quartiles they are a column of their own (text, Markdown) or
two (CSV). Why a row ends early, and remarks on it, stand in the row (HTML, LaTeX), below the table (text, Markdown) or
in columns at the end (CSV).

LaTeX needs ``\usepackage{booktabs,siunitx}`` in the preamble: numbers are ``\num{...}``, so that siunitx sets powers of
ten, signs and decimal marks as the rest of the paper has them.
"""

import csv as comma_separated
import io
import math
import re
from collections.abc import Callable, Iterator, Sequence
from html import escape as html_escape

from reports.tables.table import (
    Column,
    Interval,
    Measured,
    Name,
    Row,
    Table,
    Value,
    Verdict,
    digits_of,
    heading,
    is_number,
    with_spread,
)

#: What LaTeX needs before the document begins.
PREAMBLE = r"\usepackage{booktabs,siunitx}"

DASH = "\N{EN DASH}"
_VERDICTS = {True: "yes", False: "NO", None: "not decided in time"}
_CLASSES = {True: "good", False: "bad", None: "quiet"}
_SUPERSCRIPTS = str.maketrans("-+0123456789", "⁻⁺⁰¹²³⁴⁵⁶⁷⁸⁹")
_LATEX = str.maketrans(
    {
        "\\": r"\textbackslash{}",
        "{": r"\{",
        "}": r"\}",
        "$": r"\$",
        "&": r"\&",
        "%": r"\%",
        "#": r"\#",
        "_": r"\_",
        "~": r"\textasciitilde{}",
        "^": r"\textasciicircum{}",
        "<": r"\textless{}",
        ">": r"\textgreater{}",
        '"': r"\textquotedbl{}",
        "\u00d7": r"$\times$",
        "\u00b1": r"$\pm$",
        "\u03b5": r"$\varepsilon$",
        "\u2013": "--",
        "\n": " ",
    }
)


def text(table: Table, *, width: int | None = None) -> str:
    """Return a table for a terminal.

    Parameters
    ----------
    table
        What to draw.
    width
        Of the terminal [characters], for which headings are bold and cells folded. Plain by default, and as wide as the
        table needs.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table as Grid

    grid = Grid(box=box.SIMPLE_HEAD, pad_edge=False)
    for column, _ in _spread_out(table):
        grid.add_column(heading(column), justify="left" if column.words else "right", overflow="fold")
    for cells in _plain_rows(table):
        grid.add_row(*cells)
    drawn = io.StringIO()
    known = width is not None
    Console(file=drawn, highlight=False, markup=False, width=width or 10_000, force_terminal=known).print(grid)
    lines = [line.rstrip() for line in drawn.getvalue().splitlines()]
    return "\n".join([*([table.title] if table.title else []), *lines, *_below(table)]) + "\n"


def markdown(table: Table) -> str:
    """Return a table as Markdown of GitHub's kind, its title in bold above it."""
    lines = [f"**{_in_markdown(table.title)}**", ""] if table.title else []
    columns = [column for column, _ in _spread_out(table)]
    lines.append(_bar(_in_markdown(heading(column)) for column in columns))
    lines.append(_bar("---" if column.words else "---:" for column in columns))
    lines += [_bar(cells) for cells in _plain_rows(table, _in_markdown)]
    below = _below(table)
    lines += ["", *(f"- {_in_markdown(line)}" for line in below)] if below else []
    return "\n".join(lines) + "\n"


def html(table: Table) -> str:
    """Return a table as HTML, in a box that scrolls sideways; shares are in per cent."""
    head = "".join(f'<th scope="col"{_layout(column)}>{_escaped(heading(column))}</th>' for column in table.columns)
    named = f' role="group" aria-label="{_escaped(table.title)}"' if table.title else ""
    lines = [f'<div class="scroll"{named}><table>']
    caption = ". ".join(part for part in (table.title, table.explanation) if part)
    lines += [f"<caption>{_escaped(caption)}</caption>"] if caption else []
    lines += [f"<thead><tr>{head}</tr></thead>"] if any(column.heading for column in table.columns) else []
    lines.append("<tbody>")
    for row in table.rows:
        shown, left = _until_reason(row, table.columns)
        cells = [_html_cell(row, column, first=not place) for place, column in enumerate(shown)]
        if left:
            cells.append(f'<td class="words" colspan="{left}">{_escaped(row.reason)}</td>')
        marked = ' class="published"' if row.published else ""
        lines.append(f"<tr{marked}>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody></table></div>"]) + "\n"


def latex(tables: Sequence[Table], *, comment: Sequence[str] = ()) -> str:
    r"""Return tables with the same columns as one `tabular`, each under its title if there are several.

    Parameters
    ----------
    tables
        What to draw.
    comment
        Lines of comment at the top, after the one that says what the preamble needs.
    """
    columns = tables[0].columns
    lines = [f"% {line}" for line in (f"Needs {PREAMBLE}.", *comment)]
    lines += [r"\begin{tabular}{" + "".join("l" if column.words else "r" for column in columns) + "}", r"\toprule"]
    lines.append(_line(_in_latex(column.heading) for column in columns))
    if any(column.unit for column in columns):
        lines.append(_line(f"[{_in_latex(column.unit)}]" if column.unit else "" for column in columns))
    lines.append(r"\midrule")
    for place, table in enumerate(tables):
        if len(tables) > 1 or table.explanation:
            lines += [r"\addlinespace"] if place else []
            about = re.sub(r"\b([\d.]+e-?\d+)\b", lambda found: _num(found[1]), _in_latex(table.explanation))
            about = f", {about}" if about else ""
            title = rf"\textit{{{_in_latex(table.title)}}}{about}"
            lines.append(rf"\multicolumn{{{len(columns)}}}{{l}}{{{title}}} \\")
        for row in table.rows:
            shown, left = _until_reason(row, columns)
            cells = [_latex_cell(row.values.get(column.key), column, zeros=not row.published) for column in shown]
            cells[0] += "".join(f" ({_in_latex(remark)})" for remark in row.remarks)
            cells += [rf"\multicolumn{{{left}}}{{l}}{{{_in_latex(row.reason)}}}"] if left else []
            lines.append(_line(cells))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def csv(table: Table) -> str:
    """Return a table as CSV: keys above, nine digits of every number, nothing for None and what is not a number."""
    keys: list[str] = []
    for column in table.columns:
        values = [row.values.get(column.key) for row in table.rows]
        ends = [f"{column.key}_low", f"{column.key}_high"]
        if any(isinstance(value, Interval) for value in values):
            keys += ends
        else:
            keys += [column.key, *(ends if any(isinstance(value, Measured) for value in values) else [])]
    keys += ["reason"] if any(row.reason for row in table.rows) else []
    keys += ["remarks"] if any(row.remarks for row in table.rows) else []
    buffer = io.StringIO()
    writer = comma_separated.DictWriter(buffer, keys, restval="", lineterminator="\n")
    writer.writeheader()
    for row in table.rows:
        said = {"reason": row.reason, "remarks": "; ".join(row.remarks)}
        cells = {key: value for key, value in said.items() if value}
        for key, value in row.values.items():
            cells |= _csv_cells(key, value)
        writer.writerow(cells)
    return buffer.getvalue()


def typeset(digits: str) -> str:
    """Return ASCII digits as a reader of HTML sees them: an en dash for none, 1.2e-05 as a power of ten."""
    if digits == "-":
        return DASH
    mantissa, letter, exponent = digits.partition("e")
    return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}" if letter else mantissa


# Columns and rows for renderers whose cells have no room for quartiles.


def _spread_out(table: Table) -> Iterator[tuple[Column, bool]]:
    """Yield every column, and after one whose quartiles are shown a column of these."""
    for column in table.columns:
        yield column, False
        if column.spread:
            yield Column(column.key, column.spread, digits=column.digits, places=column.places), True


def _plain_rows(table: Table, escape: Callable[[str], str] = str) -> Iterator[list[str]]:
    for row in table.rows:
        if row.reason and not any(value is not None for value in list(row.values.values())[1:]):
            continue  # nothing but a name: the line below the table says it
        yield [
            _plain_cell(_quartiles(row.values.get(column.key)) if ends else row.values.get(column.key), column, escape)
            for column, ends in _spread_out(table)
        ]


def _quartiles(value: Value) -> Interval | None:
    return Interval(value.low, value.high) if isinstance(value, Measured) else None


def _plain_cell(value: Value, column: Column, escape: Callable[[str], str]) -> str:
    if isinstance(value, Name) and escape is not str:
        code = f"`` {value.text} ``" if "`" in value.text else f"`{value.text}`".replace("|", "\\|")
        return f"[{code}]({value.target})" if value.target else code
    if isinstance(value, Measured):
        return ("~" if value.about else "") + digits_of(value.median, column) + column.after
    if isinstance(value, Interval):
        return f"{digits_of(value.low, column)}..{digits_of(value.high, column)}" + _unit_in_cell(column)
    if isinstance(value, int | float) and is_number(value):
        return digits_of(value, column) + _unit_in_cell(column)
    return escape(text_of(value)) if value is not None else "-"


def _unit_in_cell(column: Column) -> str:
    return " %" if column.percent else column.after


def text_of(value: Value) -> str:
    """Return what is no number in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Verdict):
        return ", ".join([_VERDICTS[value.good], *([value.words] if value.words else [])])
    return value.text if isinstance(value, Name) else str(value)


def _below(table: Table) -> list[str]:
    """Return why rows end early and the remarks on them, a line each."""
    first = table.columns[0]
    return [
        f"{text_of(row.values.get(first.key))}: {said}"
        for row in table.rows
        for said in [*row.remarks, *([row.reason] if row.reason else [])]
    ]


def _until_reason(row: Row, columns: Sequence[Column]) -> tuple[Sequence[Column], int]:
    """Return the columns that a row fills, and over how many the reason stands for which it ends."""
    if not row.reason:
        return columns, 0
    filled = max((place for place, column in enumerate(columns) if row.values.get(column.key) is not None), default=0)
    filled = min(filled + 1, len(columns) - 1)
    return columns[:filled], len(columns) - filled


# Markdown.


def _bar(cells: Iterator[str] | Sequence[str]) -> str:
    return "| " + " | ".join(cells) + " |"


def _in_markdown(words: str) -> str:
    """Return text in which nothing is a mark of Markdown or the end of a cell."""
    return "".join(f"\\{sign}" if sign in "\\|`*_<&[]" else sign for sign in " ".join(words.split()))


# HTML.


def _escaped(words: str) -> str:
    """Return text in which nothing is a mark of HTML, with the sign of multiplication in sizes of images."""
    return html_escape(re.sub(r"(?<=\d) x(?= \d|$)", " \N{MULTIPLICATION SIGN}", words))


def _layout(column: Column) -> str:
    """Return the attributes of a cell; the style is for notebooks, which do not know the classes of the page."""
    if column.long:
        return ' class="words"'
    return ' style="text-align:left"' if column.words else ""


def _html_cell(row: Row, column: Column, *, first: bool) -> str:
    value = row.values.get(column.key)
    shown = _in_html(value, column)
    if first:
        remarks = "".join(f' <span class="quiet">({_escaped(remark)})</span>' for remark in row.remarks)
        return f'<th scope="row"{_layout(column)}>{shown}{remarks}</th>'
    if isinstance(value, Verdict):
        return f'<td class="{_CLASSES[value.good]}">{shown}</td>'
    if column.alarm and value:
        return f'<td class="bad">{shown}</td>'
    title = ""
    if isinstance(value, Measured):
        ends = [typeset(digits_of(end, column)) for end in (value.low, value.high)]
        if column.spread:
            shown += f' <span class="spread">{" … ".join(ends)}</span>'
        else:
            title = f' title="quartiles {ends[0]} to {ends[1]} {_escaped(column.unit)}"'
    return f"<td{_layout(column)}{title}>{shown}</td>"


def _in_html(value: Value, column: Column) -> str:
    percent = column.share or column.percent
    after = " %" if percent else column.after.replace(" x", " \N{MULTIPLICATION SIGN}")
    if isinstance(value, Measured):
        return ("~" if value.about else "") + typeset(digits_of(value.median, column)) + after
    if isinstance(value, Interval):
        return " … ".join(typeset(digits_of(end, column, percent=percent)) for end in (value.low, value.high)) + after
    if isinstance(value, int | float) and is_number(value):
        # A share of 1 has no unit to lose digits to; three of them are what per cent are read with.
        wide = Column(column.key, "", digits=max(column.digits, 3)) if column.share else column
        return typeset(digits_of(value, wide, percent=percent)) + after
    if isinstance(value, Name):
        code = f"<code>{_escaped(value.text)}</code>"
        return f'<a href="{_escaped(value.target)}">{code}</a>' if value.target else code
    return DASH if value is None else _escaped(text_of(value))


# LaTeX.


def _line(cells: Iterator[str] | Sequence[str]) -> str:
    return " & ".join(cells) + r" \\"


def _in_latex(words: str) -> str:
    return words.translate(_LATEX)


def _num(digits: str) -> str:
    if digits in ("inf", "-inf", "nan", "+inf"):
        return {"inf": r"$\infty$", "+inf": r"$\infty$", "-inf": r"$-\infty$", "nan": "nan"}[digits]
    mantissa, letter, exponent = digits.partition("e")
    return rf"\num{{{mantissa}{letter}{int(exponent) if letter else ''}}}"


def _latex_cell(value: Value, column: Column, *, zeros: bool) -> str:
    """Return a cell; zeros at the end say how exact a measured number is, a published one has those of its paper."""
    after = r"\,\%" if column.percent else _in_latex(column.after)
    if isinstance(value, Measured):
        median, below, above = with_spread(value.median, value.low, value.high)
        about = r"\sim" if value.about else ""
        return rf"${about}{_num(median)}_{{-{_num(below)}}}^{{+{_num(above)}}}$"
    if isinstance(value, Interval):
        return "--".join(_num(digits_of(end, column, zeros=zeros)) for end in (value.low, value.high)) + after
    if isinstance(value, int | float) and is_number(value):
        return _num(digits_of(value, column, zeros=zeros)) + after
    if isinstance(value, Name):
        return rf"\texttt{{{_in_latex(value.text)}}}"
    return "--" if value is None else _in_latex(text_of(value))


# CSV.


def _csv_cells(key: str, value: Value) -> dict[str, str]:
    if isinstance(value, Interval):
        return {f"{key}_low": _nine(value.low), f"{key}_high": _nine(value.high)}
    if isinstance(value, Measured):
        return {key: _nine(value.median), f"{key}_low": _nine(value.low), f"{key}_high": _nine(value.high)}
    if isinstance(value, float):
        return {key: _nine(value)}
    return {key: "" if value is None else text_of(value)}


def _nine(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.9g}"
