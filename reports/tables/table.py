# SPDX-License-Identifier: BSD-3-Clause
"""A table as data: columns that say what their values are, and rows of values with nothing rounded.

`reports.tables.drawing` draws it: on a terminal, as Markdown, HTML, LaTeX and CSV. The rules that
all of these share are here: which columns there are, and how a number becomes digits.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # making its classes would take a tenth of the time of `airlight --help`
    from airlight.validation.timing import Timing


_UNITS = ("ms", "MiB")  # that stand in a heading


@dataclass(frozen=True)
class Measured:
    """A median with its quartiles."""

    median: float
    low: float  #: first quartile
    high: float  #: third quartile


@dataclass(frozen=True)
class Interval:
    """Two ends of one thing."""

    low: float
    high: float

    @classmethod
    def of(cls, ends: "Sequence[float | None] | None") -> "Interval | None":
        """Return the interval of a pair of report.json, None where an end is not known."""
        low, high = ends or (None, None)
        return None if low is None or high is None else cls(low, high)


@dataclass(frozen=True)
class Verdict:
    """Whether a check passed; None where it was not decided within its time."""

    good: bool | None
    words: str = ""  #: words behind the verdict


@dataclass(frozen=True)
class Name:
    """The name of something that one types, with the address of its page where it has one."""

    text: str
    target: str = ""


Value = None | bool | int | float | str | Measured | Interval | Verdict | Name


@dataclass(frozen=True)
class Column:
    """A column: the description of its values, and how many digits are shown."""

    key: str  #: of the values in a row, and the name of the column in CSV
    heading: str
    unit: str = ""  #: behind the heading
    words: bool = False  #: text, to the left; numbers stand to the right
    long: bool = False  #: sentences, which may be wrapped
    digits: int = 3  #: significant digits
    places: int | None = None  #: digits behind the point, in place of significant digits
    whole: bool = False  #: rates: no digits behind the point from ten on, one digit below
    sign: bool = False  #: positive numbers have a plus
    percent: bool = False  #: a fraction, written in per cent
    fraction: bool = False  #: a fraction that HTML writes in per cent and the others as it is
    #: heading of the quartiles of `Measured`, in a separate column where cells have no room
    spread: str = ""
    alarm: bool = False  #: anything but zero is bad
    meaning: str = ""  #: what its values are, in words; HTML explains it below the table
    minor: bool = False  #: left out first where a terminal is narrow

    @property
    def title(self) -> str:
        """The heading with its unit."""
        return f"{self.heading} {self.unit}".strip()


@dataclass(frozen=True)
class Row:
    """Values by the key of their column; what a row leaves out is None."""

    values: Mapping[str, Value]
    reason: str = ""  #: why the row ends early
    remarks: tuple[str, ...] = ()  #: remarks on what the first column names
    published: bool = False  #: printed in a paper, not measured


@dataclass(frozen=True)
class Table:
    """A table as data; each value belongs to a column."""

    title: str
    columns: tuple[Column, ...]
    rows: tuple[Row, ...]
    explanation: str = ""  #: what a caption adds to the title

    def __post_init__(self) -> None:
        # A value without a column would disappear in silence.
        keys = {column.key for column in self.columns}
        for row in self.rows:
            stray = set(row.values) - keys
            if stray:
                raise ValueError(f"table {self.title!r}: no column for {', '.join(sorted(stray))}")

    def only(self, *keys: str) -> "Table":
        """Return the table with these columns alone, in this order."""
        column_of = {column.key: column for column in self.columns}
        rows = (
            replace(row, values={k: v for k, v in row.values.items() if k in keys})
            for row in self.rows
        )
        return replace(self, columns=tuple(column_of[key] for key in keys), rows=tuple(rows))


def table(
    title: str,
    columns: Iterable[Column],
    rows: Iterable[Row | Sequence[Value] | Mapping[str, Any]],
    *,
    explanation: str = "",
) -> Table:
    """Return a table; a row may be its values in the order of the columns, or a
    mapping that has them by key.
    """
    known = tuple(columns)

    def row(given: Row | Sequence[Value] | Mapping[str, Any]) -> Row:
        if isinstance(given, Row):
            return given
        if isinstance(given, Mapping):
            return Row({column.key: given.get(column.key) for column in known})
        return Row({column.key: value for column, value in zip(known, given, strict=True)})

    return Table(title, known, tuple(map(row, rows)), explanation)


def table_of(
    title: str,
    record: type,
    rows: Iterable[Any],
    *,
    explanation: str = "",
    how: Mapping[str, Mapping[str, Any]] = MappingProxyType({}),
) -> Table:
    """Return the table of some records, or of mappings; `how` are other
    fields of a column by its key.
    """
    columns = [replace(each, **how.get(each.key, {})) for each in fields_of(record)]
    values = [row if isinstance(row, Mapping) else vars(row) for row in rows]
    return table(title, columns, values, explanation=explanation)


def fields_of(record: type, *keys: str, **how: Any) -> tuple[Column, ...]:
    """Return columns of fields of a record, by default of all texts and numbers; `how` are
    other fields of `Column`.

    Their headings, units and meanings stand at the fields.
    """
    from airlight.validation.columns import described

    known = described(record)
    # Without keys all fields that can be cells: texts and numbers.
    shown = [known[key] for key in keys] or [each for each in known.values() if each.kind]
    return tuple(
        Column(
            each.key,
            each.heading,
            each.unit if each.unit in _UNITS else "",
            words=each.kind == "string",
            meaning=f"pixels {each.meaning}" if each.unit == "pixels" else each.meaning,
            **how,
        )
        for each in shown
    )


def words(*keys: str, how: Mapping[str, Any] | None = None, **headings: str) -> tuple[Column, ...]:
    """Return columns of text: keys that are their own headings, then keys with their headings."""
    return numbers(*keys, how={"words": True, **(how or {})}, **headings)


def numbers(
    *keys: str, how: Mapping[str, Any] | None = None, **headings: str
) -> tuple[Column, ...]:
    """Return columns that are written alike, named as those of `words`; `how` are the
    other fields of `Column`.
    """
    named = dict.fromkeys(keys, "") | headings
    return tuple(Column(key, heading or key, **(how or {})) for key, heading in named.items())


def number(value: float | None, digits: int = 3, *, zeros: bool = False) -> str:
    """Return a number with some significant digits, a hyphen for none; `zeros` at the end
    say how exact a number is.
    """
    if value is None:
        return "-"
    if value == 0:
        return "0"
    text = f"{value:#.{digits}g}" if zeros else f"{value:.{digits}g}"
    return text.removesuffix(".").replace(".e", "e")


def digits_of(value: float, column: Column, *, zeros: bool = False, percent: bool = False) -> str:
    """Return a number of a column in ASCII digits, without what stands behind it.

    With `percent` a fraction is in per cent although the column does not ask for it.
    """
    # A whole number is written in full; digits and places are for measured ones.
    shown = 100 * value if percent or column.percent else value
    if isinstance(value, int) and shown is value:
        text = str(value)
    elif column.percent and abs(shown) >= 1000:
        text = f"{shown:.0f}"  # an exponent is no percentage that one reads
    elif column.places is not None:
        text = f"{shown:.{column.places}f}"
    elif column.whole:
        text = f"{shown:.0f}" if abs(shown) >= 10 else f"{shown:.1f}"
    else:
        # Fractions in per cent have at least three digits.
        text = number(
            shown,
            max(column.digits, 3) if percent and column.fraction else column.digits,
            zeros=zeros,
        )
    return f"+{text}" if column.sign and shown > 0 else text


def with_spread(median: float, low: float, high: float) -> tuple[str, str, str]:
    """Return a median and the distances to its quartiles, to one digit behind the
    first of the wider distance.
    """
    from math import floor, log10

    # At least a thousandth of the median, as quartiles may coincide.
    widest = max(high - median, median - low, abs(median) * 1e-3)
    places = max(0, 1 - floor(log10(widest))) if widest > 0 else 1
    return f"{median:.{places}f}", f"{median - low:.{places}f}", f"{high - median:.{places}f}"


def measured(timing: "Timing | None") -> Measured | None:
    """Return a timing of report.json, None for none."""
    return None if timing is None else Measured(timing.median_ms, timing.low_ms, timing.high_ms)
