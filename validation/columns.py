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
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, dataclass, field, fields, is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, Union, get_args, get_origin, get_type_hints

import numpy as np

_Record = TypeVar("_Record")
_COLUMN = "column"
_KINDS = {str: "string", int: "int64", float: "float64", bool: "bool", bytes: "binary"}


@dataclass(frozen=True)
class Column:
    """The description of a column."""

    key: str  #: the path of the value in the record, with dots
    heading: str
    unit: str  #: '1' for a number without a unit, empty for what is no number
    meaning: str
    kind: str  #: 'string', 'int64', 'float64', 'bool' or 'binary', as Arrow names them


def column(
    heading: str = "",
    unit: str | None = None,
    meaning: str = "",
    *,
    default: Any = MISSING,
    factory: Any = MISSING,
) -> Any:
    """Return a field of a data class with its heading (its name with spaces by default),
    its unit and its meaning.

    Its `default`, or what the `factory` makes, is the value where none is given.
    """
    return field(
        default=default, default_factory=factory, metadata={_COLUMN: (heading, unit, meaning)}
    )


@cache
def columns_of(record: type) -> tuple[Column, ...]:
    """Return the columns of a data class, those of the records within it too, in order.

    Fields of other types, such as arrays and mappings, have no column.
    """
    return tuple(_columns(record, ""))


@cache
def described(record: type) -> dict[str, Column]:
    """Return the descriptions of the fields of a data class by name; one that is no number
    and no text has no kind.
    """
    hints, found = get_type_hints(record), {}
    for each in fields(record):
        kind = _kind(hints[each.name])
        heading, unit, meaning = each.metadata.get(_COLUMN, ("", None, ""))
        usual = "1" if kind in (int, float) else ""
        heading, unit = heading or each.name.replace("_", " "), usual if unit is None else unit
        found[each.name] = Column(each.name, heading, unit, meaning, _KINDS.get(kind, ""))
    return found


def values_of(record: Any) -> dict[str, Any]:
    """Return the values of a record by the keys of its columns, and `NAME.KEY`
    for what its mappings hold.
    """
    return flat({each.name: getattr(record, each.name) for each in fields(record)})


def shown_values(record: Any) -> dict[str, Any]:
    """Return the values that have a column, by key, as JSON holds them; arrays are left out."""
    values = values_of(record)
    return {each.key: plain(values.get(each.key)) for each in columns_of(record.__class__)}


def flat(data: Mapping[str, Any]) -> dict[str, Any]:
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


def plain(value: Any) -> Any:
    """Return records, containers, arrays and numbers as JSON holds them: no NumPy types,
    None for what is not finite.

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


def record_of(data: Any, kind: type[_Record]) -> _Record:
    """Return a record of plain data, or of values by name; keys that it does
    not know are passed over.

    Raises `msgspec.ValidationError` for what does not fit its types.
    """
    import msgspec

    return msgspec.convert(plain(data), kind)


def _columns(record: Any, prefix: str) -> Iterator[Column]:
    hints = get_type_hints(record)
    for name, own in described(record).items():
        kind = _kind(hints[name])
        if is_dataclass(kind):
            for inner in _columns(kind, f"{prefix}{name}."):
                words = f"{own.meaning}: {inner.meaning}" if own.meaning else inner.meaning
                yield replace(inner, heading=f"{own.heading}, {inner.heading}", meaning=words)
        elif own.kind:
            yield replace(own, key=prefix + name)


def _kind(hint: Any) -> Any:
    """Return the type of a field without None."""
    if get_origin(hint) in (Union, types.UnionType):
        inside = [each for each in get_args(hint) if each is not type(None)]
        return inside[0] if len(inside) == 1 else None
    return hint
