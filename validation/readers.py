# SPDX-License-Identifier: BSD-3-Clause
"""Readers of values in files of users, TOML and JSON.

A reader takes the place of a value in the file, for messages, and the value, which may be anything.
It returns the value in the type that it stands for, or raises InputError with what was given and
what is expected.
"""

import csv
import tomllib
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

from airlight.errors import InputError, nearest

Value = TypeVar("Value")

#: Returns a value in its type: takes the place of the value, for messages, and the value as the
#: file has it.
Reader = Callable[[str, object], Value]


def read_toml(what: str, path: Path) -> dict[str, Any]:
    """Return the contents of a TOML file."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise InputError(
            f"{what}: there is no file {path}; expected a TOML file, see docs/many-scenes.md"
        ) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise InputError(f"{what} {path}: it cannot be read: {error}") from error


def read_csv(path: Path) -> list[tuple[int, list[str]]]:
    """Return the rows of a CSV file with the numbers of their lines.

    Empty lines and lines that begin with # are left out.
    """
    try:
        with path.open(newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = ((reader.line_num, [cell.strip() for cell in cells]) for cells in reader)
            rows = [(line, cells) for line, cells in lines if any(cells)]
    except (OSError, UnicodeDecodeError, csv.Error) as reason:
        raise InputError(
            f"{path} cannot be read as a CSV file: {reason}; give a text file"
        ) from None
    rows = [(line, cells) for line, cells in rows if not cells[0].startswith("#")]
    for line, cells in rows[1:]:
        if len(cells) != len(rows[0][1]):
            raise InputError(
                f"{path}, line {line}: {len(cells)} cells in a file of {len(rows[0][1])} columns"
            )
    return rows


def read_table(what: str, value: object) -> Mapping[str, object]:
    """Return names and values."""
    if not isinstance(value, dict):
        raise InputError(f"{what}: got {value!r}, expected a table of names and values")
    return value


def read_list(what: str, value: object, least: int = 1) -> list[object]:
    """Return a list of at least so many entries."""
    if not isinstance(value, list) or len(value) < least:
        raise InputError(
            f"{what}: got {value!r}, expected a list"
            + (f" with at least {least} entries" if least else "")
        )
    return value


def read_word(what: str, value: object) -> str:
    """Return a word that is not empty."""
    if not isinstance(value, str) or not value.strip():
        raise InputError(f"{what}: got {value!r}, expected a word")
    return value


def read_one_of(what: str, value: object, *, names: Sequence[str]) -> str:
    """Return one of some names."""
    if not isinstance(value, str) or value not in names:
        raise InputError(f"{what}: got {value!r}, expected one of {', '.join(names)}")
    return value


def read_whole(what: str, value: object, least: float, most: float) -> int:
    """Return a whole number within bounds."""
    if type(value) is not int or not least <= value <= most:
        raise InputError(
            f"{what}: got {value!r}, expected a whole number from {least:g} to {most:g}"
        )
    return value


def read_number(what: str, value: object, least: float, most: float) -> float:
    """Return a number within bounds, whole or not."""
    # A truth value is an int to `isinstance`, and no number to a user.
    if not (type(value) is int or type(value) is float) or not least <= value <= most:
        raise InputError(f"{what}: got {value!r}, expected a number from {least:g} to {most:g}")
    return value


def each_once(what: str, items: tuple[Value, ...]) -> tuple[Value, ...]:
    """Return items, of which no two may be equal."""
    for number, item in enumerate(items):
        if item in items[:number]:
            raise InputError(f"{what}: {item!r} is there twice; leave one out")
    return items


def read_named(
    prefix: str, data: Mapping[str, object], readers: Mapping[str, Reader[Value]], *others: str
) -> dict[str, Value]:
    """Return the values of a table by name, each by the reader of its name.

    `prefix`: stands before a name in messages; `others`: names that the table may have beside
    those of the readers. Raises InputError for a name that is neither.
    """
    for name in data:
        if name not in (names := (*readers, *others)):
            raise InputError(
                f"got {prefix}{name}, expected one of {', '.join(names)}{nearest(name, names)}"
            )
    return {name: read(prefix + name, data[name]) for name, read in readers.items() if name in data}


def several(read: Reader[Value], least: int = 1) -> Reader[tuple[Value, ...]]:
    """Return a reader of a list of at least so many values, of which no two may be equal."""
    return lambda what, value: each_once(
        what, tuple(read(what, item) for item in read_list(what, value, least))
    )


def by_name(read: Reader[Value]) -> Reader[dict[str, Value]]:
    """Return a reader of a table whose values all have one type."""
    return lambda what, value: {
        name: read(f"{what}.{name}", each) for name, each in read_table(what, value).items()
    }


def named_values(
    option: str, words: Iterable[str], read: Callable[[str], Value], wanted: str
) -> dict[str, Value]:
    """Return values by name from words of the form 'NAME=VALUE'.

    `option`: where the words stand, for messages; `words`: what the user wrote; `read`: returns the
    value of a text that is not empty, or raises ValueError; `wanted`: what a word should look like,
    for messages. Raises InputError if a word has another form, or two words give one name different
    values.
    """
    values: dict[str, Value] = {}
    for word in words:
        name, _, text = (part.strip() for part in word.partition("="))
        try:
            if not name or not text:
                raise ValueError(word)
            value = read(text)
        except ValueError:
            raise InputError(f"{option}: got {word!r}, expected {wanted}") from None
        if values.setdefault(name, value) != value:
            first = next(each.strip() for each in words if each.partition("=")[0].strip() == name)
            raise InputError(
                f"{option}: got {first} and {word.strip()}, expected one of them: each name once"
            )
    return values
