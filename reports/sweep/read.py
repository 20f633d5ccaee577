# SPDX-License-Identifier: BSD-3-Clause
"""The Parquet of a sweep, read by columns: without Mitsuba, and without a scene."""

import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from analytic.errors import InputError
from validation.study.row import COLUMNS, PROPERTY, STATUSES

FILE = "sweep.parquet"  #: in the folder of a sweep

Texts = NDArray[np.object_]
Numbers = NDArray[np.float64]

#: Columns without which nothing can be said.
_NEEDED = (
    *("key", "scene", "seed", "medium", "method", "label", "status", "reason"),
    *("error.relative_rmse", "error.rmse", "reference.error"),
)

_CELL = ("scene", "medium", "label", "width", "height")  #: what makes a cell one: the label has method and parameters
_ORDER = ("scene", "method", "label", "medium")


@dataclass(frozen=True)
class Sweep:
    """Rows by columns, one of each cell, sorted: the order in which they were finished is chance."""

    path: Path
    columns: Mapping[str, NDArray[Any]] = field(repr=False)  #: texts as objects, None for null; numbers with NaN
    properties: tuple[str, ...]  #: names of the scenes' properties, without what begins their columns
    superseded: int = 0  #: rows of cells that were computed again: by newer source code, or to be timed

    def __len__(self) -> int:
        return len(self.columns["key"])

    def texts(self, name: str) -> Texts:
        """Return a column of text, None for null; all None for one that the Parquet lacks."""
        missing = np.full(len(self), None, dtype=object)
        return self.columns.get(name, missing)

    def numbers(self, name: str) -> Numbers:
        """Return a column of numbers, NaN for null; truth values are 0 and 1; all NaN for one that it lacks."""
        missing = np.full(len(self), np.nan)
        return self.columns.get(name, missing)

    def property(self, name: str) -> Numbers:
        """Return a property of the scene of every row, NaN where it is not known."""
        return self.numbers(PROPERTY + name)

    def pictures(self, keys: Sequence[str]) -> dict[str, bytes]:
        """Return the pictures that the Parquet has of these rows, by key."""
        import pyarrow.compute as pc
        import pyarrow.parquet as pq

        with _reading(self.path):
            if not keys or "picture" not in pq.read_schema(self.path).names:
                return {}
            wanted = pc.field("key").isin(list(keys)) & pc.field("picture").is_valid()
            columns = ["key", "picture"]
            found = pq.read_table(self.path, columns=columns, filters=wanted, page_checksum_verification=True)
            return dict(zip(found["key"].to_pylist(), found["picture"].to_pylist()))


def read_sweep(path: Path | str) -> Sweep:
    """Read the rows of a sweep, from its Parquet or the folder that holds it.

    A file that is missing, cannot be read, has no rows or is not of this version is refused.
    """
    import pyarrow.parquet as pq

    file = _file_of(Path(path))
    with _reading(file):
        names = [name for name in pq.read_schema(file).names if name != "picture"]
        missing = [name for name in _NEEDED if name not in names]
        if missing:
            raise InputError(
                f"{file} has no column {missing[0]!r}, wanted the columns of a sweep of this version of airlight; "
                "run the sweep again: what its rows hold is kept"
            )
        known = {column.key for column in COLUMNS}
        wanted = [name for name in names if name in known or name.startswith(PROPERTY)]
        table = pq.read_table(file, columns=wanted, page_checksum_verification=True)
        columns = {name: _array(table[name]) for name in table.column_names}
    if not table.num_rows:
        raise InputError(f"{file} has no rows: no cell of the sweep has ended; run it to its end, or for longer")
    unknown = sorted(set(columns["status"]) - set(STATUSES))
    if unknown:
        raise InputError(f"{file} has the status {unknown[0]!r}, wanted one of {', '.join(STATUSES)}; run it again")
    kept = _current(columns)
    order = {row: tuple(natural(columns[name][row] or "") for name in _ORDER) for row in kept}
    kept.sort(key=order.__getitem__)
    columns = {name: values[kept] for name, values in columns.items()}
    properties = tuple(sorted(name.removeprefix(PROPERTY) for name in columns if name.startswith(PROPERTY)))
    return Sweep(file, columns, properties, superseded=table.num_rows - len(kept))


@contextmanager
def _reading(file: Path) -> Iterator[None]:
    """Say in a line what is wrong with a file that Arrow cannot read."""
    import pyarrow as pa

    try:
        yield
    except (pa.ArrowException, OSError) as error:
        words = " ".join(str(error).split())
        raise InputError(f"{file} cannot be read as Parquet: {words[:160]}; run the sweep again") from error


def natural(text: str) -> tuple[str | int, ...]:
    """Return what sorts text as a reader does: random:9 before random:10."""
    return tuple(int(part) if place % 2 else part for place, part in enumerate(re.split(r"(\d+)", text)))


def _current(columns: Mapping[str, NDArray[Any]]) -> list[int]:
    """Return the rows that count: of each cell one.

    The folder of a sweep keeps what earlier source code computed, with faults that were fixed since, and a cell may
    have been computed once for its error and once with the machine to itself for its time. The row of the source code
    that computed the cell last counts; of several such rows one that was timed alone, and else the last.
    """
    rows = range(len(columns["key"]))

    def column(name: str) -> list[Any]:
        values = columns.get(name)
        return [None] * len(rows) if values is None else values.tolist()

    started = [each or "" for each in column("origin.started")]
    source, alone = column("origin.source"), [each == 1 for each in column("cost.alone")]
    cells: dict[tuple[Any, ...], list[int]] = {}
    for row, cell in enumerate(zip(*(column(name) for name in _CELL))):
        # NaN, where a number is not known, is not equal to itself.
        cells.setdefault(tuple(None if each != each else each for each in cell), []).append(row)
    kept = []
    for several in cells.values():
        last = max(several, key=lambda row: (started[row], columns["key"][row]))
        same = [row for row in several if source[row] == source[last]]
        kept.append(max(same, key=lambda row: (alone[row], started[row], columns["key"][row])))
    return kept


def _file_of(path: Path) -> Path:
    """Return the Parquet that a path names."""
    file = path / FILE if path.is_dir() else path
    if not file.is_file():
        raise InputError(f"{file} is not there; wanted the folder of a sweep, `airlight sweep -o DIR`, or its Parquet")
    return file


def _array(column: Any) -> NDArray[Any]:
    """Return a column of Arrow as an array: texts as objects, all else as float64 with NaN for null."""
    import pyarrow as pa

    if pa.types.is_string(column.type) or pa.types.is_large_string(column.type):
        return np.array(column.to_pylist(), dtype=object)
    return np.asarray(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)
