# SPDX-License-Identifier: BSD-3-Clause
r"""One table drawn five ways: `text` for a terminal, `markdown`, `html`, `latex`, `csv`.

All five show the same cells. Where a cell has no room for quartiles they are a separate column
(text, Markdown) or two (CSV). Why a row ends early, and remarks on it, stand in the row (HTML,
LaTeX), below the table (text, Markdown) or in columns at the end (CSV).

LaTeX needs ``\usepackage{booktabs,siunitx}`` in the preamble: numbers are ``\num{...}``, so that
siunitx sets powers of ten, signs and decimal marks as the rest of the paper has them.
"""

import csv as comma_separated
import io
import math
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from html import escape
from textwrap import wrap
from typing import Literal

from airlight.reports.tables.table import (
    Column,
    Interval,
    Measured,
    Name,
    Row,
    Table,
    Value,
    Verdict,
    digits_of,
    with_spread,
)

#: What LaTeX needs before the document begins.
PREAMBLE = r"\usepackage{booktabs,siunitx}"

DASH = "\N{EN DASH}"
_VERDICTS = {True: ("yes", "good"), False: ("NO", "bad"), None: ("not decided in time", "quiet")}
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MARKS = {sign: f"\\{sign}" for sign in "{}$&%#_"}
_MARKS |= {
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    '"': r"\textquotedbl{}",
}
_MARKS |= {"<": r"\textless{}", ">": r"\textgreater{}", "\n": " ", "\N{EN DASH}": "--"}
_MARKS |= {"\N{MULTIPLICATION SIGN}": r"$\times$", "\N{PLUS-MINUS SIGN}": r"$\pm$"}
_LATEX = {ord(sign): written for sign, written in _MARKS.items()}


@dataclass(frozen=True)
class _Style:
    """How a format writes values."""

    words: Callable[[str], str]
    digits: Callable[[str], str] = str  #: from ASCII digits
    name: Callable[[Name], str] = lambda name: name.text
    dash: str = "-"
    between: str = ".."  #: the ends of an interval
    percent: str = " %"
    fractions: bool = False  #: in per cent
    #: whether zeros at the end of numbers are kept: they say how exact a number is
    zeros: bool = False


def text(table: Table, *, width: int | None = None, styled: bool = False) -> str:
    """Return a table for a terminal of a width [characters]; as wide as the table needs by default.

    Where it is too narrow, sentences are wrapped, and columns that are still too many are left out
    and named below; a table of sentences becomes a list. With `styled` headings are bold, by the
    codes of terminals.
    """
    from rich import box
    from rich.console import Console
    from rich.table import Table as Grid

    # Cells as text, with quartiles in columns of their own; then the columns that fit.
    columns, rows = _with_spreads(table.columns), list(_open_rows(table, _Style(str)))
    kept, widths, note = _fitted(columns, rows, width)
    # Sentences in narrow columns cannot be read: such a table becomes a list. Numbers stay a table,
    # with columns left out.
    if width is not None and len(kept) < len(columns) and any(column.long for column in columns):
        lines = _records(columns, rows, width, styled=styled)
    else:
        headed = any(column.title for column in columns)
        grid = Grid(box=box.SIMPLE_HEAD if headed else None, pad_edge=False, show_header=headed)
        for place, wide in zip(kept, widths):
            side: Literal["left", "right"] = "left" if columns[place].words else "right"
            grid.add_column(columns[place].title, justify=side, overflow="fold", width=wide)
        for cells in rows:
            grid.add_row(*(cells[place] for place in kept))
        # Rich draws into a buffer: the text is printed elsewhere, or not on a terminal at all.
        drawn = io.StringIO()
        Console(
            file=drawn, highlight=False, markup=False, width=width or 10_000, force_terminal=styled
        ).print(grid)
        lines = [
            *(line.rstrip() for line in drawn.getvalue().splitlines()),
            *([*_wrapped(note, width), ""] if note else []),
        ]
    below = [line for words in _below(table) for line in _wrapped(words, width)]
    return "\n".join([*_wrapped(table.title, width), *lines, *below]) + "\n"


def _fitted(
    columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int | None
) -> tuple[list[int], list[int | None], str]:
    """Return the places of the columns that fit, how wide they are drawn, and
    in words what is left out.

    Columns that are `minor` and quartiles go first, then those to the
    right; the first column stays.
    """
    places = list(range(len(columns)))
    cells = [[columns[place].title, *(row[place] for row in rows)] for place in places]
    # The width at which nothing is wrapped.
    natural = [max(map(len, column)) for column in cells]
    if width is None or _width(natural) <= width:
        return places, [None] * len(places), ""
    # A number is not broken, but its heading may be, between words; a word of text of more than 30
    # characters, such as a path, may be broken too.
    least = [
        max(
            [
                _longest(words) if words is column[0] or columns[place].words else len(words)
                for words in column
            ]
        )
        for place, column in zip(places, cells)
    ]
    least = [min(wide, 30) if columns[place].words else wide for place, wide in zip(places, least)]
    # Columns are left out from the end of this list: minor columns and quartiles before others,
    # right before left.
    order = sorted(places[1:], key=lambda place: (columns[place].minor, place))
    left: list[int] = []
    while len(places) > 1 and _width([least[place] for place in places]) > width:
        left.append(order.pop())
        places.remove(left[-1])
    # The rest of the room is shared in proportion to what each column lacks of its natural width.
    room = width - _width([least[place] for place in places])
    wanted = [natural[place] - least[place] for place in places]
    part = min(1.0, max(0, room) / (sum(wanted) or 1))
    widths: list[int | None] = [
        least[place] + int(part * more) for place, more in zip(places, wanted)
    ]
    # The user should know which columns are missing and how to see them.
    if not left:
        return places, widths, ""
    names = ", ".join(columns[place].title for place in sorted(left))
    return (
        places,
        widths,
        f"Left out at {width} columns: {names}. A pipe (| less -S) or {_width(natural)} columns "
        "show all.",
    )


def _width(widths: Sequence[int]) -> int:
    """Return how wide a table of such columns is drawn."""
    return sum(widths) + 3 * (len(widths) - 1) + 2


def _longest(words: str) -> int:
    return max(map(len, words.split()), default=0)


def _wrapped(words: str, width: int | None, indent: str = "") -> list[str]:
    """Return words in lines that fit, none for none."""
    if width is None:
        return [words] if words else []
    return wrap(words, max(width, 20), subsequent_indent=indent, break_on_hyphens=False)


def _records(
    columns: Sequence[Column], rows: Sequence[Sequence[str]], width: int, *, styled: bool
) -> list[str]:
    """Return a table as a list: what the first column names, and under it a
    line for each other column.
    """
    lines = []
    for cells in rows:
        lines += ["", f"\x1b[1m{cells[0]}\x1b[0m" if styled else cells[0]]
        for column, cell in zip(columns[1:], cells[1:]):
            lines += _wrapped(f"  {column.title}: {cell}" if cell else "", width, indent="    ")
    return [*lines, ""]


def markdown(table: Table) -> str:
    """Return a table as Markdown of GitHub's kind, its title in bold above it."""

    def bar(cells: Iterable[str]) -> str:
        return f"| {' | '.join(cells)} |"

    columns, below = _with_spreads(table.columns), _below(table)
    lines = [f"**{_in_markdown(table.title)}**", ""] if table.title else []
    lines.append(bar(_in_markdown(column.title) for column in columns))
    lines.append(bar("---" if column.words else "---:" for column in columns))
    lines += [
        bar(cells) for cells in _open_rows(table, _Style(_in_markdown, name=_name_in_markdown))
    ]
    lines += ["", *(f"- {_in_markdown(line)}" for line in below)] if below else []
    return "\n".join(lines) + "\n"


def html(table: Table) -> str:
    """Return a table as HTML, in a box that scrolls sideways; fractions are in per cent."""
    # Headings, then a row for each row; a box that can be focused scrolls by the keyboard too.
    head = "".join(
        f'<th scope="col"{_layout(column)}>{_in_html(column.title)}</th>'
        for column in table.columns
    )
    named = f' role="group" aria-label="{_in_html(table.title)}"' if table.title else ""
    lines = [f'<div class="scroll" tabindex="0"{named}><table>']
    caption = ". ".join(part for part in (table.title, table.explanation) if part)
    lines += [f"<caption>{_in_html(caption)}</caption>"] if caption else []
    lines += (
        [f"<thead><tr>{head}</tr></thead>"]
        if any(column.heading for column in table.columns)
        else []
    )
    lines.append("<tbody>")
    for row in table.rows:
        # The reason of a refusal stands over all columns that the row leaves empty.
        shown, left = _until_reason(row, table.columns)
        cells = [_html_cell(row, column, first=not place) for place, column in enumerate(shown)]
        cells += [f'<td class="words" colspan="{left}">{_in_html(row.reason)}</td>'] if left else []
        marked = ' class="published"' if row.published else ""
        lines.append(f"<tr{marked}>{''.join(cells)}</tr>")
    return "\n".join([*lines, "</tbody></table></div>", *_meanings(table.columns)]) + "\n"


def _meanings(columns: Sequence[Column]) -> list[str]:
    """Return the meanings of columns, to be unfolded below a table."""
    explained = [column for column in columns if column.meaning]
    if not explained:
        return []
    terms = "".join(
        f"<dt>{_in_html(column.title)}</dt><dd>{_in_html(column.meaning)}</dd>"
        for column in explained
    )
    return [
        '<details class="terms"><summary>Meaning of the '
        f"columns</summary><dl>{terms}</dl></details>"
    ]


def latex(tables: Sequence[Table], *, comment: Sequence[str] = ()) -> str:
    r"""Return tables with the same columns as one `tabular`, each under its
    title, below lines of comment.
    """

    def line(cells: Iterable[str]) -> str:
        return " & ".join(cells) + r" \\"

    # All tables share one tabular, so that their columns line up in the paper.
    columns = tables[0].columns
    lines = [f"% {words}" for words in (f"Needs {PREAMBLE}.", *comment)]
    lines += [
        r"\begin{tabular}{" + "".join("l" if column.words else "r" for column in columns) + "}",
        r"\toprule",
    ]
    lines.append(line(_in_latex(column.heading) for column in columns))
    # Units have a line of their own below the headings.
    if any(column.unit for column in columns):
        lines.append(
            line(f"[{_in_latex(column.unit)}]" if column.unit else "" for column in columns)
        )
    lines.append(r"\midrule")
    for place, table in enumerate(tables):
        lines += [r"\addlinespace"] if place else []
        if table.title:
            # Numbers with powers of ten inside a sentence are set by siunitx too.
            about = re.sub(
                r"\b([\d.]+e-?\d+)\b", lambda match: _num(match[1]), _in_latex(table.explanation)
            )
            title = rf"\textit{{{_in_latex(table.title)}}}{f', {about}' if about else ''}"
            lines.append(rf"\multicolumn{{{len(columns)}}}{{l}}{{{title}}} \\")
        for row in table.rows:
            shown, left = _until_reason(row, columns)
            cells = [_latex_cell(row, column) for column in shown]
            cells[0] += "".join(f" ({_in_latex(remark)})" for remark in row.remarks)
            cells += [rf"\multicolumn{{{left}}}{{l}}{{{_in_latex(row.reason)}}}"] if left else []
            lines.append(line(cells))
    return "\n".join([*lines, r"\bottomrule", r"\end{tabular}"]) + "\n"


def csv(table: Table) -> str:
    """Return a table as CSV: keys above, nine digits of every number, nothing for None
    and what is not a number.
    """
    rows: list[dict[str, str]] = []
    keys: dict[str, None] = {}
    for column in table.columns:
        # A column of medians also gets columns for its quartiles; a column of intervals has the two
        # ends alone.
        kinds = {type(row.values.get(column.key)) for row in table.rows}
        keys |= {} if Interval in kinds else {column.key: None}
        keys |= (
            dict.fromkeys((f"{column.key}_low", f"{column.key}_high"))
            if kinds & {Interval, Measured}
            else {}
        )
    for row in table.rows:
        # Reasons and remarks have columns only if some row has one.
        said = {"reason": row.reason, "remarks": "; ".join(row.remarks)}
        rows.append(
            {
                name: cell
                for key, value in row.values.items()
                if value is not None  # it has no ends, and a column of intervals has nothing else
                for name, cell in _csv_cells(key, value)
            }
        )
        rows[-1] |= {key: words for key, words in said.items() if words}
        keys |= dict.fromkeys(key for key in said if said[key])
    buffer = io.StringIO()
    writer = comma_separated.DictWriter(buffer, list(keys), restval="", lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    return buffer.getvalue()


def typeset(digits: str) -> str:
    """Return ASCII digits as a reader of HTML sees them: an en dash for none,
    1.2e-05 as a power of ten.
    """
    mantissa, letter, exponent = digits.partition("e")
    if letter:
        return f"{mantissa}·10{str(int(exponent)).translate(_SUPERSCRIPTS)}"
    return DASH if digits == "-" else digits


def text_of(value: Value) -> str:
    """Return a value that is no number in words."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, Verdict):
        return ", ".join([_VERDICTS[value.good][0], *([value.words] if value.words else [])])
    return value.text if isinstance(value, Name) else str(value)


def _cell(value: Value, column: Column, style: _Style) -> str:
    """Return a value as a format writes it; of what was measured the median alone."""
    # A truth value is an integer for Python, so that it is asked for before numbers.
    percent = column.percent or (column.fraction and style.fractions)

    def written(number: float) -> str:
        return style.digits(digits_of(number, column, zeros=style.zeros, percent=percent))

    after = style.percent if percent else ""
    if value is None:
        return style.dash
    if isinstance(value, Measured):
        return written(value.median) + after
    if isinstance(value, Interval):
        return f"{written(value.low)}{style.between}{written(value.high)}{after}"
    if isinstance(value, Name):
        return style.name(value)
    if isinstance(value, bool) or not isinstance(value, int | float):
        return style.words(text_of(value))
    return written(value) + after


# Text and Markdown: quartiles in a separate column, reasons below the table.


def _with_spreads(columns: Iterable[Column]) -> list[Column]:
    """Return the columns, and after each whose quartiles are shown a column of these."""
    shown: list[Column] = []
    for column in columns:
        shown.append(column)
        if column.spread:
            shown.append(replace(column, heading=column.spread, unit="", spread="", minor=True))
    return shown


def _open_rows(table: Table, style: _Style) -> Iterator[list[str]]:
    for row in table.rows:
        # A refused row would be a line of dashes.
        if row.reason and all(row.values.get(column.key) is None for column in table.columns[1:]):
            continue  # the row has nothing but a name: a line below the table gives the reason
        cells = []
        for column in table.columns:
            value = row.values.get(column.key)
            cells.append(_cell(value, column, style))
            if column.spread:
                ends = Interval(value.low, value.high) if isinstance(value, Measured) else None
                cells.append(_cell(ends, column, style))
        yield cells


def _below(table: Table) -> list[str]:
    """Return the remarks on rows and why they end early, a line each."""
    key = table.columns[0].key
    return [
        f"{text_of(row.values.get(key))}: {said}"
        for row in table.rows
        for said in (*row.remarks, row.reason)
        if said
    ]


def sentence_in_text(sentence: str) -> str:
    """Return a sentence without the backticks around code."""
    return sentence.replace("`", "")


def _in_markdown(words: str) -> str:
    """Return text in which nothing is a mark of Markdown or the end of a cell."""
    return re.sub(r"([\\|`*_<&\[\]])", r"\\\1", re.sub(r"\s*\n\s*", " ", words))


def _name_in_markdown(name: Name) -> str:
    code = "`{}`".format(name.text.replace("|", "\\|"))
    return f"[{code}]({name.target})" if name.target else code


# HTML and LaTeX: quartiles in the cell, reasons over the rest of the row.


def _until_reason(row: Row, columns: Sequence[Column]) -> tuple[Sequence[Column], int]:
    """Return the columns that a row fills, and over how many the reason
    stands for which it ends.
    """
    if not row.reason:
        return columns, 0
    # The last column with a value; the reason gets the rest, one column at least.
    filled = max(
        (place for place, column in enumerate(columns) if row.values.get(column.key) is not None),
        default=0,
    )
    filled = min(filled + 1, len(columns) - 1)
    return columns[:filled], len(columns) - filled


def _in_html(words: str) -> str:
    """Return text in which nothing is a mark of HTML, with the sign of
    multiplication in sizes of images.
    """
    return escape(re.sub(r"(?<=\d) x(?= \d|$)|^ x$", " \N{MULTIPLICATION SIGN}", words))


def sentence_in_html(sentence: str) -> str:
    """Return a sentence as HTML; what stands in backticks is code."""
    return re.sub(r"`([^`]+)`", r"<code>\1</code>", escape(sentence))


def _name_in_html(name: Name) -> str:
    code = f"<code>{_in_html(name.text)}</code>"
    return f'<a href="{_in_html(name.target)}">{code}</a>' if name.target else code


_HTML = _Style(_in_html, typeset, _name_in_html, DASH, " … ", fractions=True)


def _layout(column: Column) -> str:
    """Return the attributes of a cell; the style is for notebooks, which do not know
    the classes of the page.
    """
    return ' class="words"' if column.long else ' style="text-align:left"' if column.words else ""


def _html_cell(row: Row, column: Column, *, first: bool) -> str:
    value = row.values.get(column.key)
    shown = _cell(value, column, _HTML)
    # The first cell names the row, for screen readers too, and carries its remarks.
    if first:
        remarks = "".join(
            f' <span class="quiet">({_in_html(remark)})</span>' for remark in row.remarks
        )
        return f'<th scope="row"{_layout(column)}>{shown}{remarks}</th>'
    # Anything but zero in an alarm column is marked as bad.
    if isinstance(value, Verdict) or (column.alarm and value):
        kind = _VERDICTS[value.good][1] if isinstance(value, Verdict) else "bad"
        return f'<td class="{kind}">{shown}</td>'
    # Quartiles stand in the cell where the column shows them, else under the pointer.
    title = ""
    if isinstance(value, Measured):
        ends = _cell(Interval(value.low, value.high), column, _HTML)
        shown += f' <span class="spread">{ends}</span>' if column.spread else ""
        title = "" if column.spread else f' title="quartiles {ends} {_in_html(column.unit)}"'
    return f"<td{_layout(column)}{title}>{shown}</td>"


def _in_latex(words: str) -> str:
    return words.translate(_LATEX)


def _num(digits: str) -> str:
    # siunitx reads neither.
    if digits.endswith(("inf", "nan")):
        return digits if digits == "nan" else digits.replace("inf", r"$\infty$").replace("-$", "$-")
    mantissa, letter, exponent = digits.partition("e")
    return rf"\num{{{mantissa}{letter}{int(exponent) if letter else ''}}}"


def _latex_cell(row: Row, column: Column) -> str:
    """Return a cell; what is published has the digits of its paper."""
    value = row.values.get(column.key)
    if isinstance(value, Measured):
        # Distances to the quartiles as index and exponent.
        median, below, above = map(_num, with_spread(value.median, value.low, value.high))
        return rf"${median}_{{-{below}}}^{{+{above}}}$"
    return _cell(value, column, replace(_LATEX_STYLE, zeros=not row.published))


def _name_in_latex(name: Name) -> str:
    return rf"\texttt{{{_in_latex(name.text)}}}"


_LATEX_STYLE = _Style(_in_latex, _num, _name_in_latex, "--", "--", r"\,\%")


def _csv_cells(key: str, value: Value) -> Iterator[tuple[str, str]]:
    if isinstance(value, Measured):
        yield from _csv_cells(key, value.median)
    if isinstance(value, Measured | Interval):
        yield from (*_csv_cells(f"{key}_low", value.low), *_csv_cells(f"{key}_high", value.high))
    elif isinstance(value, float):
        yield key, "" if math.isnan(value) else f"{value:.9g}"
    else:
        yield key, text_of(value)
