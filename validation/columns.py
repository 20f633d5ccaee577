# SPDX-License-Identifier: BSD-3-Clause
"""Records that know their columns: heading, unit and meaning stand at the field, for
every table, figure and file.

    @dataclass(frozen=True)
    class Cost:
        frame: float | None = column("frame", "ms", "a frame while nothing moves")
        error: Metrics | None = None        # a record within: its columns are `error.rmse` and so on

A value within a record within a record has a key with dots, the path of the value in
the JSON of the record too.
"""

import math
import types
from collections.abc import Callable, Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

if TYPE_CHECKING:  # any data class, as the standard library's stubs name it
    from _typeshed import DataclassInstance

_Record = TypeVar("_Record")
_COLUMN = "column"
_KINDS = {str: "string", int: "int64", float: "float64", bool: "bool", bytes: "binary"}


@dataclass(frozen=True)
class Column:
    """The description of a column."""

    key: str  #: the path of the value in the record, with dots
    heading: str
    unit: str  #: '1' for a number without a unit, empty for words and truth values
    meaning: str
    kind: str  #: 'string', 'int64', 'float64', 'bool' or 'binary', as Arrow names them


def column(
    heading: str = "",
    unit: str | None = None,
    meaning: str = "",
    *,
    default: object = MISSING,
    factory: Callable[[], object] | None = None,
) -> Any:
    """Return a field of a data class with its heading (its name with spaces by default),
    its unit and its meaning.

    Its `default`, or what the `factory` makes, is the value where none is given. As of
    `dataclasses.field`, the type of the field is that of its annotation.
    """
    metadata = {_COLUMN: (heading, unit, meaning)}
    if factory is not None:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


@cache
def columns_of(record: type) -> tuple[Column, ...]:
    """Return the columns of a data class in order, with the columns of records within it.

    Fields of other types, such as arrays and mappings, have no column.
    """
    return tuple(_columns(record, ""))


@cache
def described(record: type) -> dict[str, Column]:
    """Return the descriptions of the fields of a data class by name.

    The kind of a field that is no number and no text is empty.
    """
    hints, descriptions = get_type_hints(record), {}
    for each in fields(record):
        kind = _kind(hints[each.name])
        heading, unit, meaning = each.metadata.get(_COLUMN, ("", None, ""))
        usual = "1" if kind in (int, float) else ""
        heading, unit = heading or each.name.replace("_", " "), usual if unit is None else unit
        arrow = _KINDS.get(kind, "") if kind else ""
        descriptions[each.name] = Column(each.name, heading, unit, meaning, arrow)
    return descriptions


def values_of(record: "DataclassInstance") -> dict[str, Any]:
    """Return the values of a record by the keys of its columns, and the values of its
    mappings by `NAME.KEY`.
    """
    return flat({each.name: getattr(record, each.name) for each in fields(record)})


def shown_values(record: "DataclassInstance") -> dict[str, Any]:
    """Return the values that have a column, by key, as JSON holds them; arrays are left out."""
    values = values_of(record)
    return {each.key: plain(values.get(each.key)) for each in columns_of(record.__class__)}


def flat(data: Mapping[str, object]) -> dict[str, Any]:
    """Return mappings and records within a mapping as one dictionary, keys joined by dots."""
    values: dict[str, Any] = {}
    for key, value in data.items():
        if is_dataclass(value) and not isinstance(value, type):
            value = values_of(value)
        if isinstance(value, Mapping):
            values |= {f"{key}.{name}": inner for name, inner in flat(value).items()}
        else:
            values[str(key)] = value
    return values


def plain(value: object) -> Any:
    """Return records, containers, arrays and numbers as JSON holds them: without NumPy types, and
    with None for a number that is not finite.

    A field that `repr` does not show, such as an image, is left out.
    """
    if is_dataclass(value) and not isinstance(value, type):
        return {each.name: plain(getattr(value, each.name)) for each in fields(value) if each.repr}
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if isinstance(value, tuple | list):
        return [plain(item) for item in value]
    if isinstance(value, Path):
        return str(value)
    if isinstance(value, np.generic | np.ndarray):
        return plain(value.tolist())
    return None if isinstance(value, float) and not math.isfinite(value) else value


def record_of(data: object, kind: type[_Record]) -> _Record:
    """Return a record of plain data, or of values by name; keys without a field are passed over.

    Raises `msgspec.ValidationError` for data that do not fit the types of the fields.
    """
    import msgspec

    return msgspec.convert(plain(data), kind)


def _columns(record: type, prefix: str) -> Iterator[Column]:
    hints = get_type_hints(record)
    for name, outer in described(record).items():
        kind = _kind(hints[name])
        if kind is not None and is_dataclass(kind):
            for inner in _columns(kind, f"{prefix}{name}."):
                words = f"{outer.meaning}: {inner.meaning}" if outer.meaning else inner.meaning
                yield replace(inner, heading=f"{outer.heading}, {inner.heading}", meaning=words)
        elif outer.kind:
            yield replace(outer, key=prefix + name)


def _kind(hint: object) -> type | None:
    """Return the class of a field's values other than None; None where there is no one class."""
    options = get_args(hint) if get_origin(hint) in (Union, types.UnionType) else (hint,)
    classes = [each for each in options if each is not type(None)]
    return classes[0] if len(classes) == 1 and isinstance(classes[0], type) else None
